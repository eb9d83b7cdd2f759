"""The speed of the physics truck: compiled, and compared with FASTSim 3.

    python benchmarks/bench_trucks.py [--fastsim-python PYTHON]

All ratios come from one run, on one core, in CPU time. FASTSim is optional (pip install fastsim, into a venv
of its own if you like); without it its row says so. Writes its section of docs/results/speed.md.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import harness
import numpy as np

from deeptruck_model import trucks
from deeptruck_model.trucks import driving_cycles

BATCH, STEPS = 1000, 400
FASTSIM = """
import json, time, fastsim
vehicle = fastsim.Vehicle.from_resource("2012_Ford_Fusion.yaml")
cycle = fastsim.Cycle.from_resource("udds.csv")
best = 1e9
for _ in range(5):
    drive = fastsim.SimDrive(vehicle, cycle)
    begin = time.process_time()
    drive.walk()
    best = min(best, time.process_time() - begin)
seconds = cycle.to_dict()["time_seconds"]
found = {"version": fastsim.__version__, "steps": len(seconds) - 1, "simulated": seconds[-1], "cpu": best}
print(json.dumps(found))
"""


def main() -> None:
    fastsim = (sys.executable, "interpreter that has fastsim")
    arguments = harness.options(__doc__, {"--fastsim-python": fastsim})
    rates = {
        "compiled, batch 1000": compiled_batch(),
        "compiled, one truck, whole run": compiled_batch(1, 100_000),
        "compiled, one truck, step by step": compiled_steps(),
    }
    report(rates, with_force(), seven_hours(), fastsim_rate(arguments.fastsim_python))


def inputs(batch: int, steps: int) -> tuple[Any, Any, Any]:
    """Commands that change every 5 s over the whole range, slopes of +-3 %."""
    rng = np.random.default_rng(0)
    blocks = (batch, steps // 50 + 1)
    engine = rng.choice([-500.0, 0.0, 500.0, 1000.0, 1900.0], blocks)
    brake = np.where(engine <= 0.0, rng.uniform(0.0, 40.0, blocks), 0.0)
    u = np.repeat(np.stack([engine, brake], axis=2), 50, axis=1)[:, :steps]
    w = np.repeat(rng.uniform(-0.03, 0.03, blocks), 50, axis=1)[:, :steps, None]
    y0 = np.stack([np.zeros(batch), rng.uniform(0.0, 30.0, batch), np.zeros(batch)], axis=1)
    return np.ascontiguousarray(u), np.ascontiguousarray(w), y0


def cpu(work: Callable[[], Any], repeats: int = 3) -> float:
    """Shortest CPU time of some repeats, s."""
    return float(min(harness.cpu_s(work, repeats)))


def compiled_batch(batch: int = BATCH, steps: int = STEPS) -> float:
    """Control steps (0.1 s) of the compiled loop per CPU second."""
    truck = trucks.load("trucksim")
    u, w, y0 = inputs(batch, steps + 1)
    return batch * steps / cpu(lambda: truck.rollout(u, w, y0, inside=False))


def compiled_steps(steps: int = 3000) -> float:
    truck = trucks.load("trucksim")
    u, w, y0 = inputs(1, steps)

    def run() -> None:
        state = truck.reset(y0)
        for k in range(steps):
            state, _ = truck.step(state, u[:, k], w[:, k])

    return steps / cpu(run)


def with_force(steps: int = 1000) -> float:
    """Microseconds per substep (100 Hz) of a truck that evaluates a force of the user's."""

    class Nothing:
        def reset(self, batch: int) -> None: ...

        def force(self, view: trucks.View, dt: float) -> float:
            return 0.0

    truck = trucks.load("trucksim").with_forces([Nothing()])
    u, w, y0 = inputs(1, steps + 1)
    return cpu(lambda: truck.rollout(u, w, y0)) / (steps * truck.substeps) * 1e6


def seven_hours() -> float:
    """CPU seconds for a recording of 7 h at 10 Hz, with generator, driver and truck."""
    truck = trucks.load("trucksim")
    return cpu(lambda: driving_cycles.drive(truck, hours=7.0, seed=1))


def fastsim_rate(python: str) -> dict[str, Any] | None:
    done = subprocess.run([python, "-c", FASTSIM], capture_output=True, text=True, check=False)
    return json.loads(done.stdout.splitlines()[-1]) if done.returncode == 0 else None


def report(rates: dict[str, float], force: float, hours7: float, fastsim: dict[str, Any] | None) -> None:
    best = rates["compiled, batch 1000"]
    rows = [f"{name} | {r:,.0f} | {0.1 * r:,.0f} | {best / r:.1f}" for name, r in rates.items()]
    if fastsim is None:
        rows.append("FASTSim 3 | not installed (pip install fastsim) | |")
    else:
        step, second = fastsim["steps"] / fastsim["cpu"], fastsim["simulated"] / fastsim["cpu"]
        rows.append(
            f"FASTSim {fastsim['version']}, 1 s steps, one car | {step:,.0f} | {second:,.0f} |"
            f" {best / step:.1f} per step, {0.1 * best / second:.2f} per simulated second"
        )
    heads = "truck `trucksim`, 0.1 s steps of ten substeps | steps / s | simulated s / s | batch is faster by"
    title = "Speed of the physics truck", "; one core, CPU time, all rows from one run."
    lines = [*harness.heading(*title), *harness.table(heads, rows, right=True), ""]
    lines += [f"- 7 h of driving data (generator, driver, truck; 252,000 samples): {hours7:.2f} CPU s."]
    lines += [f"- A force from outside costs {force:.1f} us a substep of 10 ms, besides its own time."]
    lines += [
        "- FASTSim takes one step a simulated second, without gearbox, boost or brakes; ours a hundred."
    ]
    harness.store("speed", lines)


if __name__ == "__main__":
    main()
