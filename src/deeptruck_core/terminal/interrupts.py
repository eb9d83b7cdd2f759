"""Ends a command on an interrupt: in order if its stack unwinds soon, otherwise at once with its drafts
removed.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock, Timer
from types import FrameType

from deeptruck_core.files.single import remove_all
from deeptruck_core.terminal.script_start import INTERRUPTED, end_at_once

GRACE_S = (
    1.0  # for unwinding: a library's compiler may swallow the exception, and compiled code does not see it
)
SHOW_CURSOR = "\x1b[?25h"
PR_SET_PDEATHSIG = 1  # of Linux's prctl
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
REPLACED = (signal.SIG_DFL, signal.default_int_handler, end_at_once)


class Interrupt:
    """An interrupt of the running command. `end` prints the `last_words` and never returns."""

    def __init__(self, last_words: Callable[[], object]) -> None:
        self.asked = False
        self._last_words = last_words
        self._ending = Lock()

    def __call__(self, _number: int, frame: FrameType | None) -> None:
        """Signal handler: raises KeyboardInterrupt, or ends the process where an exception must not be
        raised."""
        if self.asked:  # once more, while the first one's cleaning is under way
            return
        self.asked = True
        sys.unraisablehook = lambda _: None  # where the exception is swallowed it is not printed either
        for process in _descendants():  # not ignored by what a shell has started in the background
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGTERM)
        if not may_raise(frame):
            self.end()
        timer = Timer(GRACE_S, self.end)
        timer.daemon = True
        timer.start()
        raise KeyboardInterrupt

    def end(self) -> None:
        """End the process at once, because threads of compiled libraries can crash an interpreter that shuts
        down."""
        self._ending.acquire()  # never released: who comes second waits for the end
        remove_all()
        with suppress(Exception):
            sys.stdout.flush()
        if sys.stderr.isatty():
            sys.stderr.write(SHOW_CURSOR)
        self._last_words()
        sys.stderr.flush()
        os._exit(INTERRUPTED)


@contextmanager
def heeded(last_words: Callable[[], object]) -> Iterator[Interrupt]:
    """End the block on Ctrl-C, and on the signals of a job queue or a closed terminal unless these are
    ignored (nohup).

    A terminal's Ctrl-C reaches all processes of a command; so does each of these signals.
    """
    interrupt = Interrupt(last_words)
    before = {number: signal.getsignal(number) for number in SIGNALS}
    ours = [number for number, handler in before.items() if handler in REPLACED]
    for number in ours:
        signal.signal(number, interrupt)
    try:
        yield interrupt
    finally:
        for number in ours:
            if signal.getsignal(number) is interrupt:
                signal.signal(number, before[number])


@contextmanager
def held_back() -> Iterator[None]:
    """Delay Ctrl-C to the end of the block, and keep it from processes that are started in it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end_with_parent(parent: int) -> None:
    """In a process that the process `parent` started: be killed when that one ends, in whatever way
    (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it ended before
        os._exit(1)


def may_raise(frame: FrameType | None) -> bool:
    """Whether an exception may be raised in a frame: neither during an import nor in numba.

    A half-loaded library may abort the process. numba's compiled wrappers ignore exceptions of the Python
    code that they call and use its result, which crashes the process.
    """
    while frame is not None:
        name = frame.f_globals.get("__name__") or ""
        if name == "importlib._bootstrap" or name.partition(".")[0] == "numba":
            return False
        frame = frame.f_back
    return True


def _descendants() -> list[int]:
    """Processes started by this one, and theirs."""
    parent = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            parent[int(stat.parent.name)] = int(stat.read_text().rpartition(")")[2].split()[1])
    found = [os.getpid()]
    for process in found:  # grows as it goes
        found += [child for child, of in parent.items() if of == process]
    return found[1:]
