"""The output folder of a recorded run: checks, ownership, and replacing an older bag."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path

from deeptruck_core import files
from deeptruck_core.errors import InputError

METADATA = "metadata.yaml"
BAG = files.Result("a recorded bag", elsewhere="choose another --record")


def check(bag: Path | None, overwrite: bool) -> None:
    """Raises InputError if no bag can be recorded there; nothing is changed."""
    if bag is not None:
        BAG.check(bag, overwrite=overwrite)


def check_logs(bag: Path | None, runs: Path) -> None:
    """Raises InputError if the folder of logs is a bag, or lies in a bag or another result."""
    files.check_outside(runs / "new", "choose another --runs")
    if bag is not None and bag.resolve() in (runs.resolve(), *runs.resolve().parents):
        raise InputError(f"the logs of --runs {runs} would lie in the bag {bag}; choose another --runs")


def made(bag: Path | None, overwrite: bool) -> AbstractContextManager[Path | None]:
    """Folder in which the recorder writes: `bag`, or a temporary one while an older bag is kept until the new
    one is complete.

    Raises InputError as `check` does.
    """
    return nullcontext() if bag is None else BAG.recording(bag, overwrite=overwrite, whole=is_whole)


def is_whole(bag: Path) -> bool:
    """Whether the recorder of this bag finished it."""
    return (bag / METADATA).is_file()


def stem(bag: Path) -> str:
    """File name stem of the MCAP file in a bag: the bag's final name, also in a temporary folder."""
    return files.final(bag).name


@contextmanager
def claimed(bag: Path) -> Iterator[None]:
    """Lock the recorder's new bag for the block and mark it as the recorder's, at the end with its files.
    Raises InputError if that is not possible."""
    with files.writing(bag):
        written = [METADATA, *(path.name for path in bag.iterdir())]
        try:
            BAG.mark(bag)
        except OSError as error:
            raise InputError(f"cannot write {bag}: {error.strerror}; {BAG.elsewhere}") from None
        yield
        if is_whole(bag):
            BAG.mark(bag, written)
