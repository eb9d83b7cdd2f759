"""Imported first by each console script, so that Ctrl-C during the following imports also gives one line.

In any other program importing this does nothing.
"""

from __future__ import annotations

import os
import signal
import sys

SCRIPTS = {
    "deeptruck-model",
    "deeptruck-cacc",
    "truck-bridge",
    "deeptruck-simulation",
    "deeptruck-vehicle",
    "deeptruck-replay",
}
INTERRUPTED = 130


def end_at_once(_number: int, _frame: object) -> None:
    """Handler for Ctrl-C before there is anything to clean up."""
    os.write(2, f"{_program()}: interrupted\n".encode())
    os._exit(INTERRUPTED)


def _program() -> str:
    return os.path.basename(sys.argv[0])  # noqa: PTH119 - pathlib takes long to import


if _program() in SCRIPTS and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, end_at_once)
