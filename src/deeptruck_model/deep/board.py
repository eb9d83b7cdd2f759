"""TensorBoard's writer, whose errors are said once, by whoever writes."""

from __future__ import annotations

import threading
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch.utils.tensorboard import SummaryWriter


def board(folder: Path, start: int) -> SummaryWriter:
    """A writer of curves into `folder`, which begins at step `start`.

    It writes in a thread. Where that fails, as on a full disk, its next call raises the same OSError here.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from torch.utils.tensorboard import SummaryWriter
    _quiet_thread()
    return SummaryWriter(str(folder), purge_step=start)


def _quiet_thread() -> None:
    """Let the writer's thread print no traceback of what is raised here too; other errors are as before."""
    before = threading.excepthook
    if getattr(before, "__module__", "") == __name__:
        return

    def hook(given: threading.ExceptHookArgs) -> None:
        is_writer = type(given.thread).__module__.startswith("tensorboard.")
        if not (is_writer and isinstance(given.exc_value, OSError)):
            before(given)

    threading.excepthook = hook
