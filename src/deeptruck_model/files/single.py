"""Drafts and single files: written beside their place and renamed, removed where the process ends before."""

from __future__ import annotations

import errno
import glob
import itertools
import os
import secrets
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from deeptruck_model.errors import InputError
from deeptruck_model.files import ledger
from deeptruck_model.files.lock import ELSEWHERE

ADVICE = "make room or choose another --out"
RENAME = "choose another name"
LONGEST_NAME = 255  # bytes, on every disk in use
LONGEST_PATH = 4095
FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
_removals: list[Callable[[], object]] = []


@contextmanager
def removing(remove: Callable[[], object]) -> Iterator[None]:
    """`remove()` at the end of the block, or before, where the process ends without unwinding its stack."""
    _removals.append(remove)
    try:
        yield
    finally:
        with suppress(ValueError):
            _removals.remove(remove)
        remove()


def remove_all() -> None:
    """Remove what all open blocks have begun, the innermost first; for whoever ends the process at once."""
    while _removals:
        with suppress(Exception):
            _removals.pop()()


def check_length(path: Path, beside: str) -> None:
    """Raises InputError where the name of `path`, or that of a draft, longer by `beside`, is too long."""
    longest, name = LONGEST_NAME - len(beside), os.fsencode(path.name)
    if len(name) > longest:
        raise InputError(
            f"{path.name[:20]}... is a name of {len(name)} bytes; with what is written beside it at most "
            f"{longest} fit, choose a shorter one"
        )
    if len(os.fsencode(path.absolute())) + len(beside) > LONGEST_PATH:
        raise InputError(f"the path to {path.name} is too long for this system; choose a shorter one")


def check_writable(path: Path, elsewhere: str = ELSEWHERE) -> None:
    """Raises InputError where `path` could not be made or written; nothing is touched."""
    above = next(p for p in path.absolute().parents if p.exists() or p.is_symlink())
    if not above.is_dir():
        raise InputError(f"cannot write {path}: {above} is no folder; {elsewhere}")
    if not os.access(above, os.W_OK | os.X_OK):
        raise InputError(f"cannot write {path}: {above} may not be changed; {elsewhere}")


def check_new(path: Path) -> None:
    """Raises InputError where the single file `path` exists, cannot be written, or would be new in a finished
    result; nothing is touched."""
    _check_free(path)
    check_outside(path, RENAME)


def check_outside(path: Path, elsewhere: str = ELSEWHERE) -> None:
    """Raises InputError where `path` would be something new in a finished result; nothing is touched."""
    if not path.exists() and (result := ledger.inside(path)):
        raise InputError(
            f"{path} would lie in {result[0]}, {result[1]}, which holds nothing else; {elsewhere}"
        )


def _check_free(path: Path) -> None:
    check_length(path, "..12345678")
    if path.exists() or path.is_symlink():
        raise InputError(f"{path} exists already; {RENAME} or remove it")
    check_writable(path, RENAME)


@contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """A draft that becomes the single file `path` when the block ends well; it never replaces another.

    Where another came meanwhile, the new one is kept beside it, which the error says. Drafts of killed runs
    stay, and are named on standard error. Raises InputError where it exists or cannot be written, and on a
    full disk.
    """
    _check_free(path)
    name, suffix = glob.escape(path.stem), glob.escape(path.suffix)
    for other in sorted(path.parent.glob(f".{name}.????????{suffix}")):
        says = f"{other} is unfinished work on {path.name}; remove it if no run is at it"
        print(f"note: {says}", file=sys.stderr)
    draft = path.with_name(f".{path.stem}.{secrets.token_hex(4)}{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with removing(lambda: draft.unlink(missing_ok=True)):
            draft.touch(exist_ok=False)
            yield draft
            _put(draft, path)
    except OSError as error:
        cure = advice(error, f"make room or {RENAME}", RENAME)
        raise InputError(f"cannot write {path}: {error.strerror or error}; {cure}") from None


def _put(draft: Path, path: Path) -> None:
    try:
        _check_free(path)
    except InputError as error:
        kept = aside(path.with_name(f"{path.stem}.new{path.suffix}"))
        draft.rename(kept)
        raise InputError(f"{error}; the new one is whole, it is kept as {kept}") from None
    draft.rename(path)


def aside(wanted: Path) -> Path:
    """The wanted name, or the next free one."""
    names = (wanted.with_name(f"{wanted.name}{number or ''}") for number in itertools.count())
    return next(name for name in names if not name.exists() and not name.is_symlink())


def write(path: Path, content: bytes, where_full: str = ADVICE) -> None:
    """Write beside `path` and rename, folders made: a full disk or a kill leaves what was there before.

    For files inside a command's own folder. Raises InputError with one line where it cannot be written; it
    ends with `where_full` on a full disk.
    """
    draft = path.with_name(f".{path.name}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        draft.write_bytes(content)
        draft.replace(path)
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}; {advice(error, where_full)}") from None
    finally:
        with suppress(OSError):  # its folder is none, or cannot be written: then there is nothing to remove
            draft.unlink(missing_ok=True)


def rewrite(path: Path, content: bytes) -> None:
    """Write a file of work that goes on. What stands there and is not as this command left it is the user's:
    it is set aside first, beside the folder, and said. Raises InputError where it cannot be written."""
    if path.is_file() and not _is_ours(path, content):
        kept = aside(path.parent.with_name(f"{path.parent.name}.{path.name}.before"))
        path.rename(kept)
        print(f"note: {path} was changed since this command wrote it; it is kept as {kept}", file=sys.stderr)
    write(path, content)
    ledger.note_written(path)


def _is_ours(path: Path, content: bytes) -> bool:
    known = ledger.written_last(path)
    return (known is not None and known == ledger.print_of(path)) or path.read_bytes() == content


def advice(error: BaseException, where_full: str = ADVICE, else_where: str = ELSEWHERE) -> str:
    """What mends an error of writing: room helps a full disk alone, and no folder that may not be written."""
    return where_full if getattr(error, "errno", None) in FULL else else_where
