"""Reads a bag into uniform recordings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from deeptruck_core import reading
from deeptruck_core.account import Account, moment
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.signals import BRAKE_UNITS, ENGINE_UNITS, TruckInterface
from deeptruck_model import calls
from deeptruck_model.recordings.bag_facts import Clock
from deeptruck_model.recordings.bag_source import EXTRA_KEY, INTERFACE_KEY, NOTES_KEY, BagSource
from deeptruck_model.recordings.clocks import Clocks, InOrder, in_order
from deeptruck_model.recordings.interpolate import Series
from deeptruck_model.recordings.layout import Columns, Walker
from deeptruck_model.recordings.obeyed import Obedience, no_load, with_engaged
from deeptruck_model.recordings.recording import TABLE_NOTE, Recording
from deeptruck_model.recordings.resample import Resampled
from deeptruck_model.recordings.schemas import DRIVEN_BY
from deeptruck_model.recordings.topic_map import DEFAULT_TOPICS, EXTRA_TOPIC, Source, TopicMap, load, stated

Index = NDArray[np.int64]

SIDEWAYS = 1.0  # m/s, rms: what moves so across its axis is written in another frame than the truck's
_NO_NUMBER = "without a number in"
POSE = ("pose.pose.position.x", "pose.pose.position.y")  # of an odometry, beside its twist
_LISTED = 3  # fields that a reason names


def read(
    path: str | Path,
    *,
    topic_map: TopicMap | str | Path | None = None,
    rate_hz: float = 10.0,
    interface: TruckInterface | None = None,
    clock: Clock | None = None,
    mixed_clocks: bool = False,
    msg: Sequence[str | Path] = (),
) -> list[Recording]:
    """The contiguous recordings in a bag, on one clock at `rate_hz`, or at the speed's own rate if that is
    slower.

    Samples are timed by their header stamps, or by log time if a message has none; `clock` selects 'stamp' or
    'log' for every topic. If the clocks of the topics in use differ by more than 0.5 s, the account says so;
    without `clock` they are refused unless `mixed_clocks`. `topic_map` maps channels to fields of the user's
    topics (a mapping or a YAML file, see docs/recordings.md); without it the topics of docs/topics.md
    are read. The truck interface is `interface`, else the one stored with the bag, else the one that follows
    from the topic map and the channels present. `msg` are .msg files of types whose definition the bag lacks.
    The recordings share one account of the messages that were read. Raises InputError for a bag that is
    missing, damaged or empty, a missing topic or field, time going back, clocks that differ, or units that
    cannot be right.
    """
    path = calls.path(path, "a bag")
    rate_hz = calls.number(rate_hz, "rate_hz", "Hz")
    if interface is not None:
        calls.instance(
            interface, TruckInterface, "interface", "such as TruckInterface('mine', 'N m', 'percent')"
        )
    if topic_map is not None and not isinstance(topic_map, str | Path | Mapping):
        raise InputError(f"topic_map must be a mapping or a YAML file, not {calls.shown(topic_map)}")
    if clock is not None and clock not in get_args(Clock):
        known = " or ".join(map(repr, sorted(get_args(Clock), reverse=True)))
        raise InputError(f"clock must be {known}, not {calls.shown(clock)}")
    sources = DEFAULT_TOPICS if topic_map is None else load(topic_map)
    with reading.of(path):
        found = _read(
            BagSource(path, [Path(file) for file in msg]),
            sources,
            topic_map is not None,
            rate_hz,
            interface,
            Clocks(clock, mixed=mixed_clocks),
        )
    by = None if topic_map is None else stated(topic_map, DRIVEN_BY)
    return found if by is None else [replace(r, interface=replace(r.interface, driven_by=by)) for r in found]


def _read(
    source: BagSource,
    sources: dict[str, Source],
    asked: bool,
    rate_hz: float,
    interface: TruckInterface | None,
    clocks: Clocks,
) -> list[Recording]:
    path = source.path
    with source as bag:
        stored = bag.custom_data()
        extra = () if asked else _texts(stored, EXTRA_KEY)  # channels under names of the user's
        sources = {**sources, **{c: Source(EXTRA_TOPIC, f"position[name={c}]") for c in extra}}
        _check_topics(bag, sources, asked=asked)
        name = path.stem if path.is_file() else path.resolve().name
        account = Account(str(path), "messages")
        data = stored.get(INTERFACE_KEY)
        known = interface or (TruckInterface.from_dict(data) if isinstance(data, dict) else None)
        units = {
            command: _command_unit(sources, command, known.unit(command) if known else None) or ""
            for command in ("engine_command", "brake_command")
        }
        sources = with_engaged(sources)
        obedience = Obedience(sources, account, no_load=no_load(bag))
        samples = _samples(bag, sources, clocks, obedience, account)
        resampled = Resampled(
            name, samples.series, rate_hz=rate_hz, account=account, units=units, poses=samples.poses
        )
        account.remarks += obedience.remarks()
        account.remarks += clocks.remarks(path, sources["speed"].topic)
        notes = [*_texts(stored, NOTES_KEY), *_repairs(account)]
        account.remarks += bag.not_mapped({source.topic for source in sources.values()})
    if "speed" not in resampled.measured:
        raise InputError(
            f"{path} has no speed on {sources['speed'].topic}, only other messages; see with 'ros2 topic hz' "
            "whether it is published, or name yours in a topic map"
        )
    if interface is None:
        interface = _interface(name, stored, sources, resampled.measured)
    # bags of ours that a table was imported into before 'specific_force' may call it acceleration
    ours = not asked and not any(note.startswith(TABLE_NOTE) for note in notes)
    return [replace(r, obeyed=obedience.known) for r in resampled.recordings(interface, notes, ours=ours)]


def _check_topics(bag: BagSource, sources: dict[str, Source], asked: bool) -> None:
    topics, walker = bag.topics, Walker(bag.definitions, ros1=bag.ros1, bag=str(bag.path))
    for channel, source in sources.items():
        if source.topic not in topics:
            if asked or channel == "speed":
                present = ", ".join(sorted(topics)) or "none"
                raise InputError(
                    f"{bag.path} has no topic {source.topic} for '{channel}' (topics there: {present}); "
                    "name yours in a topic map, --topic-map FILE: 'deeptruck-model suggest' proposes one"
                )
        elif why := bag.why_unreadable(source.topic):
            raise InputError(
                f"{bag.path}: {source.topic} ({topics[source.topic]}), mapped for '{channel}', cannot be "
                f"read: {why}; give the definition with '--msg FILE.msg', or map another topic"
            )
        else:
            for field in filter(None, (source.field, source.across)):
                if not walker.has(topics[source.topic], field):
                    raise InputError(
                        f"{bag.path}: {source.topic} is a {topics[source.topic]}, which has no field "
                        f"'{field}' for '{channel}'"
                    )


@dataclass(frozen=True)
class _Samples:
    """What messages hold, in s since the bag's first used one: channels, and poses as (time, x, y)."""

    series: dict[str, Series]
    poses: list[tuple[Array, Array, Array]]


def _samples(
    bag: BagSource, sources: dict[str, Source], clocks: Clocks, obedience: Obedience, account: Account
) -> _Samples:
    """The samples of every channel, and their messages counted."""
    topics, walker = bag.topics, Walker(bag.definitions, ros1=bag.ros1, bag=str(bag.path))
    by_topic: dict[str, list[str]] = {}
    for channel, source in sources.items():
        if source.topic in topics:
            by_topic.setdefault(source.topic, []).append(channel)
    vectors = {
        topic: _Vectors(channels, sources, partial(walker.has, topics[topic]))
        for topic, channels in by_topic.items()
    }
    readers = {topic: Columns(walker, topics[topic], one.paths) for topic, one in vectors.items()}
    parts: dict[str, list[tuple[Index, Index, list[Array]]]] = {topic: [] for topic in readers}
    for batch in bag.batches(set(readers)):
        stamps, columns = readers[batch.topic].read(batch.buffer, batch.starts, batch.sizes, batch.log_ns)
        parts[batch.topic].append((batch.log_ns, stamps, vectors[batch.topic].resolved(columns)))
    account.sources = dict.fromkeys(readers, 0)
    found: dict[str, InOrder] = {}
    for topic, own in parts.items():
        if not own:
            continue
        log_ns, stamps = (np.concatenate([part[k] for part in own]) for k in (0, 1))
        logged = np.argsort(log_ns, kind="stable")
        columns = [np.concatenate(column)[logged] for column in zip(*(part[2] for part in own), strict=True)]
        times = clocks.timed(topic, stamps[logged], log_ns[logged], readers[topic].clocked)
        found[topic] = in_order(topic, bag.path, times, columns)
        account.sources[topic] = len(times)
    clock_topic = sources["speed"].topic
    vectors[clock_topic].check(f"{bag.path}: {clock_topic}")
    samples = _counted(found, by_topic, sources, account)
    for topic, count in bag.untimed.items():
        account.sources[topic] += count
        account.total.set_aside(f"on {topic} logged before 1970 or after 2116", count=count)
    account.total.read = sum(account.sources.values())
    for topic, kind, count in bag.other_types(set(readers)):
        account.total.read += count
        account.sources[topic] += count
        account.total.set_aside(f"on {topic} of type {kind}, as most there are {topics[topic]}", count=count)
    swapped = ((topic, one.swapped) for topic, one in found.items() if one.swapped)
    account.remarks += [f"{count} messages on {topic} put back in order" for topic, count in swapped]
    return replace(samples, series=obedience.resolved(samples.series))


def _counted(
    found: Mapping[str, InOrder], by_topic: dict[str, list[str]], sources: dict[str, Source], account: Account
) -> _Samples:
    """The samples of each topic's channels, and its messages that are used, without a number or repeated."""
    start = min((int(one.stamps[0]) for one in found.values()), default=0)
    samples = _Samples({}, [])
    for topic, one in found.items():
        time = (one.stamps - start) / 1e9
        blank = np.ones(len(time), dtype=bool)
        if len(one.columns) > len(by_topic[topic]):
            samples.poses.append((time, one.columns[-2], one.columns[-1]))
        for channel, column in zip(by_topic[topic], one.columns, strict=False):
            values = sources[channel](column)
            blank &= np.isnan(values)
            samples.series[channel] = Series(time, values)
        account.total.used += len(time) - int(blank.sum())
        if blank.any():
            fields = [sources[channel].field for channel in by_topic[topic]]
            named, more = ", ".join(fields[:_LISTED]), len(fields) - _LISTED
            named += f" and {more} more" if more > 0 else ""
            first = f"at {moment(time[int(np.argmax(blank))])}"
            account.total.set_aside(f"on {topic} {_NO_NUMBER} {named}", first, int(blank.sum()))
        if len(one.doubled):
            first = f"at {moment((int(one.doubled[0]) - start) / 1e9)}"
            account.total.set_aside(f"on {topic} with a repeated stamp", first, len(one.doubled))
    return samples


class _Vectors:
    """The fields of a topic's channels, those of which a norm is used, and the components across the
    speed."""

    def __init__(
        self, channels: Sequence[str], sources: Mapping[str, Source], has: Callable[[str], bool]
    ) -> None:
        self._sources = [sources[channel] for channel in channels]
        paths = [source.field for source in self._sources]
        normed = [k for k, source in enumerate(self._sources) if source.across]
        self._norms = [(k, len(paths) + j) for j, k in enumerate(normed)]
        paths += [source.across for source in self._sources if source.across]
        self._speed = sources["speed"] if "speed" in channels else None
        sideways = f"{self._speed.field[:-1]}y" if self._speed and self._speed.field.endswith(".x") else ""
        if self._speed is None or self._speed.across or not sideways or not has(sideways):
            self._speed = None
        self.paths = (*paths, sideways) if self._speed else tuple(paths)
        self.pose = POSE if sources["speed"].field in self.paths and all(map(has, POSE)) else ()
        self.paths += self.pose
        self._squares, self._count = 0.0, 0

    def resolved(self, columns: list[Array]) -> list[Array]:
        """One column per channel, and those of the pose; infinity is no number, as sensor_msgs/Range has it
        for 'no target'."""
        columns = [np.where(np.isinf(column), np.nan, column) for column in columns]
        pose = columns[len(columns) - len(self.pose) :]
        if self._speed:
            sideways = self._speed(columns[-1 - len(self.pose)])
            known = np.isfinite(sideways)
            self._squares += float((sideways[known] ** 2).sum())
            self._count += int(known.sum())
        for k, other in self._norms:
            columns[k] = np.hypot(columns[k], columns[other])
        return columns[: len(self._sources)] + pose

    def check(self, where: str) -> None:
        """Raises InputError if the mapped speed is one component of a vector in another frame."""
        across = (self._squares / max(self._count, 1)) ** 0.5
        if self._speed and across > SIDEWAYS:
            x, y = self._speed.field, f"{self._speed.field[:-1]}y"
            raise InputError(
                f"{where}: {x} is mapped for speed, but {y} moves too ({across:.1f} m/s), so that x is not "
                f"forward but east, or north: map the norm of both by 'field: [{x}, {y}]'"
            )


def _repairs(account: Account) -> list[str]:
    """Notes of an account that recordings keep: all except messages without a number, which are NaN
    in them."""
    _, *reasons = account.total.lines(account.items)
    return [*(line.strip() for line in reasons if _NO_NUMBER not in line), *account.remarks]


def _texts(stored: dict[str, object], key: str) -> list[str]:
    """The list of texts that a bag has under a key."""
    found = stored.get(key, [])
    return [str(text) for text in found] if isinstance(found, list) else []


def _interface(
    name: str, stored: dict[str, object], sources: dict[str, Source], present: set[str]
) -> TruckInterface:
    """The bag's own interface, with the command units that a topic map states."""
    data = stored.get(INTERFACE_KEY)
    found = TruckInterface.from_dict(data) if isinstance(data, dict) else None
    engine = _command_unit(sources, "engine_command", found.engine_unit if found else None)
    brake = _command_unit(sources, "brake_command", found.brake_unit if found else None)
    if found:
        return replace(found, engine_unit=engine or found.engine_unit, brake_unit=brake or found.brake_unit)
    for channel, unit, units in (("engine", engine, ENGINE_UNITS), ("brake", brake, BRAKE_UNITS)):
        if unit is None and f"{channel}_command" in present:
            raise InputError(
                f"'{name}' does not say in which unit its {channel}_command is: give its unit in a topic map "
                f"({', '.join(units)}), or import it anew with 'deeptruck-model import'"
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
