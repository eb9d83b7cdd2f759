"""One run at a time in a folder."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from deeptruck_model.errors import InputError


@contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Hold an existing folder against other runs; the hold ends with the block, or with the process.

    Raises InputError where another run holds it.
    """
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        raise InputError(
            f"another run is writing {folder}; wait until it has ended, or choose another --out"
        ) from None
    try:
        yield
    finally:
        os.close(handle)


def free(folder: Path) -> None:
    """Raises InputError where a run writes into the folder; one that is not there is free."""
    if folder.is_dir():
        with writing(folder):
            pass
