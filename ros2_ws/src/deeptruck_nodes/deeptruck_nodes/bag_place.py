"""Where a run records: whose the folder is, and what becomes of an older bag in it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path

from deeptruck_model import files
from deeptruck_model.errors import InputError

METADATA = "metadata.yaml"
BAG = files.Result("a recorded bag", elsewhere="choose another --record")


def check(bag: Path | None, overwrite: bool) -> None:
    """Raises InputError where no bag can be recorded; nothing is touched."""
    if bag is not None:
        BAG.check(bag, overwrite=overwrite)


def freed(bag: Path | None, overwrite: bool) -> AbstractContextManager[None]:
    """Room for the recorder; an older bag waits beside it until the new one is whole. Raises InputError."""
    return nullcontext() if bag is None else BAG.aside(bag, overwrite=overwrite, whole=_is_whole)


def _is_whole(bag: Path) -> bool:
    return (bag / METADATA).is_file()


@contextmanager
def claimed(bag: Path) -> Iterator[None]:
    """The recorder's hold on the bag it has begun. Raises InputError where it cannot be signed."""
    with files.writing(bag):
        try:
            BAG.sign(bag, (METADATA, f".{METADATA}.tmp"))
        except OSError as error:
            raise InputError(f"cannot write {bag}: {error.strerror}; {BAG.elsewhere}") from None
        yield
