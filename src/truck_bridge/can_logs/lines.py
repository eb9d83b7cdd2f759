"""The lines of a text log, each counted: what is no frame is set aside with its place, never in silence."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

from deeptruck_core.account import Account
from truck_bridge.can_logs.frames import COPY, Frame, of_message
from truck_bridge.errors import InputError

LONGEST = 1 << 16  # characters of a line; a CAN FD frame has some 250
WHOLE = 8  # bytes of nearly every J1939 frame: a shorter one without a line's end may be cut
NO_FRAME = "lines that are no frame"
CUT = "frame cut off at the end of the log"


def lines_of(path: Path) -> Iterator[tuple[int, str]]:
    """Number and text of each line. Raises InputError at a line longer than LONGEST, which could fill the
    memory."""
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        for number, line in enumerate(iter(partial(file.readline, LONGEST), ""), 1):
            if len(line) >= LONGEST:
                raise InputError(
                    f"{path}, line {number}: longer than {LONGEST} characters, as no frame is; {COPY}"
                )
            yield number, line


def is_cut(line: str, frame: Frame | None) -> bool:
    """Whether a line without its end, the last of a log, was cut off when its recorder was killed."""
    return not line.endswith("\n") and (frame is None or len(frame.data) < max(frame.length, WHOLE))


def set_aside_cut(path: Path, number: int, account: Account) -> None:
    """Count a line in which the recorder was killed."""
    account.total.set_aside(CUT, f"in line {number}")
    account.remarks.append(f"{path} is cut off in its last line, {number}, which is left out")


class ForLibrary:
    """The lines of a log as an open file for one of python-can's readers, which pass over what they do not
    know without a word: of the lines that match `entry` each is a frame, or set aside.

    Lines that match `omit` are set aside for the reason `omitted`, and not shown to the reader.
    """

    def __init__(
        self, path: Path, account: Account, entry: str, *, omit: str = "(?!)", omitted: str = ""
    ) -> None:
        self._path, self._account = path, account
        self._entry, self._omit, self._omitted = re.compile(entry), re.compile(omit), omitted
        self._number, self._line = 0, "\n"
        self._open: list[tuple[int, str]] = []  # entries of which no frame has come yet
        self._lines = self._shown()

    def __iter__(self) -> Iterator[str]:
        return self._lines  # the readers go on where they stopped behind the head

    def _shown(self) -> Iterator[str]:
        for number, line in lines_of(self._path):
            if self._entry.match(line):
                self._account.total.read += 1
                if self._omit.search(line):
                    self._account.total.set_aside(self._omitted, f"in line {number}")
                    continue
                self._open.append((number, line))
            self._number, self._line = number, line
            yield line

    def read(self) -> str:
        """Marks an open file for python-can; its readers only iterate."""
        raise NotImplementedError

    def close(self) -> None:
        """Nothing to close: the file closes after its last line."""

    def frames(self, reader: Any, *, first_bus: int) -> Iterator[Frame]:
        """The frames of a reader of these lines, which counts buses from `first_bus`. Raises InputError at a
        line that it cannot read."""
        try:
            for message in reader:
                number, line = self._open.pop()
                self._set_aside()
                bus = message.channel if isinstance(message.channel, int) else first_bus
                frame = of_message(message, str(bus + 1 - first_bus))
                if is_cut(line, frame):
                    set_aside_cut(self._path, number, self._account)
                else:
                    yield frame
        except InputError:
            raise
        except ValueError:
            if self._line.endswith("\n"):
                raise InputError(
                    f"{self._path}, line {self._number}: not a frame: {self._line.strip()[:60]!a}; remove it "
                    "where the lines around it are sound"
                ) from None
        self._set_aside()

    def _set_aside(self) -> None:
        for number, line in self._open:
            if is_cut(line, None):
                set_aside_cut(self._path, number, self._account)
            else:
                self._account.total.set_aside(NO_FRAME, f"in line {number}")
        self._open.clear()
