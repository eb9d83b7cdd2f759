"""Where a run records: whose the folder is, and what becomes of an older bag in it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path

from deeptruck_model import files
from deeptruck_model.errors import InputError
from deeptruck_model.results import BAG_FILES

METADATA = "metadata.yaml"
BAG = files.Result("a recorded bag", BAG_FILES, elsewhere="choose another --record")


def check(bag: Path | None, overwrite: bool) -> None:
    """Raises InputError where no bag can be recorded; nothing is touched."""
    if bag is not None:
        BAG.check(bag, overwrite=overwrite)


def check_logs(bag: Path | None, runs: Path) -> None:
    """Raises InputError where the folder of logs is a bag, or lies in one or in another result."""
    files.check_outside(runs / "new", "choose another --runs")
    if bag is not None and bag.resolve() in (runs.resolve(), *runs.resolve().parents):
        raise InputError(f"the logs of --runs {runs} would lie in the bag {bag}; choose another --runs")


def made(bag: Path | None, overwrite: bool) -> AbstractContextManager[Path | None]:
    """Where the recorder works: at `bag`, or beside an older bag that stands until the new one is whole.

    Raises InputError as `check`.
    """
    return nullcontext() if bag is None else BAG.recording(bag, overwrite=overwrite, whole=is_whole)


def is_whole(bag: Path) -> bool:
    """Whether the recorder of this bag ended properly."""
    return (bag / METADATA).is_file()


def stem(bag: Path) -> str:
    """What the file in a bag is named by: the bag's own name, also while an older one has it."""
    return files.final(bag).name


@contextmanager
def claimed(bag: Path) -> Iterator[None]:
    """The recorder's hold on the bag it has begun, which it signs at its end. Raises InputError where it
    cannot be claimed."""
    with files.writing(bag):
        try:
            BAG.claim(bag, METADATA, f".{METADATA}.tmp", *(path.name for path in bag.iterdir()))
        except OSError as error:
            raise InputError(f"cannot write {bag}: {error.strerror}; {BAG.elsewhere}") from None
        yield
        if is_whole(bag):
            BAG.sign(bag)
