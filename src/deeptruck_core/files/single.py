"""Single files: written to a draft in the same folder and renamed; drafts are removed if the process is
killed by a signal.
"""

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

from deeptruck_core.errors import InputError
from deeptruck_core.files.lock import ELSEWHERE

ADVICE = "make room or choose another --out"
RENAME = "choose another name"
FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
_removals: list[Callable[[], object]] = []


@contextmanager
def removing(remove: Callable[[], object]) -> Iterator[None]:
    """Call `remove()` at the end of the block, or before if the process ends without unwinding its stack."""
    _removals.append(remove)
    try:
        yield
    finally:
        with suppress(ValueError):
            _removals.remove(remove)
        remove()


def remove_all() -> None:
    """Call `remove` of all open blocks, innermost first; for code that ends the process at once."""
    while _removals:
        with suppress(Exception):
            _removals.pop()()


def advice(error: BaseException, where_full: str = ADVICE, else_where: str = ELSEWHERE) -> str:
    """The remedy for a write error: space, if the disk is full."""
    return where_full if getattr(error, "errno", None) in FULL else else_where


def check_writable(path: Path, draft: str, elsewhere: str = ELSEWHERE) -> None:
    """Raises InputError if `path`, or a file in the same folder with the longer name `draft`, could not be
    written; nothing is changed."""
    above = next(p for p in path.absolute().parents if os.path.lexists(p))
    if not above.is_dir():
        raise InputError(f"cannot write {path}: {above} is no folder; {elsewhere}")
    if not os.access(above, os.W_OK | os.X_OK):
        raise InputError(f"cannot write {path}: {above} may not be changed; {elsewhere}")
    try:
        os.lstat(above / draft)
        os.lstat(path.absolute().parent / draft)
    except FileNotFoundError:
        return
    except OSError as error:
        raise InputError(f"cannot write {path.name[:20]}...: {error.strerror}; {elsewhere}") from None


def check_free(path: Path) -> None:
    """Raises InputError if the single file `path` exists or cannot be written; nothing is changed."""
    if os.path.lexists(path):
        raise InputError(f"{path} exists already; {RENAME} or remove it")
    check_writable(path, f"..{path.stem}12345678{path.suffix}", RENAME)


@contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """A draft that becomes the single file `path` if the block succeeds; it never replaces a file.

    If another file appeared meanwhile, the new one is kept as NAME.new, which the error says. Drafts of
    killed runs are kept and named on standard error. Raises InputError if `path` exists or cannot be written,
    and on a full disk.
    """
    check_free(path)
    for other in sorted(path.parent.glob(f".{glob.escape(path.stem)}.????????{glob.escape(path.suffix)}")):
        print(
            f"note: {other} is unfinished work on {path.name}; remove it if no run is at it", file=sys.stderr
        )
    draft = path.with_name(f".{path.stem}.{secrets.token_hex(4)}{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with removing(lambda: draft.unlink(missing_ok=True)):
            draft.touch(exist_ok=False)
            yield draft
            try:
                check_free(path)
            except InputError as error:
                kept = draft.rename(aside(path.with_name(f"{path.stem}.new{path.suffix}")))
                raise InputError(f"{error}; the new one is whole, it is kept as {kept}") from None
            draft.rename(path)
    except OSError as error:
        cure = advice(error, f"make room or {RENAME}", RENAME)
        raise InputError(f"cannot write {path}: {error.strerror or error}; {cure}") from None


def aside(wanted: Path) -> Path:
    """The desired name, or the next free one."""
    names = (wanted.with_name(f"{wanted.name}{number or ''}") for number in itertools.count())
    return next(name for name in names if not os.path.lexists(name))


def write(path: Path, content: bytes, where_full: str = ADVICE) -> None:
    """Write a draft and rename it to `path`, creating folders: a full disk or a kill leaves the previous
    file.

    For files inside a command's own folder. Raises InputError with one line if it cannot be written; on a
    full disk the line ends with `where_full`.
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
