"""The ledger of a folder: which command made it, with size and SHA-256 of each file that it wrote.

    {"what": "a mismatch result", "files": {"verdict.json": {"bytes": 1234, "sha256": "..."}}}

A listed file with other content belongs to the user. While a command works in the folder, `at_work` is true
or size and hash are null; files are then identified by name.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from deeptruck_model.errors import InputError
from deeptruck_model.files.lock import ELSEWHERE
from deeptruck_model.files.single import RENAME, aside, check_free, write

LEDGER = ".deeptruck.json"
Print = dict[str, Any]  # of a file: its bytes and its sha256


@dataclass(frozen=True)
class Ledger:
    """The command that made a folder, and size and hash of each file; None for a file that is identified by
    name only.

    While the command is `at_work`, its files are those in `Result.names`, and `prints` are those of files
    that it writes repeatedly.
    """

    what: str
    prints: Mapping[str, Print | None]
    at_work: bool = False

    @property
    def files(self) -> Mapping[str, Print | None] | None:
        """The files of the folder; None if not yet known."""
        return None if self.at_work else self.prints

    @property
    def whole(self) -> bool:
        """Whether size and hash of all files are known, as for a finished folder."""
        return not self.at_work and any(self.prints.values())

    def changed(self, folder: Path) -> str | None:
        """The first listed file in `folder` that differs from what was written; None if there is none."""
        known = ((name, one) for name, one in (self.files or {}).items() if one and (folder / name).is_file())
        return next((name for name, one in known if print_of(folder / name) != one), None)

    def to_bytes(self) -> bytes:
        """The content of the ledger's file."""
        content = {"what": self.what, "files": self.prints} | ({"at_work": True} if self.at_work else {})
        return (json.dumps(content, indent=1) + "\n").encode()

    def put(self, folder: Path) -> None:
        """Write the ledger into a folder. Raises InputError if that fails."""
        write(folder / LEDGER, self.to_bytes())


def read(folder: Path) -> Ledger | None:
    """The ledger in `folder`; None if there is no readable one."""
    path = folder / LEDGER
    try:
        if path.is_symlink() or not path.is_file():
            return None
        content = json.loads(path.read_text())
        prints = {
            str(name): one and {"bytes": int(one["bytes"]), "sha256": str(one["sha256"])}
            for name, one in content["files"].items()
        }
        return Ledger(str(content["what"]), prints, bool(content.get("at_work")))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def print_of(path: Path) -> Print:
    """Size and SHA-256 of a file."""
    with path.open("rb") as file:
        return {"bytes": path.stat().st_size, "sha256": hashlib.file_digest(file, "sha256").hexdigest()}


def prints_of(folder: Path, names: Iterable[str]) -> dict[str, Print | None]:
    """Size and SHA-256 of these files in a folder, by name."""
    return {name: print_of(folder / name) for name in sorted(names)}


def listed_inside(folder: Path) -> set[str]:
    """The files listed by ledgers in subfolders, and these ledgers, as paths relative to the folder."""
    inner = ((p.parent, read(p.parent)) for p in folder.rglob(LEDGER) if p.parent != folder)
    listed = ((place, (*known.files, LEDGER)) for place, known in inner if known and known.files is not None)
    return {(place / name).relative_to(folder).as_posix() for place, names in listed for name in names}


def is_as_written(path: Path) -> bool:
    """Whether a finished folder's ledger lists this file with its present content."""
    known = read(path.absolute().parent)
    listed = (known.files or {}).get(path.name) if known is not None else None
    return listed is not None and listed == print_of(path)


def renew(path: Path) -> None:
    """Update the ledgers above a file that this tool has changed. Raises InputError if that fails."""
    changed = [path.absolute()]  # and the ledgers that list it, which those further up list too
    for folder in path.absolute().parents:
        known = read(folder)
        names = {one.relative_to(folder).as_posix() for one in changed}
        if known is not None and (names := names & (known.files or {}).keys()):
            replace(known, prints={**known.prints, **prints_of(folder, names)}).put(folder)
            changed.append(folder / LEDGER)


def rewrite(path: Path, content: bytes) -> None:
    """Write a file of unfinished work. An existing file that this command did not leave in its present state
    belongs to the user: it is moved next to the folder, and a message is printed. Raises InputError if the
    file cannot be written."""
    known = read(path.parent)
    known = known if known is not None and known.at_work else None
    last = known.prints.get(path.name) if known else None
    if path.is_file() and path.read_bytes() != content and print_of(path) != last:
        kept = path.rename(aside(path.parent.with_name(f"{path.parent.name}.{path.name}.before")))
        print(f"note: {path} was changed since this command wrote it; it is kept as {kept}", file=sys.stderr)
    write(path, content)
    if known:
        replace(known, prints={**known.prints, path.name: print_of(path)}).put(path.parent)


def check_new(path: Path) -> None:
    """Raises InputError if the single file `path` exists, cannot be written, or would be added to a finished
    result; nothing is changed."""
    check_free(path)
    check_outside(path, RENAME)


def check_outside(path: Path, elsewhere: str = ELSEWHERE) -> None:
    """Raises InputError if `path` is a part of a finished result, or would be added to one."""
    place = path.absolute()
    for folder in place.parents:
        known, inside = read(folder), place.relative_to(folder).as_posix()
        if known is None or known.files is None:
            continue
        if any(name.startswith(f"{inside}/") for name in known.files):
            raise InputError(f"{path} is part of {known.what}, {folder}; {elsewhere}")
        if known.whole and not path.exists():
            raise InputError(
                f"{path} would lie in {folder}, {known.what}, which holds nothing else; {elsewhere}"
            )
