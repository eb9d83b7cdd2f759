"""Surveys a bag of unknown topics: every number in its messages, with its range."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deeptruck_core import reading
from deeptruck_core.arrays import Array
from deeptruck_core.signals import TruckInterface
from deeptruck_model import calls
from deeptruck_model.recordings.bag_source import INTERFACE_KEY, BagSource
from deeptruck_model.recordings.layout import STAMP, Columns, Layout, Walker
from deeptruck_model.recordings.mcap_chunks import Batch

LONGEST_MESSAGE = 4096  # bytes; images and point clouds hold no channel of a truck and would take long
LONGEST_ARRAY = 16  # elements of an array without names, of which each is a field
MOST_FIELDS = 200  # of one topic
MOST_VALUES = 200_000  # messages of a topic by which candidates are compared
LOOKED_AT = 20  # messages of a topic in which fields are looked for


@dataclass
class Field:
    """One number in the messages of a topic, by its path in a topic map. NaN if no value was finite."""

    path: str
    low: float = np.nan
    high: float = np.nan

    @classmethod
    def of(cls, path: str, values: Array) -> Field:
        """A number with these values (n,)."""
        field = cls(path)
        field.take(values)
        return field

    def take(self, values: Array) -> None:
        """Extend the range by these values."""
        finite = values[np.isfinite(values)]
        if len(finite):
            self.low = float(np.fmin(self.low, finite.min()))
            self.high = float(np.fmax(self.high, finite.max()))

    @property
    def largest(self) -> float:
        """The largest magnitude; NaN if no value was finite."""
        return max(abs(self.low), abs(self.high))

    @property
    def still(self) -> bool:
        """Whether all finite values are equal, or there are none."""
        return not self.high > self.low


@dataclass
class Topic:
    """One topic of a bag; `why` is the reason why its messages were not decoded, '' if they were."""

    name: str
    msgtype: str
    messages: int = 0
    first_ns: int = 2**63 - 1
    last_ns: int = 0
    fields: list[Field] = field(default_factory=list)
    why: str = ""

    @property
    def rate_hz(self) -> float:
        """Messages per second; NaN for fewer than two."""
        span = (self.last_ns - self.first_ns) / 1e9
        return (self.messages - 1) / span if self.messages > 1 and span > 0.0 else np.nan


@dataclass(frozen=True)
class Survey:
    """The topics of a bag by name, and the truck interface stored in it."""

    bag: Path
    topics: list[Topic]
    interface: TruckInterface | None


def survey(path: str | Path, msg: Sequence[str | Path] = ()) -> Survey:
    """Survey every topic of a bag. Raises InputError if the bag is missing, damaged or empty."""
    path = calls.path(path, "a bag")
    with reading.of(path), BagSource(path, [Path(file) for file in msg]) as bag:
        stored = bag.custom_data().get(INTERFACE_KEY)
        walker = Walker(bag.definitions, ros1=bag.ros1, bag=str(path))
        topics = {name: _topic(name, kind, bag) for name, kind in bag.topics.items()}
        readers: dict[str, Columns] = {}
        for batch in bag.batches({name for name, topic in topics.items() if not topic.why}):
            _take(topics[batch.topic], batch, walker, readers)
    interface = TruckInterface.from_dict(stored) if isinstance(stored, dict) else None
    return Survey(path, sorted(topics.values(), key=lambda topic: topic.name), interface)


def values_of(
    path: str | Path, wanted: Mapping[str, Sequence[str]], msg: Sequence[str | Path] = ()
) -> dict[tuple[str, str], tuple[Array, Array]]:
    """Log times in s since the first, ascending, and values, each (n,), of fields (topic -> paths) of a bag;
    of the first MOST_VALUES messages of each topic."""
    found: dict[tuple[str, str], list[tuple[NDArray[np.int64], Array]]] = {}
    counts = dict.fromkeys(wanted, 0)
    with reading.of(path), BagSource(Path(path), [Path(file) for file in msg]) as bag:
        walker = Walker(bag.definitions, ros1=bag.ros1, bag=str(path))
        readers = {topic: Columns(walker, bag.topics[topic], tuple(paths)) for topic, paths in wanted.items()}
        for batch in bag.batches(set(wanted)):
            counts[batch.topic] += len(batch.log_ns)
            if counts[batch.topic] > MOST_VALUES:
                continue
            _, columns = readers[batch.topic].read(batch.buffer, batch.starts, batch.sizes, batch.log_ns)
            for field, values in zip(wanted[batch.topic], columns, strict=True):
                found.setdefault((batch.topic, field), []).append((batch.log_ns, values))
    first = min((int(log.min()) for parts in found.values() for log, _ in parts), default=0)
    out = {}
    for key, parts in found.items():
        log, values = (np.concatenate(part) for part in zip(*parts, strict=True))
        log, at = np.unique(log, return_index=True)
        out[key] = ((log - first) / 1e9, values[at])
    return out


def _topic(name: str, msgtype: str, bag: BagSource) -> Topic:
    """The topic before its messages are read; its first message decides whether they are worth reading."""
    _, _, first = next(bag.messages({name}), ("", 0, b""))
    why = ""
    if not first:
        why = "no message"
    elif reason := bag.why_unreadable(name):
        why = reason
    elif len(first) > LONGEST_MESSAGE:
        why = f"not looked into, its messages are longer than {LONGEST_MESSAGE} bytes"
    return Topic(name, msgtype, why=why)


def _take(topic: Topic, batch: Batch, walker: Walker, readers: dict[str, Columns]) -> None:
    topic.messages += len(batch.log_ns)
    topic.first_ns = min(topic.first_ns, int(batch.log_ns.min()))
    topic.last_ns = max(topic.last_ns, int(batch.log_ns.max()))
    if topic.name not in readers:
        topic.fields = [Field(path) for path in _paths(topic, batch, walker)]
        readers[topic.name] = Columns(walker, topic.msgtype, tuple(f.path for f in topic.fields))
    _, columns = readers[topic.name].read(batch.buffer, batch.starts, batch.sizes, batch.log_ns)
    for one, values in zip(topic.fields, columns, strict=True):
        one.take(values)


def _paths(topic: Topic, batch: Batch, walker: Walker) -> list[str]:
    """The paths of numbers in some messages of the batch, each once, in the order of the message."""
    found: dict[str, None] = {}
    some = np.unique(np.linspace(0, len(batch.starts) - 1, LOOKED_AT).astype(int))
    for k in some:
        begin, size = int(batch.starts[k]), int(batch.sizes[k])
        message = batch.buffer[begin : begin + size].tobytes()
        found |= dict.fromkeys(_fields(walker.walk(topic.msgtype, message)))
    return list(found)[:MOST_FIELDS]


def _fields(layout: Layout) -> Iterator[str]:
    for path, (_, count, _) in layout.numbers.items():
        if path in STAMP or "covariance" in path:
            continue
        names = _names(layout, path, count)
        if names:
            name, labels = names
            yield from (f"{path}[{name}={label}]" for label in dict.fromkeys(labels) if _sayable(label))
        elif path in layout.lists:
            yield from (f"{path}[{k}]" for k in range(count) if count <= LONGEST_ARRAY)
        else:
            yield path


def _names(layout: Layout, path: str, count: int) -> tuple[str, list[str]] | None:
    """The list of names next to an array of numbers, of the array's length."""
    folder = path.rpartition(".")[0]
    for other, texts in layout.texts.items():
        same_folder = other.rpartition(".")[0] == folder and other in layout.lists
        if same_folder and count and len(texts) == count:
            return other.rpartition(".")[2], texts
    return None


def _sayable(label: str) -> bool:
    """Whether a field with this name can be written in a topic map."""
    return label.isprintable() and bool(label.strip()) and not {"[", "]"} & {*label}
