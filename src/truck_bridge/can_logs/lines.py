"""The lines of a text log: each is a frame, or set aside with its place, whoever parses them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path

from deeptruck_core.account import Account
from truck_bridge.can_logs.frames import COPY, Frame
from truck_bridge.errors import InputError

LONGEST = 1 << 16  # characters of a line, above which it could fill the memory; a CAN FD frame has some 250
WHOLE = 8  # bytes of nearly every J1939 frame: a shorter one without a line's end may be cut
NO_FRAME = "lines that are no frame"
CUT = "frame cut off at the end of the log"


class Lines:
    """The lines of a log below its first `head` ones, as an open file for one that parses them: python-can's
    reader or ours, which pass over what they do not know without a word.

    Of the lines that match `entry` each is counted as read. Those that match `omit` are set aside for the
    reason `omitted`, and not shown.
    """

    def __init__(
        self,
        path: Path,
        account: Account,
        entry: str = r"\s*\S",
        *,
        head: int = 0,
        omit: str = "(?!)",
        omitted: str = "",
    ) -> None:
        self._path, self._account, self._head = path, account, head
        self._entry, self._omit, self._omitted = re.compile(entry), re.compile(omit), omitted
        self._number, self._line = 0, "\n"
        self._open: list[tuple[int, str]] = []  # entries of which no frame has come yet
        self._lines = self._shown()

    def __iter__(self) -> Iterator[str]:
        return self._lines  # the readers go on where they stopped behind the head

    def read(self) -> str:
        """Marks an open file for python-can; its readers only iterate."""
        raise NotImplementedError

    def close(self) -> None:
        """Nothing to close: the file closes after its last line."""

    def _shown(self) -> Iterator[str]:
        is_entry, is_omitted, tally = self._entry.match, self._omit.match, self._account.total
        with self._path.open(encoding="utf-8-sig", errors="replace") as file:
            for number, line in enumerate(iter(partial(file.readline, LONGEST), ""), 1):
                if len(line) >= LONGEST:
                    too_long = f"longer than {LONGEST} characters, as no frame is"
                    raise InputError(f"{self._path}, line {number}: {too_long}; {COPY}")
                if number <= self._head:
                    continue
                if is_entry(line):
                    tally.read += 1
                    if is_omitted(line):
                        tally.set_aside(self._omitted, f"in line {number}")
                        continue
                    self._open.append((number, line))
                self._number, self._line = number, line
                yield line

    def frames(self, parsed: Iterable[Frame]) -> Iterator[Frame]:
        """The frames that were parsed of these lines, each from the last line that was shown.

        Raises InputError at a line that python-can cannot pass over.
        """
        try:
            for frame in parsed:
                number, line = self._open.pop()
                if self._open:
                    self._set_aside()
                if line[-1] != "\n" and number > 1 and len(frame.data) < max(frame.length, WHOLE):
                    self._open.append((number, line))
                else:
                    yield frame
        except InputError:
            raise
        except ValueError:
            if self._line.endswith("\n"):
                raise InputError(
                    f"{self._path}, line {self._number}: not a frame: {_quoted(self._line)}; remove it "
                    "where the lines around it are sound"
                ) from None
        self._set_aside()

    def _set_aside(self) -> None:
        """Count the entries of which no frame has come: noise, or the last line of a recorder that was
        killed, without its end."""
        for number, line in self._open:
            if line.endswith("\n") or number == 1:
                self._account.total.set_aside(NO_FRAME, f"in line {number}: {_quoted(line)}")
            else:
                self._account.total.set_aside(CUT, f"in line {number}")
                self._account.remarks.append(
                    f"{self._path} is cut off in its last line, {number}, which is left out"
                )
        self._open.clear()


def _quoted(line: str) -> str:
    return ascii(line.strip()[:60])
