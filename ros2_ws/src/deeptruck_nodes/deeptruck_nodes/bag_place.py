"""The output folder of a recorded run, which the start script prepares and the recorder fills."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from deeptruck_core import files
from deeptruck_core.errors import InputError

METADATA = "metadata.yaml"
BAG = files.Result("a recorded bag", elsewhere="choose another --record")


def is_whole(bag: Path) -> bool:
    """Whether the recorder of this bag finished it."""
    return (bag / METADATA).is_file()


@contextmanager
def claimed(bag: Path) -> Iterator[None]:
    """Lock the recorder's new bag for the block and mark it as the recorder's, at the end as finished. Raises
    InputError if that is not possible."""
    with files.writing(bag):
        try:
            BAG.mark(bag, at_work=True)
        except OSError as error:
            raise InputError(f"cannot write {bag}: {error.strerror}; {BAG.elsewhere}") from None
        yield
        if is_whole(bag):
            BAG.mark(bag)
