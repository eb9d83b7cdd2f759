"""The jobs of a fleet: for each truck a command line of `deeptruck-model`, and where its result lies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from deeptruck_core.errors import InputError
from deeptruck_core.formats import Kind, kind_of
from deeptruck_model.recordings.bag_facts import METADATA, parts
from deeptruck_model.recordings.several import distinct


@dataclass(frozen=True)
class Job:
    """A command line without its program, and the folder `out` that it writes. `name` is that of the truck,
    with the log or the seed below it."""

    name: str
    words: tuple[str, ...]
    out: Path

    @property
    def line(self) -> tuple[str, ...]:
        """The command line, whole."""
        return (*self.words, "--out", str(self.out))


def jobs(
    command: str, trucks: Sequence[Path], out: Path, options: Sequence[str], seeds: int = 0
) -> tuple[list[Job], list[Path]]:
    """The jobs of a command, and the files of the trucks that are no bags where these are read: left out.

    A truck is a folder of logs or bags, at any depth. `import` has a job for each log, `train` one for each
    truck or, with `seeds`, for each of its seeds, `mismatch` one for each truck. `{truck}` in an option
    stands for the truck's name. Raises InputError for a truck that is no folder, and for logs of one name.
    """
    for truck in trucks:
        if not truck.is_dir():
            what = "is a file" if truck.exists() else "does not exist"
            raise InputError(f"{truck} {what}; give each truck as a folder of its recordings: drives/*/")
    found: dict[str, Job] = {}
    others: list[Path] = []
    for truck, name in distinct(trucks).items():
        logs = list[Path]()
        for path in _files(truck.resolve()):
            wanted = command == "import" or kind_of(path) is Kind.BAG
            (logs if wanted else others).append(path)
        given = [word.replace("{truck}", name) for word in options]
        for job in _of_truck(command, name, truck.resolve(), logs, out.resolve(), given, seeds):
            if job.name in found:
                raise InputError(f"{job.words[1]} and {found[job.name].words[1]} have one name; rename one")
            found[job.name] = job
    return list(found.values()), others


def _files(folder: Path) -> Iterator[Path]:
    """The files below a folder that are not hidden; a bag of several files is its folder."""
    if (folder / METADATA).exists() or parts(folder):
        yield folder
        return
    for path in sorted(folder.iterdir()):
        if path.name.startswith("."):
            continue
        if path.is_dir():
            yield from _files(path)
        else:
            yield path


def _of_truck(
    command: str, name: str, truck: Path, logs: list[Path], out: Path, options: list[str], seeds: int
) -> Iterator[Job]:
    bags = [str(log) for log in logs or [truck]]  # the command says what an empty truck lacks
    if command == "import":
        for log in logs or [truck]:
            place = name if log == truck else f"{name}/{_stem(log.relative_to(truck), log.is_dir())}"
            yield Job(place, ("import", str(log), *options), out / place)
    elif command == "mismatch":
        yield Job(name, ("mismatch", *(f"--recordings={bag}" for bag in bags), *options), out / name)
    elif not seeds:
        yield Job(name, ("train", *bags, *options), out / name)
    else:
        for seed in range(seeds):
            place = f"{name}/seed-{seed}"
            yield Job(place, ("train", *bags, "--seed", str(seed), *options), out / place)


def _stem(log: Path, is_folder: bool) -> str:
    return (log if is_folder else log.with_name(log.name.partition(".")[0])).as_posix()
