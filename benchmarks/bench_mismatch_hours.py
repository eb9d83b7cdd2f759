"""Time and memory of the mismatch tool for hours of driving of one truck.

    python benchmarks/bench_mismatch_hours.py [--hours 1 2 4]

A truck with 30 % more rolling resistance, whose brakes build up with a time constant of 0.6 s, is driven in
drives of ten minutes, every sixth of which is held out. Each length is compared in a process of its own, on
one core. Writes its section of docs/results/mismatch.md.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from dataclasses import replace

import harness
import numpy as np
from threadpoolctl import threadpool_limits

from deeptruck_core.arrays import Array
from deeptruck_model import trucks
from deeptruck_model.mismatch import find_mismatch
from deeptruck_model.recordings import Recording
from deeptruck_model.trucks import driving_cycles

DRIVE_S = 600.0
HELD_OUT = 6  # one of so many drives
MORE_ROLLING = 1.3
LAG_S = 0.6
SPEED_SD, ACCELERATION_SD = 0.02, 0.05  # m/s, m/s^2
MB = 1024.0
HEADS = "hours | CPU s | wall s | peak memory, MB | at its peak while | said"


class BrakeLag:
    """Brake pressure builds up and falls with a time constant of LAG_S."""

    def reset(self, batch: int) -> None:
        """Brakes released."""
        self.arrived = np.zeros(batch)

    def filter(self, u: Array, time: float, dt: float) -> Array:
        """Commands (batch, 2) as they take effect."""
        self.arrived = self.arrived + (u[:, 1] - self.arrived) * (1.0 - np.exp(-dt / LAG_S))
        return np.stack([u[:, 0], self.arrived], axis=1)


def main() -> None:
    """Print the table and write it to a section of docs/results/mismatch.md."""
    given = harness.options(
        __doc__, {"--hours": ([1, 2, 4], "of driving"), "--one": (0, harness.HIDDEN), "--print": False}
    )
    if given.one:
        print(json.dumps(measured(given.one)))
        return
    rows = []
    for hours in given.hours:
        command = [sys.executable, __file__, "--one", str(hours)]
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        done = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
        m = json.loads(done.stdout.splitlines()[-1])
        rows.append(
            f"{hours} | {m['cpu_s']:.0f} | {m['wall_s']:.0f} | {m['peak_mb']:.0f} | {m['step']} | {m['said']}"
        )
        print(rows[-1], flush=True)
    load = f"; {harness.machine()}"
    lines = [*harness.heading("Hours of one truck", load), *harness.table(HEADS, rows)]
    if given.print:
        print("\n".join(lines))
    else:
        harness.store("mismatch", lines)


def measured(hours: int) -> dict[str, object]:
    """Time and memory of a comparison of so many hours, and the step of the tool in which memory was
    highest."""
    drives = [driven(k) for k in range(round(hours * 3600.0 / DRIVE_S))]
    fit = [d for k, d in enumerate(drives) if (k + 1) % HELD_OUT]
    held = [d for k, d in enumerate(drives) if not (k + 1) % HELD_OUT]
    peaks = _Peaks()
    cpu, wall = time.process_time(), time.monotonic()
    with threadpool_limits(1):
        found = find_mismatch(trucks.load("trucksim"), fit, held, say=peaks.begin)
    out = {"cpu_s": time.process_time() - cpu, "wall_s": time.monotonic() - wall}
    said = ", ".join(f.effect for f in found.findings) or "nothing"
    return {**out, "peak_mb": resident_peak(), "step": peaks.end(), "said": said}


def resident_peak() -> float:
    """Peak resident memory of this process, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / MB


class _Peaks:
    """Finds the step in which the peak of memory rose last."""

    def __init__(self) -> None:
        self.step, self.highest, self.at = "", resident_peak(), ""

    def begin(self, step: str) -> None:
        """The tool begins its next step."""
        self._note()
        self.step = step

    def end(self) -> str:
        """The step in which memory was highest."""
        self._note()
        return self.at

    def _note(self) -> None:
        now = resident_peak()
        if now > self.highest:
            self.highest, self.at = now, self.step


def driven(seed: int) -> Recording:
    """One drive of the truck as its sensors record it."""
    truck = trucks.load("trucksim")
    rolling = MORE_ROLLING * truck.parameters()["rolling_resistance"]
    truck = truck.with_parameters({"rolling_resistance": rolling}).with_forces([], [BrakeLag()])
    drive = driving_cycles.drive(truck, seconds=DRIVE_S, seed=seed, name=f"drive_{seed}")
    rng, channels = np.random.default_rng(seed), dict(drive.channels)
    channels["speed"] = channels["speed"] + rng.normal(0.0, SPEED_SD, len(drive))
    channels["acceleration"] = channels["acceleration"] + rng.normal(0.0, ACCELERATION_SD, len(drive))
    return replace(drive, channels=channels)


if __name__ == "__main__":
    main()
