"""A closed-loop run read back from its bag, and how well it followed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from deeptruck_core.errors import InputError
from deeptruck_model.recordings import read

Array = NDArray[np.float64]

SETTLED_S = 5.0
TRUTH = {
    "speed": {"topic": "/truck/twist", "field": "twist.linear.x"},
    "gap": {"topic": "/leader/state", "field": "position[name=true_gap]"},
    "leader_speed": {"topic": "/leader/state", "field": "position[name=true_leader_speed]"},
}
LOST = "lost: "  # of the bridge's diagnostics


@dataclass(frozen=True)
class Following:
    """Channels (n,) over time since the run's first speed, s; `true_` ones without the radar's errors."""

    title: str
    time: Array
    channels: dict[str, Array]
    true_gap: Array
    true_leader_speed: Array
    time_gap: float = 2.0

    @property
    def target_gap(self) -> Array:
        """m."""
        return self.time_gap * self.channels["speed"]

    def figures(self) -> dict[str, float]:
        """Errors after the start, whatever the radar saw."""
        judged = self.time > SETTLED_S
        if not judged.any():
            raise InputError(f"'{self.title}' ended within {SETTLED_S:g} s; look at its log")
        error = np.abs(self.true_gap - self.target_gap)[judged]
        jerk = np.gradient(self.channels["acceleration"], self.time)
        seconds = error / np.maximum(self.channels["speed"][judged], 1.0)
        return {
            "mean time gap error, s": float(np.nanmean(seconds)),
            "largest time gap error, s": float(np.nanmax(seconds)),
            "largest gap error, m": float(np.nanmax(error)),
            "smallest gap, m": float(np.nanmin(self.true_gap)),
            "hardest braking, m/s²": float(-np.nanmin(self.channels["acceleration"])),
            "rms jerk, m/s³": float(np.sqrt(np.nanmean(jerk[judged] ** 2))),
        }


def load(bag: Path, title: str) -> Following:
    """Read a run. Raises InputError where the bag lacks what following needs."""
    recording = max(read(bag), key=len)
    need = ("speed", "acceleration", "leader_speed", "gap", *recording.interface.u)
    recording.columns(need)
    truth = max(read(bag, topic_map=TRUTH, interface=recording.interface), key=len)
    if len(truth) != len(recording):
        raise InputError(f"{bag}: the leader's state is not there for the whole run")
    time = recording.time - recording.start_s
    return Following(title, time, recording.channels, truth.channels["gap"], truth.channels["leader_speed"])


def losses(bag: Path) -> list[str]:
    """Why the bridge handed control back in a run, in the order of its diagnostics; [] where it never did."""
    store = get_typestore(Stores.ROS2_JAZZY)
    found: dict[str, None] = {}
    with AnyReader([bag], default_typestore=store) as reader:
        connections = [c for c in reader.connections if c.topic == "/diagnostics"]
        for connection, _, data in reader.messages(connections):
            for status in reader.deserialize(data, connection.msgtype).status:
                lost = (v.key.removeprefix(LOST) for v in status.values if v.key.startswith(LOST))
                found.update(dict.fromkeys(lost))
    return list(found)
