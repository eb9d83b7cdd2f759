"""Locks a folder, or a name that need not exist yet, against other runs."""

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
    with _held(folder, folder, elsewhere):
        yield


@contextmanager
def reserved(out: Path, elsewhere: str = ELSEWHERE) -> Iterator[None]:
    """The same for a name that need not exist yet, against runs of this user on this machine."""
    name = hashlib.sha256(os.fsencode(os.path.realpath(out))).hexdigest()
    place = Path(tempfile.gettempdir()) / f"deeptruck-{os.getuid()}" / name
    place.parent.mkdir(mode=0o700, exist_ok=True)
    place.touch()
    with _held(place, out, elsewhere):
        yield


@contextmanager
def _held(place: Path, out: Path, elsewhere: str) -> Iterator[None]:
    handle = os.open(place, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    except BlockingIOError:
        raise InputError(
            f"another run is at work in {out}; wait until it has ended, or {elsewhere}"
        ) from None
    finally:
        os.close(handle)
