"""The cost of a step of an FMU compared with the same truck's own step: `python benchmarks/bench_fmu.py`.

The FMU is `truck:trucksim` as `deeptruck-model export --fmu` writes it, so it runs Python inside; a compiled
one costs less. CPU time of whole runs of five minutes, row by row, and of single steps.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import harness
import numpy as np

from deeptruck_model import simulators
from deeptruck_model.fmu import export
from deeptruck_model.trucks import driving_cycles

SECONDS, STEPS = 300.0, 1000


def cost(run: Callable[[], object], steps: int) -> float:
    """Microseconds of CPU per step, the least of three runs."""
    return 1e6 * float(min(harness.cpu_s(run))) / steps


def main() -> None:
    """Print the table."""
    harness.options(__doc__, {})
    with tempfile.TemporaryDirectory() as place:
        export.export("truck:trucksim", Path(place) / "truck.fmu")
        trucks = {text: simulators.load(text) for text in ("truck:trucksim", f"fmu:{place}/truck.fmu")}
        own = trucks["truck:trucksim"]
        c = driving_cycles.drive(own, seconds=SECONDS, seed=1).channels  # type: ignore[arg-type]
        u, w, y = (
            np.stack([c[n] for n in names], -1)[None]
            for names in (own.interface.u, own.interface.w, own.interface.y)
        )

        def stepped(truck: simulators.Simulator) -> None:
            state = truck.reset(y[:, 0])
            for k in range(STEPS):
                state, _ = truck.step(state, u[:, k], w[:, k])

        n = u.shape[1]
        rows = {
            "free run": [cost(lambda t=t: simulators.free_run(t, u, w, y[:, 0]), n) for t in trucks.values()],
            "forced run": [cost(lambda t=t: simulators.forced_run(t, u, w, y), n) for t in trucks.values()],
            "single steps": [cost(lambda t=t: stepped(t), STEPS) for t in trucks.values()],
        }
    lines = (f"{name} | {ours:.1f} | {its:.0f} | {its / ours:.0f}" for name, (ours, its) in rows.items())
    print("\n".join(harness.table(" | truck, µs a step | FMU, µs a step | ratio", lines, right=True)))


if __name__ == "__main__":
    main()
