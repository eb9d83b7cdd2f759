"""From a bag to uniform recordings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.errors import InputError
from deeptruck_model.recordings.bag_source import INTERFACE_KEY, NOTES_KEY, BagSource
from deeptruck_model.recordings.layout import Columns, Walker
from deeptruck_model.recordings.recording import Recording
from deeptruck_model.recordings.resample import Series, uniform
from deeptruck_model.recordings.topic_map import DEFAULT_TOPICS, Source, TopicMap, load
from deeptruck_model.signals import BRAKE_UNITS, ENGINE_UNITS, TruckInterface

Array = NDArray[np.float64]
Index = NDArray[np.int64]

REORDER_NS = 1_000_000_000  # messages may overtake each other by this much; further back is a clock set back


def read(
    path: str | Path,
    *,
    topic_map: TopicMap | str | Path | None = None,
    rate_hz: float = 10.0,
    interface: TruckInterface | None = None,
) -> list[Recording]:
    """The recordings in a bag: contiguous, on one clock at `rate_hz` or the speed's own rate where that is
    slower.

    Samples are timed by their header stamps, or by log time where a message has none. `topic_map` maps
    channels to fields of the user's topics (a mapping or a YAML file, see docs/recordings.md); without it
    the topics of docs/architecture.md are read. The truck interface is `interface`, else the one stored
    with the bag, else what the topic map and the channels present say. Raises InputError for a bag that
    is missing, damaged or empty, a topic or field that is not there, time going back, or units that
    cannot be right.
    """
    path = Path(path)
    sources = DEFAULT_TOPICS if topic_map is None else load(topic_map)
    with BagSource(path) as bag:
        _check_topics(bag, sources, asked=topic_map is not None)
        stored = bag.custom_data()
        raw, notes = _series(bag, sources)
    name = path.stem if path.is_file() else path.resolve().name
    if interface is None:
        interface = _interface(name, stored, sources, set(raw))
    notes = [*_stored_notes(stored), *notes]
    return uniform(raw, name=name, interface=interface, rate_hz=rate_hz, notes=notes)


def _check_topics(bag: BagSource, sources: dict[str, Source], asked: bool) -> None:
    if "speed" not in sources:
        raise InputError("the topic map has no 'speed'; a recording needs at least that channel")
    topics, walker = bag.topics, Walker(bag.definitions, ros1=bag.ros1)
    for channel, source in sources.items():
        if source.topic not in topics:
            if asked or channel == "speed":
                present = ", ".join(sorted(topics)) or "none"
                raise InputError(
                    f"{bag.path} has no topic {source.topic} for '{channel}' (topics there: {present}); "
                    "name yours in a topic map"
                )
        elif not walker.has(topics[source.topic], source.field):
            raise InputError(
                f"{bag.path}: {source.topic} is a {topics[source.topic]}, which has no field "
                f"'{source.field}' for '{channel}'"
            )


def _series(bag: BagSource, sources: dict[str, Source]) -> tuple[dict[str, Series], list[str]]:
    """Every channel with its own times, s since the bag's first used sample."""
    topics, walker = bag.topics, Walker(bag.definitions, ros1=bag.ros1)
    by_topic: dict[str, list[str]] = {}
    for channel, source in sources.items():
        if source.topic in topics:
            by_topic.setdefault(source.topic, []).append(channel)
    readers = {
        topic: Columns(walker, topic, topics[topic], tuple(sources[c].field for c in channels))
        for topic, channels in by_topic.items()
    }
    parts: dict[str, list[tuple[Index, list[Array]]]] = {topic: [] for topic in readers}
    for batch in bag.batches(set(readers)):
        columns = readers[batch.topic].read(batch.buffer, batch.starts, batch.sizes, batch.log_ns)
        parts[batch.topic].append(columns)
    notes: list[str] = []
    stamps, values = {}, {}
    for topic, read_parts in parts.items():
        if read_parts:
            all_stamps = np.concatenate([s for s, _ in read_parts])
            order = _order(all_stamps, topic, bag.path, notes)
            stamps[topic] = all_stamps[order]
            for k, channel in enumerate(by_topic[topic]):
                column = np.concatenate([c[k] for _, c in read_parts])[order]
                if not np.isnan(column).all():
                    values[channel] = _converted(column, sources[channel])
        read_parts.clear()
    if "speed" not in values:
        raise InputError(f"{bag.path} is empty: no speed on {sources['speed'].topic}")
    start = min(int(s[0]) for s in stamps.values())
    seconds = {topic: (s - start) / 1e9 for topic, s in stamps.items()}
    return {c: Series(seconds[sources[c].topic], v) for c, v in values.items()}, notes


def _order(stamps: Index, topic: str, path: Path, notes: list[str]) -> Index:
    """Indices that put the samples in time order, the last of equal stamps winning."""
    latest = np.maximum.accumulate(stamps)
    back = latest - stamps
    if len(stamps) and int(back.max()) > REORDER_NS:
        at = int(np.argmax(back > REORDER_NS))
        raise InputError(
            f"{path}: time goes back by {back[at] / 1e9:.3g} s on {topic} (message {at}): "
            "the clock was set back or two runs share the bag; split it there"
        )
    order = np.argsort(stamps, kind="stable")
    unique = np.append(np.diff(stamps[order]) > 0, True)
    swapped, doubled = int((back > 0).sum()), int((~unique).sum())
    if swapped:
        notes.append(f"{swapped} messages on {topic} put back in order")
    if doubled:
        notes.append(f"{doubled} messages on {topic} with a stamp that came again dropped")
    return order[unique]


def _converted(column: Array, source: Source) -> Array:
    column = np.where(np.isinf(column), np.nan, column)  # sensor_msgs/Range: infinity is 'no target'
    if source.scale != 1.0 or source.offset != 0.0:
        column = source.scale * column + source.offset
    return column if source.convert is None else source.convert(column)


def _stored_notes(stored: dict[str, object]) -> list[str]:
    notes = stored.get(NOTES_KEY, [])
    return [str(note) for note in notes] if isinstance(notes, list) else []


def _interface(
    name: str, stored: dict[str, object], sources: dict[str, Source], present: set[str]
) -> TruckInterface:
    """The bag's own interface, with the units a topic map states for the commands."""
    data = stored.get(INTERFACE_KEY)
    found = TruckInterface.from_dict(data) if isinstance(data, dict) else None
    engine = _command_unit(sources, "engine_command", found.engine_unit if found else None)
    brake = _command_unit(sources, "brake_command", found.brake_unit if found else None)
    if found:
        return replace(found, engine_unit=engine or found.engine_unit, brake_unit=brake or found.brake_unit)
    for channel, unit, units in (("engine", engine, ENGINE_UNITS), ("brake", brake, BRAKE_UNITS)):
        if unit is None and f"{channel}_command" in present:
            raise InputError(
                f"'{name}' does not say in which unit its {channel}_command is: state the unit in a topic map "
                f"({', '.join(units)}) or pass an interface"
            )
    return TruckInterface(
        name,
        engine_unit=engine or "N m",
        brake_unit=brake if "brake_command" in present else None,
        grade="grade" in present,
        fuel="fuel_rate" in present,
    )


def _command_unit(sources: dict[str, Source], channel: str, default: str | None) -> str | None:
    convert = sources[channel].convert if channel in sources else None
    return convert.unit if convert else default
