"""The same controller driving the physics truck directly, and over CAN through that truck's emulated
controllers.

    python benchmarks/bench_can_loop.py [--policy POLICY] [--seconds 70]

Both runs are in real time behind the same leader, with the same parameters. On the bus a listener records
when TSC1 frames arrive: the latency is from a radar sample to the first frame after its command. Prints a
table and writes its section of docs/results/speed.md.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import harness
import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from deeptruck_model.recordings import read
from truck_bridge.bus import open_bus

LEADER = "steps:speeds=20/23/18/20,every=15,acceleration=0.6"
TOPICS = {
    "speed": {"topic": "/truck/twist", "field": "twist.linear.x"},
    "gap": {"topic": "/leader/state", "field": "position[name=true_gap]"},
    "leader_speed": {"topic": "/leader/state", "field": "position[name=true_leader_speed]"},
}
TIME_GAP, FROM_S = 2.0, 10.0
CHANNEL, BRIDGE, TSC1 = "bench", 0x2A, 0x0000
RUNS = {
    "physics truck": ("start_simulation.py", "--simulator", "truck:trucksim"),
    "over CAN": ("start_vehicle.py", "--vehicle", "trucksim", "--emulator", "--engage", "--channel", CHANNEL),
}


def main() -> None:
    policy = ("baseline:acc", "policy directory, or baseline:NAME")
    arguments = harness.options(__doc__, {"--policy": policy, "--seconds": 70.0})
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as scratch:
        with Listener() as listener:
            rows = {
                name: drive(Path(scratch), argv, arguments.policy, arguments.seconds)
                for name, argv in RUNS.items()
            }
        late = latencies(Path(scratch) / "start_vehicle", np.array(listener.times))
    report(rows, late, load)


class Listener(threading.Thread):
    """Records when the bridge's TSC1 frames reach the bus, s since the epoch."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.times: list[float] = []
        self._done = threading.Event()
        self._bus = open_bus("loopback", CHANNEL)

    def __enter__(self) -> Listener:
        self.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._done.set()
        self.join()
        self._bus.shutdown()

    def run(self) -> None:
        while not self._done.is_set():
            frame = self._bus.recv(0.2)
            if frame is None or frame.arbitration_id & 0xFF != BRIDGE:
                continue
            if frame.arbitration_id >> 8 & 0x3FF00 == TSC1:
                self.times.append(time.time())


def latencies(bag: Path, frames: np.ndarray) -> np.ndarray:
    """Latencies, s, from each radar sample that a command answers to the first TSC1 frame after that command.

    A command carries the stamp of its radar sample; its own time is that of its arrival at the recorder.
    """
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        stamps: dict[str, dict[int, int]] = {"/radar/range": {}, "/truck/command": {}}
        for connection, arrived, data in reader.messages(
            [c for c in reader.connections if c.topic in stamps]
        ):
            stamp = reader.deserialize(data, connection.msgtype).header.stamp
            stamps[connection.topic].setdefault(stamp.sec * 10**9 + stamp.nanosec, arrived)
    answered = sorted(stamps["/radar/range"].keys() & stamps["/truck/command"].keys())
    sampled = np.array(answered) * 1e-9
    commanded = np.array([stamps["/truck/command"][s] for s in answered]) * 1e-9
    first = np.searchsorted(frames, commanded)
    sent = first < len(frames)
    driving = sampled[sent] > frames[0]
    return np.asarray((frames[first[sent]] - sampled[sent])[driving])


def drive(scratch: Path, argv: tuple[str, ...], policy: str, seconds: float) -> dict[str, float]:
    """One run and its errors. Raises CalledProcessError if the run fails."""
    bag = scratch / argv[0].removesuffix(".py")
    common = ["--policy", policy, "--leader", LEADER, "--radar", "noisy", "--duration", str(seconds)]
    script = [sys.executable, str(harness.ROOT / "ros2_ws" / argv[0]), *argv[1:]]
    recorded = ["--record", str(bag), "--runs", str(scratch / "runs")]
    subprocess.run([*script, *common, *recorded], check=True, env={**os.environ, "ROS_DOMAIN_ID": "97"})
    (followed,) = read(bag, topic_map=TOPICS)
    rows = followed.time > followed.start_s + FROM_S
    speed, gap, ahead = (followed.channels[n][rows] for n in ("speed", "gap", "leader_speed"))
    return {
        "rms time-gap error, s": float(np.sqrt(np.nanmean((gap / speed - TIME_GAP) ** 2))),
        "rms speed error, m/s": float(np.sqrt(np.nanmean((speed - ahead) ** 2))),
        "smallest gap, m": float(np.nanmin(gap)),
    }


def report(rows: dict[str, dict[str, float]], late: np.ndarray, load: float) -> None:
    direct, can = rows.values()
    lines = harness.heading(
        "The same controller, simulated and over CAN", f"; {harness.machine(load)}. Goal: within 10 %."
    )
    lines += harness.table(
        f"after {FROM_S:g} s | {' | '.join(rows)} | ratio",
        (f"{what} | {x:.3f} | {can[what]:.3f} | {can[what] / x:.2f}" for what, x in direct.items()),
    )
    p50, p99 = 1e3 * np.quantile(late, [0.5, 0.99])
    ages = f"Radar sample to TSC1 frame, {len(late)} samples: p50 {p50:.1f}, p99 {p99:.1f} ms (goal: 25)."
    harness.store("speed", [*lines, "", ages])


if __name__ == "__main__":
    main()
