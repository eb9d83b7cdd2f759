"""One file at a time: written beside its place and renamed; what mends an error of writing."""

from __future__ import annotations

import errno
import glob
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from deeptruck_model.errors import InputError
from deeptruck_model.files import ledger

ADVICE = "make room or choose another --out"
ELSEWHERE = "choose another --out"
RENAME = "choose another name"
FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}


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
    if path.exists() or path.is_symlink():
        raise InputError(f"{path} exists already; {RENAME} or remove it")
    check_writable(path, RENAME)


@contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """A draft that becomes the single file `path` when the block ends well; it never replaces another.

    Drafts of killed runs stay, and are named on standard error. Raises InputError where it exists or cannot
    be written, and on a full disk.
    """
    _check_free(path)
    name, suffix = glob.escape(path.stem), glob.escape(path.suffix)
    for other in sorted(path.parent.glob(f".{name}.????????{suffix}")):
        says = f"{other} is unfinished work on {path.name}; remove it if no run is at it"
        print(f"note: {says}", file=sys.stderr)
    draft = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        number, name = tempfile.mkstemp(prefix=f".{path.stem}.", suffix=path.suffix, dir=path.parent)
        os.close(number)
        draft = Path(name)
        draft.chmod(0o666 & ~umask())
        yield draft
        _check_free(path)
        draft.rename(path)
    except OSError as error:
        cure = advice(error, f"make room or {RENAME}", RENAME)
        raise InputError(f"cannot write {path}: {error.strerror or error}; {cure}") from None
    finally:
        if draft is not None:
            draft.unlink(missing_ok=True)


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


def advice(error: BaseException, where_full: str = ADVICE, else_where: str = ELSEWHERE) -> str:
    """What mends an error of writing: room helps a full disk alone, and no folder that may not be written."""
    return where_full if getattr(error, "errno", None) in FULL else else_where


def umask() -> int:
    """The bits that new files lack."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
