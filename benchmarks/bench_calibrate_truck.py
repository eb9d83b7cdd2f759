"""Coverage of the intervals of `calibrate-truck`, and the speed error of a fitted truck.

python benchmarks/bench_calibrate_truck.py [--trucks 12]

Trucks whose five parameters are off by random amounts are driven four times for five minutes, with noise of
ordinary sensors. The pool's truck is fitted to three of the drives and judged on the fourth.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import harness
import numpy as np

from deeptruck_model import trucks
from deeptruck_model.mismatch.correction.calibration import Calibration, calibrate
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.recordings import Recording
from deeptruck_model.trucks import driving_cycles

OFF = {  # relative sd of what a truck differs by
    "mass": 0.2,
    "drag_area": 0.15,
    "rolling_resistance": 0.15,
    "torque_gain": 0.05,
    "brake_gain": 0.1,
}
SPEED_SD, ACCELERATION_SD = 0.02, 0.05  # m/s, m/s^2
FIRST_SEED = 200
HEAD = """# A truck's own parameters

`python benchmarks/bench_calibrate_truck.py --trucks {count}`

Of each truck of the pool {count} are made. Their parameters are off at random: {off} (sd).
Each drives four times for five minutes, recorded with the noise of ordinary sensors. The pool's truck is
fitted to three of the drives in {cpu:.0f} CPU s, and judged on the fourth.

{table}

Where no grade is recorded, slopes go into the parameters. They are far off then, many intervals do not hold,
and held-out drives show it.
"""
HEADS = (
    "truck | 95 % intervals that hold | parameters not identifiable | median error of mass, drag area, "
    f"rolling | speed error of {Limits.horizons_s[0]:.0f} s free runs, median, m/s"
)


@dataclass(frozen=True)
class Judged:
    """One fitted truck: which intervals contain the truth, how many parameters were not identified, relative
    errors, and the speed error before and after."""

    holds: tuple[bool, ...]
    unidentified: int
    errors: dict[str, float]
    before: float
    after: float


def main() -> None:
    """Print the table and write it to docs/results/calibrate_truck.md."""
    count = harness.options(__doc__, {"--trucks": 12}).trucks
    began, rows = time.process_time(), []
    blind = trucks.load("freightliner")
    pool = {
        "`trucksim`": trucks.load("trucksim"),
        "`volvo`": trucks.load("volvo"),
        "`freightliner`": blind.with_grade_input(),
        "`freightliner`, no grade recorded": blind,
    }
    for name, truck in pool.items():
        rows.append(row(name, [judged(truck, FIRST_SEED + k) for k in range(count)]))
        print(rows[-1], flush=True)
    cpu = (time.process_time() - began) / (len(pool) * count)
    off = ", ".join(f"{name} {sd:.0%}" for name, sd in OFF.items())
    table = "\n".join(harness.table(HEADS, rows))
    text = HEAD.format(count=count, off=off, cpu=cpu, table=table)
    (harness.RESULTS / "calibrate_truck.md").write_text(text)


def judged(pool: trucks.PhysicsTruck, seed: int) -> Judged:
    """Draw a random truck, drive it and fit the pool's truck to it."""
    rng = np.random.default_rng(seed)
    true = {p: pool.parameters()[p] * (1.0 + rng.normal(0.0, sd)) for p, sd in OFF.items()}
    driven = pool.with_parameters(true)
    drives = [
        noisy(driving_cycles.drive(driven, seconds=300.0, seed=10 * seed + k, name=f"drive{k}"), rng)
        for k in range(4)
    ]
    found = calibrate(pool, drives[:3], drives[3:])
    assert found.before is not None and found.after is not None
    return Judged(*figures(found, true), found.before.speed, found.after.speed)


def noisy(r: Recording, rng: np.random.Generator) -> Recording:
    """The drive as ordinary sensors record it."""
    speed = np.maximum(r.channels["speed"] + rng.normal(0.0, SPEED_SD, len(r)), 0.0)
    acceleration = r.channels["acceleration"] + rng.normal(0.0, ACCELERATION_SD, len(r))
    return replace(r, channels=r.channels | {"speed": speed, "acceleration": acceleration})


def figures(found: Calibration, true: dict[str, float]) -> tuple[tuple[bool, ...], int, dict[str, float]]:
    """Whether each interval contains the truth, the number of parameters without an interval, and the
    relative errors."""
    sure = [(p.name, p.ci95) for p in found.parameters if p.ci95 is not None]
    holds = tuple(low <= true[name] <= high for name, (low, high) in sure)
    errors = {p.name: abs(p.value / true[p.name] - 1.0) for p in found.parameters}
    return holds, len(found.parameters) - len(sure), errors


def row(name: str, all_of: list[Judged]) -> str:
    """A line of the table."""
    holds = [hold for one in all_of for hold in one.holds]
    errors = [
        np.median([one.errors[p] for one in all_of]) for p in ("mass", "drag_area", "rolling_resistance")
    ]
    before, after = (np.median([getattr(one, at) for one in all_of]) for at in ("before", "after"))
    return (
        f"{name} | {sum(holds)} of {len(holds)} | {sum(one.unidentified for one in all_of)} | "
        f"{', '.join(f'{100 * e:.1f} %' for e in errors)} | {before:.2f} -> {after:.3f}"
    )


if __name__ == "__main__":
    main()
