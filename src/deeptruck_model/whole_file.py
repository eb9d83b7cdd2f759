"""Files that are there as a whole or not at all, alone or together."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from deeptruck_model.errors import InputError

ADVICE = "make room or choose another --out"
ELSEWHERE = "choose another --out"
FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}


def advice(error: BaseException, where_full: str = ADVICE, else_where: str = ELSEWHERE) -> str:
    """What mends an error of writing: room helps a full disk alone, and no folder that may not be written."""
    return where_full if getattr(error, "errno", None) in FULL else else_where


def write(path: Path, content: bytes, where_full: str = ADVICE) -> None:
    """Write beside `path` and rename, folders made: a full disk or a kill leaves what was there before.

    Raises InputError with one line where that cannot be written; it ends with `where_full` on a full disk.
    """
    unfinished = path.with_name(f".{path.name}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished.write_bytes(content)
        unfinished.replace(path)
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}; {advice(error, where_full)}") from None
    finally:
        _remove(unfinished)


@contextmanager
def together(folder: Path) -> Iterator[Path]:
    """A draft folder whose files move into `folder` when the block ends well; else `folder` stays as it was.

    Other files in `folder` are left alone. Raises InputError with one line where it cannot be written.
    """
    draft, new = folder / f".{os.getpid()}.tmp", not folder.exists()
    try:
        draft.mkdir(parents=True)
        yield draft
        for file in sorted(draft.iterdir()):
            file.replace(folder / file.name)
    except OSError as error:
        raise InputError(f"cannot write {folder}: {error.strerror or error}; {advice(error)}") from None
    finally:
        shutil.rmtree(draft, ignore_errors=True)
        if new:
            with suppress(OSError):  # it holds what was written
                folder.rmdir()


def check_folder(folder: Path) -> None:
    """Raises InputError where files cannot be written into `folder`; called before long computing."""
    with together(folder) as draft:
        (draft / "file").write_bytes(b"")
        (draft / "file").unlink()


def _remove(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError:  # its folder is none, or cannot be written: then there is nothing to remove
        return
