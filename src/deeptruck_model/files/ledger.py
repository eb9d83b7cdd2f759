"""The ledger of a folder: which command made it, and which files, each as that command left it.

A file with the right name and other content is the user's. Ledgers of earlier versions list names alone; in
their folders, and in those that are still being worked on, a file is known by its name.
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
    """What a folder is, `what`, and the files in it.

    `files` has the print of each; None for one that is known by its name alone. Where all of it is None the
    command is still at work, and its files are those that `Result.names` says.
    """

    what: str
    files: Mapping[str, Print | None] | None

    @property
    def whole(self) -> bool:
        """Whether the content of the files is known, as of a folder that was finished."""
        return self.files is not None and any(self.files.values())

    def is_changed(self, folder: Path, name: str) -> bool:
        """Whether a listed file is no longer what was written."""
        known = (self.files or {}).get(name)
        if known is None:
            return False
        path = folder / name
        return path.stat().st_size != known["bytes"] or _sha256(path) != known["sha256"]


def read(folder: Path) -> Ledger | None:
    """The ledger in `folder`; None where there is none that can be read."""
    path = folder / LEDGER
    try:
        if path.is_symlink() or not path.is_file():
            return None
        told = json.loads(path.read_text())
        what, files = str(told["what"]), told["files"]
        if told.get("at_work"):
            return Ledger(what, None)
        if isinstance(files, list):  # of an earlier version
            return Ledger(what, dict.fromkeys(map(str, files)))
        return Ledger(what, {str(name): _print(known) for name, known in files.items()})
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def written(what: str, folder: Path, names: Iterable[str]) -> bytes:
    """The ledger of a finished folder, of which these files are the command's."""
    return _text({"what": what, "files": {name: print_of(folder / name) for name in sorted(names)}})


def listed_inside(folder: Path) -> set[str]:
    """The files that ledgers further inside a folder list, and these ledgers, relative to it."""
    found = set()
    for path in folder.rglob(LEDGER):
        known = read(path.parent)
        if path.parent != folder and known is not None and known.files is not None:
            found |= {(path.parent / name).relative_to(folder).as_posix() for name in (*known.files, LEDGER)}
    return found


def by_name(what: str, names: set[str]) -> bytes:
    """The ledger of a folder whose files are still changing."""
    return _text({"what": what, "files": dict.fromkeys(sorted(names - {LEDGER}))})


def at_work(what: str) -> bytes:
    """The ledger of a folder in which a command works, and which files it will write is not known yet."""
    return _text({"what": what, "files": {}, "at_work": True})


def written_last(path: Path) -> Print | None:
    """The print of a file that a command writes again and again, as it last left it; None where it never did
    or the folder has no ledger of work that goes on."""
    try:
        told = json.loads((path.parent / LEDGER).read_text())
        return _print(told["files"].get(path.name)) if told.get("at_work") else None
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def note_written(path: Path) -> None:
    """Remember how a command that goes on in this folder left one of its files. Raises OSError."""
    place = path.parent / LEDGER
    try:
        told = json.loads(place.read_text())
        at_work, files = bool(told["at_work"]), dict(told["files"])
    except (OSError, ValueError, KeyError, TypeError):
        return
    if at_work:
        draft = path.with_name(f".{LEDGER}.tmp")
        draft.write_bytes(_text({**told, "files": {**files, path.name: print_of(path)}}))
        draft.replace(place)


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
        draft = folder / f".{LEDGER}.tmp"
        draft.write_bytes(_text({"what": known.what, "files": {**known.files, **prints}}))
        draft.replace(folder / LEDGER)
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
    return {"bytes": path.stat().st_size, "sha256": _sha256(path)}


def _print(known: Any) -> Print | None:
    """Raises TypeError or KeyError for what is no print."""
    return None if known is None else {"bytes": int(known["bytes"]), "sha256": str(known["sha256"])}


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _text(content: Mapping[str, Any]) -> bytes:
    return (json.dumps(content, indent=1) + "\n").encode()
