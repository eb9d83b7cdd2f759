"""Names of drafts and of older and newer results next to a result.

.NAME.unfinished         work that --resume continues
.NAME.????????.tmp       a draft, which replaces NAME when complete
.NAME.PID.new            a recording that replaces an older NAME when complete
.NAME.PID.old            an older NAME, while the new one is being renamed
.NAME.PID.unfinished     work that was set aside because the user started again
NAME.new                 a complete result whose intended name was taken at the end
NAME.old                 an older NAME that was never finished, so that the owner of its files is unknown
"""

from __future__ import annotations

import glob
import itertools
import os
import re
import sys
from contextlib import suppress
from pathlib import Path

from deeptruck_model.errors import InputError
from deeptruck_model.files.lock import free

DRAFT = re.compile(r"^\.(.+?)(\.\w{8}\.tmp|\.tmp|\.unfinished|\.\d+\.(?:old|new|unfinished))$")
LONGEST = "..{}." + str(2**22) + ".unfinished"  # of these names; 2**22 is the largest number of a process
_BESIDE = {
    "old": "an older {name}, which a run that was killed had set aside; rename it or remove it",
    "new": "another {name}, whose run could not put it in place; 'deeptruck-model repair' mends it if it is "
    "not whole; rename it or remove it",
    "unfinished": "begun work on {name} that was set aside; remove it, or rename it to .{name}.unfinished "
    "and add --resume",
}
kept: list[Path] = []  # drafts that this process left, with a file to go on from
_printed: set[str] = set()  # by this process: several checks look at one bag


def straight(out: Path) -> Path:
    """The same path without '..', because 'a/../a' does not exist while a is being renamed."""
    return Path(os.path.realpath(out.parent)) / out.name if ".." in out.parent.parts else out


def unfinished(out: Path) -> Path:
    """Path of the resumable draft of `out`."""
    return out.parent / f".{out.name}.unfinished"  # '.' has no name that could be exchanged


def beside(out: Path, suffix: str) -> Path:
    """A free name next to `out`, with this process's number, since a killed run may have had the same
    number."""
    names = (out.with_name(f".{out.name}.{os.getpid() + number}.{suffix}") for number in itertools.count())
    return next(name for name in names if not os.path.lexists(name))


def final(path: Path) -> Path:
    """The final name of a draft; any other path is returned unchanged."""
    return path.with_name(DRAFT.sub(r"\1", path.name))


def left_beside(out: Path) -> list[str]:
    """One sentence for each file of a killed run next to `out` that a user may want to recover; no file is
    removed."""
    return [
        f"{place} is {text.format(name=out.name)}"
        for suffix, text in _BESIDE.items()
        for place in sorted(out.parent.glob(f".{glob.escape(out.name)}.[0-9]*.{suffix}"))
        if DRAFT.match(place.name) and not _is_held(place)
    ]


def print_left_beside(out: Path) -> None:
    """Print `left_beside` on standard error, each sentence once per process."""
    for line in left_beside(out):
        if line not in _printed:
            _printed.add(line)
            print(f"note: {line}", file=sys.stderr)


def _is_held(place: Path) -> bool:
    """Whether a run is still working there."""
    with suppress(OSError):
        try:
            free(place)
        except InputError:
            return True
    return False
