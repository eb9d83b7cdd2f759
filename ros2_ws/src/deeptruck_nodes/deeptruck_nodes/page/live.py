"""Turns messages into batches for the page: samples of the strip charts, the age of each topic, and node
status.

Times of samples are their stamps, in ms since the first one. Ages use the clock of this process (s), because
the stamps of a lock-step run are unrelated to real time.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from deeptruck_model.mismatch.verdict.wording import spoken

SERIES = (
    "speed", "leader_speed", "gap", "engine_command", "brake_command", "engaged",
    "residual", "smoothed", "allowed", "shield",
)  # fmt: skip
FRESH = (0.5, 2.0)  # s, usual pauses: the greater of the two is how old a fresh message may be
LATE = (2.0, 6.0)  # and one that is late; beyond, a topic is silent
LONGEST_PAUSE = 2.0  # s; a longer one is not usual
FORGETS = 0.95  # share of a usual pause that is left of it when the next message comes earlier
LEAST_SHARE = 0.05  # of the names and parts that are shown
LEARNS = 0.1  # share of the newest interval in what is known of the period


@dataclass
class Ages:
    """Time of the last message on a topic, and its mean rate."""

    count: int = 0
    at: float = -math.inf
    period: float = 0.1
    pause: float = 0.1  # the longest usual one: several nodes may publish in the same moment
    longest: float = LONGEST_PAUSE

    def hear(self, count: int, at: float) -> None:
        """Count `count` new messages, the newest received at `at`, s."""
        if self.count:
            pause = min(at - self.at, self.longest)
            self.pause = max(pause, FORGETS * self.pause)
            self.period += (1 - (1 - LEARNS) ** count) * (pause / count - self.period)
        self.count, self.at = self.count + count, max(at, self.at)

    def state(self, now: float) -> str:
        """'fresh', 'late' or 'silent'; 'unheard' before the first message."""
        if not self.count:
            return "unheard"
        age = now - self.at
        if age <= max(FRESH[0], FRESH[1] * self.pause):
            return "fresh"
        return "late" if age <= max(LATE[0], LATE[1] * self.pause) else "silent"


@dataclass(frozen=True)
class Link:
    """A topic of the graph, with its publishers and subscribers among the nodes of this run.

    A topic that is not `expected` is shown once it was received. `pause_s` is the usual pause of a topic that
    is seldom published.
    """

    topic: str
    publishers: tuple[str, ...]
    listeners: tuple[str, ...]
    expected: bool = True
    pause_s: float = 0.0


@dataclass
class Live:
    """State of the live page. `received`, `sample`, `names`, `budget` and `health` add messages; `batch`
    returns what has changed since the last batch."""

    nodes: tuple[str, ...]
    links: tuple[Link, ...]
    units: Mapping[str, str]
    run: str = ""  # what drives, and where its logs are
    replay: Mapping[str, float] = field(default_factory=dict)  # the newest /replay/state; empty: none
    _ages: dict[str, Ages] = field(default_factory=dict)
    _samples: dict[str, tuple[list[float], list[float | None]]] = field(default_factory=dict)
    _health: dict[str, dict[str, Any]] = field(default_factory=dict)
    _changed: set[str] = field(default_factory=set)
    _missing: dict[str, Any] = field(default_factory=dict)
    _missing_changed: bool = False
    _first: int | None = None
    _acted: float = math.nan

    def received(self, topic: str, count: int, at: float) -> None:
        """Count `count` messages of a topic, the newest at `at`, monotonic s."""
        if topic not in self._ages:
            pause = max((link.pause_s for link in self.links if link.topic == topic), default=0.0)
            self._ages[topic] = Ages(period=pause, pause=pause, longest=pause) if pause else Ages()
        self._ages[topic].hear(count, at)

    def sample(self, stamp: int, values: Mapping[str, float]) -> None:
        """Add values of series by name, with a stamp in ns."""
        self._first = stamp if self._first is None else self._first
        for name, value in values.items():
            times, numbers = self._samples.setdefault(name, ([], []))
            times.append((stamp - self._first) // 1_000_000)
            numbers.append(round(value, 4) if math.isfinite(value) else None)

    def names(self, probabilities: Mapping[str, float]) -> None:
        """Set the probabilities of families and of the names in them; NaN if nothing could be compared."""
        # The library of mechanisms takes longer to import than all else of the page, and few runs have names.
        from deeptruck_model.mismatch.mechanisms.families import NAMES

        families = {f: probabilities.get(f, 0.0) for f in (*NAMES, "unknown", "nothing")}
        self._missing["names"] = [
            [spoken(family), p, _shown(probabilities, NAMES.get(family, ()))]
            for family, p in sorted(families.items(), key=lambda item: -item[1])
            if p >= LEAST_SHARE
        ]
        self._missing_changed = True

    def budget(self, values: Mapping[str, float]) -> None:
        """Set the speed error, and the share of each part in its square."""
        known = {name: x for name, x in values.items() if math.isfinite(x)}
        self._missing["off"] = [known.pop("speed_rmse", None), known.pop("horizon_s", None)]
        self._missing["budget"] = _shown(known, known)
        self._missing_changed = True

    def health(
        self, stamp: int, node: str, level: str, says: str, values: Mapping[str, str], at: float
    ) -> None:
        """Add a status that a node published."""
        self._health[node] = {"level": level, "says": says, "values": dict(values), "at": at}
        self._changed.add(node)
        acted = _number(values.get("shield_acted", "nan"))
        if acted > self._acted:
            self.sample(stamp, {"shield": acted - self._acted})
        self._acted = acted if math.isfinite(acted) else self._acted

    def batch(self, now: float) -> str:
        """The changes since the last batch, as JSON."""
        samples, self._samples = self._samples, {}
        changed, self._changed = self._changed, set()
        missing = {"missing": self._missing} if self._missing_changed else {}
        self._missing_changed = False
        return _text(
            missing
            | {
                "topics": {topic: _age(ages, now) for topic, ages in self._ages.items()},
                "samples": samples,
                "health": self._reported(changed),
                "ages": {node: round(now - said["at"], 2) for node, said in self._health.items()},
                "replay": dict(self.replay),
            }
        )

    def greeting(self) -> str:
        """What a new viewer needs before the first batch, as JSON."""
        links = [
            {"topic": x.topic, "from": x.publishers, "to": x.listeners, "expected": x.expected}
            for x in self.links
        ]
        return _text(
            {
                "nodes": self.nodes,
                "links": links,
                "units": dict(self.units),
                "run": self.run,
                "missing": self._missing,
                "health": self._reported(self._health),
            }
        )

    def _reported(self, nodes: Iterable[str]) -> dict[str, dict[str, Any]]:
        return {
            node: {key: value for key, value in self._health[node].items() if key != "at"}
            for node in list(nodes)
        }


def _shown(values: Mapping[str, float], names: Iterable[str]) -> list[list[object]]:
    """The names with a share large enough to be shown, largest first."""
    own = [(name, values[name]) for name in names if values.get(name, 0.0) >= LEAST_SHARE]
    return [[spoken(name), round(x, 4)] for name, x in sorted(own, key=lambda item: -item[1])]


def _age(ages: Ages, now: float) -> list[object]:
    """State, age in s, and messages per second."""
    rate = 1 / max(ages.period, 1e-4)
    return [ages.state(now), round(now - ages.at, 2), round(rate, 1 if rate > 0.1 else 4)]


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _text(value: object) -> str:
    return json.dumps(value, separators=(",", ":"), allow_nan=False)
