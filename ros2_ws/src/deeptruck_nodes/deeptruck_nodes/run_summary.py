"""Summary of a recorded run: smallest gap, time in control, hand-backs, crashes, lateness."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from deeptruck_core.arrays import Array

LEADER, ENGAGED, CLOCK = "/leader/state", "/truck/engaged", "/truck/twist"
COUNTED = {  # what the controller counts, as the last line names it
    "drop_outs": "the radar lost the leader",
    "shield_interventions": "the shield acted",
    "full_brakings": "the truck was braked fully",
}
LATE_S = 0.05  # beyond the usual period: half a step of the controller


@dataclass(frozen=True)
class Signals:
    """Time in s and value of the true gap (m) and of the engaged state (0, 1); stamps of the truck, s."""

    gap: tuple[Array, Array]
    engaged: tuple[Array, Array]
    stamps: Array


def of(bag: Path, *, real_time: bool) -> list[str]:
    """The summary of a run, one sentence each; empty for a bag without leader or truck. `real_time`: not in
    lock-step."""
    return sentences(_read(bag), real_time=real_time)


def sentences(run: Signals, *, real_time: bool) -> list[str]:
    """The lines of the summary, from the signals of a run."""
    said = []
    known = run.gap[1][np.isfinite(run.gap[1])]
    if len(known):
        crashes = int(np.sum(np.diff((known <= 0.0).astype(int), prepend=0) > 0))
        count = {0: "no crash", 1: "1 crash"}.get(crashes, f"{crashes} crashes")
        said.append(f"smallest gap {max(0.0, float(known.min())):.1f} m, {count}")
    times, engaged = run.engaged
    if len(times) > 1 and not engaged.all():  # a simulated truck obeys throughout
        passed = np.diff(times)
        held = float(passed[engaged[:-1] > 0.5].sum())
        back = int(np.sum((engaged[:-1] > 0.5) & (engaged[1:] <= 0.5)))
        said.append(f"in control {held:.0f} of {float(passed.sum()):.0f} s, handed back {_times(back)}")
    steps = np.diff(run.stamps)
    if real_time and len(steps):
        late = steps - np.median(steps)
        many = int(np.sum(late > LATE_S))
        if many:
            said.append(
                f"this machine was late by up to {1000 * float(late.max()):.0f} ms, {_times(many)}: "
                "the run was not in real time there"
            )
    return said


def hazards(counts: Mapping[str, int]) -> str:
    """What the controller counted, of COUNTED, as a sentence."""
    return ", ".join(f"{says} {_times(counts[name])}" for name, says in COUNTED.items() if name in counts)


def _times(count: int) -> str:
    return f"{count} time{'' if count == 1 else 's'}"


def _read(bag: Path) -> Signals:
    found: dict[str, list[tuple[float, float]]] = {LEADER: [], ENGAGED: [], CLOCK: []}
    # loaded here, as a start script refuses what does not fit within a moment
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        connections = [c for c in reader.connections if c.topic in found]
        for connection, _, data in reader.messages(connections):
            message = reader.deserialize(data, connection.msgtype)
            time = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
            value = 0.0 if connection.topic == CLOCK else float(message.position[0])
            found[connection.topic].append((time, value))
    columns = {topic: np.array(rows, np.float64).reshape(-1, 2).T for topic, rows in found.items()}
    return Signals(
        (columns[LEADER][0], columns[LEADER][1]),
        (columns[ENGAGED][0], columns[ENGAGED][1]),
        columns[CLOCK][0],
    )
