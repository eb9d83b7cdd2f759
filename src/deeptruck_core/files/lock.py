"""Locks a folder, or a name that does not exist yet, against other runs."""

from __future__ import annotations

import fcntl
import hashlib
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from deeptruck_core.errors import InputError

ELSEWHERE = "choose another --out"


@contextmanager
def writing(folder: Path, elsewhere: str = ELSEWHERE) -> Iterator[None]:
    """Lock an existing folder against other runs, until the end of the block or of the process.

    Raises InputError if another run holds it.
    """
    with _held(folder, f"another run is at work in {folder}; wait until it has ended, or {elsewhere}"):
        yield


@contextmanager
def reserved(out: Path, elsewhere: str = ELSEWHERE) -> Iterator[None]:
    """Lock a name that does not exist yet against other runs of this user on this machine, until the end of
    the block or of the process.

    Raises InputError if another run holds it.
    """
    name = hashlib.sha256(os.fsencode(os.path.realpath(out))).hexdigest()
    place = Path(tempfile.gettempdir()) / f"deeptruck-{os.getuid()}" / name
    place.parent.mkdir(mode=0o700, exist_ok=True)
    place.touch()
    with _held(place, f"another run is to write {out}; wait until it has ended, or {elsewhere}"):
        yield


def free(folder: Path, elsewhere: str = ELSEWHERE) -> None:
    """Raises InputError if a run is writing into the folder; a missing folder is free."""
    if os.access(folder, os.R_OK) and folder.is_dir():
        with writing(folder, elsewhere):
            pass


@contextmanager
def _held(place: Path, says: str) -> Iterator[None]:
    handle = os.open(place, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(says) from None
        yield
    finally:
        os.close(handle)
