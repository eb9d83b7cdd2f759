"""Reads several bags with one topic map, gives their drives distinct names, and takes bags or recordings as
arguments of a Python call.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

from deeptruck_core.errors import InputError
from deeptruck_model import calls
from deeptruck_model.recordings import bag_facts
from deeptruck_model.recordings.bag_facts import Clock
from deeptruck_model.recordings.compatibility import Given, Taken, misfits
from deeptruck_model.recordings.extract import read
from deeptruck_model.recordings.recording import Recording
from deeptruck_model.recordings.topic_map import TopicMap, load

Drives: TypeAlias = Sequence[Recording] | Sequence[str | Path] | str | Path


def read_all(
    bags: Sequence[str | Path],
    *,
    topic_map: TopicMap | str | Path | None = None,
    rate_hz: float = 10.0,
    among: Sequence[str | Path] = (),
    clock: Clock | None = None,
    mixed_clocks: bool = False,
    msg: Sequence[str | Path] = (),
    progress: Callable[[Sequence[str | Path]], Iterable[str | Path]] = iter,
) -> list[Recording]:
    """The recordings of all bags, in the order of the bags, as `read` returns them.

    A recording has the name of its bag; bags of equal names are prefixed with the folders above them. `among`
    are the other bags of the same command, from whose names these must differ too. `progress` wraps the
    iteration over bags, as a progress bar does.
    """
    if isinstance(bags, str | Path):
        raise InputError(f"bags must be a list of paths: read_all([{str(bags)!r}])")
    check(bags, topic_map)
    names = distinct([Path(bag) for bag in (*bags, *among)])
    return [
        recording
        for bag in progress(bags)
        for recording in _called(
            names[Path(bag)],
            read(bag, topic_map=topic_map, rate_hz=rate_hz, clock=clock, mixed_clocks=mixed_clocks, msg=msg),
        )
    ]


def check(bags: Sequence[str | Path], topic_map: TopicMap | str | Path | None = None) -> None:
    """Raises InputError for a bag or topic map that cannot be read, by the headers of all bags."""
    if topic_map is not None:
        load(topic_map)
    for bag in bags:
        bag_facts.bag(Path(bag))


def check_fit(recordings: Iterable[Recording], taken: Taken, name: str = "") -> None:
    """Raises InputError if a recording, called `name` or by its own name, cannot drive a simulator."""
    for r in recordings:
        lacks = {*taken.interface.u, *taken.interface.w} - {*r.channels}
        given = Given(name or f"'{r.name}'", lacks.__contains__, r.interface.unit, r.dt)
        if found := misfits(taken, given):
            raise InputError("; ".join(found))


def distinct(bags: Sequence[Path]) -> dict[Path, str]:
    """A name for each bag: the shortest end of its path that no other bag's path ends with."""
    places = {bag: bag.resolve() for bag in bags}
    ends = {
        place: (*place.parts[:-1], bag.stem if bag.is_file() else place.name) for bag, place in places.items()
    }
    found = {}
    for bag, place in places.items():
        end, others = ends[place], [other for known, other in ends.items() if known != place]
        depths = (d for d in range(1, len(end)) if all(other[-d:] != end[-d:] for other in others))
        depth = next(depths, 0)  # none of a folder and a file next to it that differ in the suffix alone
        found[bag] = "/".join(end[-depth:]) if depth else str(place)
    return found


def _called(name: str, recordings: list[Recording]) -> list[Recording]:
    """The recordings of one bag under another name; the numbers of its pieces are kept."""
    if len(recordings) == 1:
        return [replace(recordings[0], name=name)]
    return [replace(recording, name=f"{name}#{k}") for k, recording in enumerate(recordings)]


def drives(
    given: Any, name: str = "recordings", *, rate_hz: float = 10.0, among: Any = ()
) -> list[Recording]:
    """The recordings in `given`: recordings, a bag, or several bags, which are read at `rate_hz`.

    `among` are the other arguments of the call: bags of equal name among them get distinct names. Raises
    InputError for anything else, and as `read` does.
    """
    parts = _parts(given)
    if parts is not None and all(isinstance(part, Recording) for part in parts):
        return [part for part in parts if isinstance(part, Recording)]
    if parts is not None and all(isinstance(part, str | Path) for part in parts):
        others = [part for part in _parts(among) or () if isinstance(part, str | Path)]
        return read_all(parts, rate_hz=rate_hz, among=others)
    raise InputError(
        f"{name} must be recordings, as read('monday') gives, or paths of bags, not {calls.shown(given)}"
    )


def _parts(given: Any) -> list[Any] | None:
    if isinstance(given, str | Path | Recording):
        return [given]
    return list(given) if isinstance(given, Iterable) else None


def check_paths_apart(recordings: Any, held_out: Any) -> None:
    """Raises InputError for a bag that is both fitted and held out, before any is read."""
    fitted, held = (
        [Path(part) for part in _parts(given) or () if isinstance(part, str | Path)]
        for given in (recordings, held_out)
    )
    places = {path.resolve() for path in fitted}
    if twice := [str(path) for path in dict.fromkeys(held) if path.resolve() in places]:
        raise InputError(
            f"{', '.join(twice)}: among the recordings and held out; hold out drives that are not fitted"
        )
