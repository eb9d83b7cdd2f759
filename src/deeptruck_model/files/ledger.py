"""The ledger of a folder: which command made it, and which files, each as that command left it.

    {"what": "a mismatch result", "files": {"verdict.json": {"bytes": 1234, "sha256": "..."}}}

A file with the right name and other content is the user's. In a folder that is still being worked on,
`at_work` is true or the prints are null: there a file is known by its name.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

LEDGER = ".deeptruck.json"

Print = dict[str, Any]  # of a file: its bytes and its sha256


@dataclass(frozen=True)
class Ledger:
    """What a folder is, `what`, and the print of each file; None for one that is known by its name alone.

    While the command is `at_work`, its files are those that `Result.names` says, and `prints` are of files
    that it writes again and again.
    """

    what: str
    prints: Mapping[str, Print | None]
    at_work: bool = False

    @property
    def files(self) -> Mapping[str, Print | None] | None:
        """The files that the folder consists of; None where that is not known yet."""
        return None if self.at_work else self.prints

    @property
    def whole(self) -> bool:
        """Whether the content of the files is known, as of a folder that was finished."""
        return not self.at_work and any(self.prints.values())

    def is_changed(self, folder: Path, name: str) -> bool:
        """Whether a listed file is no longer what was written."""
        known = (self.files or {}).get(name)
        if known is None:
            return False
        path = folder / name
        return path.stat().st_size != known["bytes"] or print_of(path) != known

    def to_bytes(self) -> bytes:
        """As it stands in the file."""
        work = {"at_work": True} if self.at_work else {}
        return (json.dumps({"what": self.what, "files": self.prints, **work}, indent=1) + "\n").encode()


def read(folder: Path) -> Ledger | None:
    """The ledger in `folder`; None where there is none that can be read."""
    path = folder / LEDGER
    try:
        if path.is_symlink() or not path.is_file():
            return None
        content = json.loads(path.read_text())
        prints = {str(name): _print(known) for name, known in content["files"].items()}
        return Ledger(str(content["what"]), prints, bool(content.get("at_work")))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def of(what: str, folder: Path, names: Iterable[str]) -> Ledger:
    """The ledger of a finished folder, of which these files are the command's."""
    return Ledger(what, {name: print_of(folder / name) for name in sorted(names)})


def put(known: Ledger, folder: Path) -> None:
    """Replace the ledger of a folder. Raises OSError."""
    draft = folder / f".{LEDGER}.tmp"
    draft.write_bytes(known.to_bytes())
    draft.replace(folder / LEDGER)


def listed_inside(folder: Path) -> set[str]:
    """The files that ledgers further inside a folder list, and these ledgers, relative to it."""
    found = set()
    for path in folder.rglob(LEDGER):
        known = read(path.parent)
        if path.parent != folder and known is not None and known.files is not None:
            found |= {(path.parent / name).relative_to(folder).as_posix() for name in (*known.files, LEDGER)}
    return found


def written_last(path: Path) -> Print | None:
    """The print of a file that a command writes again and again, as it last left it; None where it never did
    or the folder has no ledger of work that goes on."""
    known = read(path.parent)
    return known.prints.get(path.name) if known is not None and known.at_work else None


def note_written(path: Path) -> None:
    """Remember how a command that goes on in this folder left one of its files. Raises OSError."""
    known = read(path.parent)
    if known is not None and known.at_work:
        put(Ledger(known.what, {**known.prints, path.name: print_of(path)}, at_work=True), path.parent)


def is_as_written(path: Path) -> bool:
    """Whether the ledger of a finished folder knows this file as it is."""
    folder, name = path.absolute().parent, path.name
    known = read(folder)
    return known is not None and bool((known.files or {}).get(name)) and not known.is_changed(folder, name)


def renew(path: Path) -> None:
    """Tell the ledgers above a file of ours that this tool has changed it. Raises OSError."""
    changed = [path.absolute()]  # and the ledgers that tell of it, which those further up know too
    for folder in path.absolute().parents:
        known = read(folder)
        anew = {name: one for one in changed if (name := one.relative_to(folder).as_posix())}
        if known is None or known.files is None or not anew.keys() & known.files.keys():
            continue
        prints = {name: print_of(one) for name, one in anew.items() if name in known.files}
        put(Ledger(known.what, {**known.files, **prints}), folder)
        changed.append(folder / LEDGER)


def inside(out: Path) -> tuple[Path, str] | None:
    """The nearest finished result in whose folder `out` lies, and what it is; None where there is none."""
    for folder in out.absolute().parents:
        known = read(folder)
        if known is not None and known.whole:
            return folder, known.what
    return None


def around(out: Path) -> tuple[Path, str] | None:
    """The folder above `out` whose ledger lists files in `out`, and what it is; None where there is none."""
    place = out.absolute()
    for folder in place.parents:
        known = read(folder)
        inside = f"{place.relative_to(folder).as_posix()}/"
        if known is not None and any(name.startswith(inside) for name in known.files or ()):
            return folder, known.what
    return None


def print_of(path: Path) -> Print:
    """Size and SHA-256 of a file."""
    with path.open("rb") as file:
        return {"bytes": path.stat().st_size, "sha256": hashlib.file_digest(file, "sha256").hexdigest()}


def _print(known: Any) -> Print | None:
    """Raises TypeError or KeyError for what is no print."""
    return None if known is None else {"bytes": int(known["bytes"]), "sha256": str(known["sha256"])}
