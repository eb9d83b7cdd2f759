"""How much a simulator that is adapted to the first minutes of a drive errs less along its remainder.

    python benchmarks/bench_adapt.py [--out DIR] [--print]

Nine drives of a physics truck with another mass, a wind or a constant force; and every drive of at least ten
minutes of the vehicles of `deeptruck-model prove --real`, each with a simulator learned from other drives of
that vehicle, where their logs (docs/recordings.md) are under ../shared/data or the folder in
DEEPTRUCK_REAL_DATA. `adapt` is compared with a constant acceleration alone: the mean of the constants that
minimise the squared speed error of free runs, shrunk by their scatter. Settings were chosen on the physics
truck, veh002 and car_1. Writes its section of docs/results/mismatch.md.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import harness
import numpy as np
from numpy.typing import NDArray

from deeptruck_exam.real.fleets import FLEETS, Fleet
from deeptruck_exam.real.withheld import LAYOUTS, trained, whole_log
from deeptruck_model import trucks
from deeptruck_model.errors import InputError
from deeptruck_model.mismatch.correction.improvement import free_runs, horizon
from deeptruck_model.mismatch.data.prepared import Prepared
from deeptruck_model.mismatch.live.adaptation import FIRST_S, adapt, begin, with_own
from deeptruck_model.mismatch.live.own import Own, Quantity, State
from deeptruck_model.recordings import Recording, split
from deeptruck_model.simulators import Simulator, load
from deeptruck_model.trucks import driving_cycles
from deeptruck_model.trucks.forces import View

Array = NDArray[np.float64]

SECONDS = 900.0
LEAST_S, REST_S = 700.0, 1e9
PIECE_S = 60.0  # of the rest of a drive: shorter ones are left out
SPEED_SD, ACCELERATION_SD = 0.02, 0.05  # m/s, m/s^2
AREA = 6.0  # m^2, drag coefficient times frontal area
STEP, PRIOR, APART, LEAST_SD = 0.02, 0.03, 2.0, 0.002  # m/s^2, of the constant alone
CHANGED = 0.05  # of the error: less is no change
HEADS = "drives | as given, m/s | a constant alone, ratio | better; worse | adapted, ratio | better; worse"


@dataclass(frozen=True)
class Wind:
    """A headwind in m/s."""

    speed: float

    def reset(self, batch: int) -> None: ...

    def force(self, view: View, dt: float) -> Array:
        """The change of air drag, N (batch,)."""
        v, air = view.speed, view.speed + self.speed
        return np.asarray(-0.6 * AREA * (air * np.abs(air) - v * np.abs(v)))


@dataclass(frozen=True)
class Constant:
    """A constant acceleration in m/s^2 while the truck moves."""

    acceleration: float

    def reset(self, batch: int) -> None: ...

    def force(self, view: View, dt: float) -> Array:
        """N, (batch,)."""
        return np.asarray(self.acceleration * view.mass * (view.speed > 0.3))


def main() -> None:
    """Print the table and write it to a section of docs/results/mismatch.md."""
    given = harness.options(
        __doc__, {"--out": (Path("build/bench_adapt"), "of simulators"), "--print": False}
    )
    rows = [row("physics truck", [judged(trucks.load("trucksim"), [d]) for d in made()])]
    for fleet in FLEETS:
        if all((harness.DATA / log).is_file() for log in (*fleet.trainers, *fleet.judged)):
            simulator, drives = of(fleet, given.out / fleet.name)
            rows.append(row(fleet.name, [judged(simulator, drive) for drive in drives]))
    lines = [*harness.heading("What one drive has of its own"), *harness.table(HEADS, rows)]
    if given.print:
        print("\n".join(lines))
    else:
        harness.store("mismatch", lines)


def made() -> Iterator[Recording]:
    """Drives of physics trucks that differ from the simulator in mass, wind or a constant force."""
    truck = trucks.load("trucksim")
    mass = truck.parameters()["mass"]
    others = [truck.with_parameters({"mass": x * mass}) for x in (1.0, 1.3, 0.7, 0.9)]
    others += [
        truck.with_forces([force], []) for force in (Wind(6.0), Wind(-5.0), Constant(-0.04), Constant(0.02))
    ]
    others.append(truck.with_parameters({"mass": 1.2 * mass}).with_forces([Wind(4.0)], []))
    for k, other in enumerate(others):
        drive, rng = driving_cycles.drive(other, seconds=SECONDS, seed=200 + k), np.random.default_rng(k)
        c = dict(drive.channels)
        c["speed"] = c["speed"] + rng.normal(0.0, SPEED_SD, len(drive))
        c["acceleration"] = c["acceleration"] + rng.normal(0.0, ACCELERATION_SD, len(drive))
        yield replace(drive, channels=c)


def of(fleet: Fleet, out: Path) -> tuple[Simulator, list[list[Recording]]]:
    """A simulator learned from drives of a vehicle, and the vehicle's other drives of at least LEAST_S."""
    logs = [whole_log(harness.DATA / log, LAYOUTS / fleet.layout, out / "import") for log in fleet.judged]
    trainers = [
        r
        for log in fleet.trainers
        for r in whole_log(harness.DATA / log, LAYOUTS / fleet.layout, out / "import")
    ]
    if not trainers:
        trainers, rest, _ = split(logs[0], (0.5, 0.5, 0.0))
        logs = [[r] for r in rest]
    drives = [d for d in logs if sum(len(r) * r.dt for r in d) >= LEAST_S]
    return load(trained(trainers, out / "simulator", 1200)), drives


def judged(simulator: Simulator, drive: Sequence[Recording]) -> list[float]:
    """Speed errors after the first FIRST_S of a drive, rms in m/s: of the simulator as given, with a constant
    acceleration, and adapted. Empty if the drive is refused."""
    try:
        adapted = adapt(simulator, drive).truck
        first = begin(simulator, drive, FIRST_S)
        rest = begin(simulator, list(after(drive, FIRST_S)), REST_S)
    except InputError as error:
        print(f"{drive[0].name}: {error}")
        return []
    jobs = [simulator, steady(simulator, constant_of(simulator, first)), adapted]
    errors = free_runs([(truck, rest) for truck in jobs], horizon(rest))
    return [e.rmse().speed for e in errors] if len(errors[0].speed) else []


def after(drive: Sequence[Recording], first_s: float) -> Iterator[Recording]:
    """The pieces of a drive without its first seconds."""
    left = first_s
    for r in drive:
        n = max(0, min(len(r), round(left / r.dt)))
        left -= n * r.dt
        if (len(r) - n) * r.dt > PIECE_S:
            yield r.piece(n, len(r))


def steady(simulator: Simulator, acceleration: float) -> Simulator:
    """The simulator with a constant acceleration added, m/s^2."""
    none = Quantity()
    return with_own(simulator, Own(none, none, Quantity(State.ESTIMATED, acceleration)))


def constant_of(simulator: Simulator, drives: Sequence[Prepared]) -> float:
    """The constant acceleration, m/s^2, that minimises the speed error of free runs."""
    plain, moved = free_runs([(simulator, drives), (steady(simulator, STEP), drives)], horizon(drives))
    if not len(plain.speed):
        return 0.0
    slope = (moved.speed - plain.speed) / STEP
    square = np.maximum(np.sum(slope**2, axis=1), 1e-12)
    each = -np.sum(slope * plain.speed, axis=1) / square
    spread = max(float(np.std(each, ddof=1)) if len(each) > 1 else PRIOR, LEAST_SD)
    precision = len(each) / (APART * spread**2)
    return float(np.average(each, weights=square)) * precision / (precision + 1.0 / PRIOR**2)


def row(name: str, errors: Sequence[Sequence[float]]) -> str:
    """Geometric means of the errors of a vehicle's drives, and the numbers of drives with a smaller and a
    larger error than as given."""
    known = np.array([e for e in errors if e])
    cells = [f"{name}, {len(known)} | {np.exp(np.log(known[:, 0]).mean()):.2f}"]
    for k in (1, 2):
        ratio = known[:, k] / known[:, 0]
        better, worse = int((ratio < 1.0 - CHANGED).sum()), int((ratio > 1.0 + CHANGED).sum())
        cells.append(f"{np.exp(np.log(ratio).mean()):.2f} | {better}; {worse}")
    return " | ".join(cells)


if __name__ == "__main__":
    main()
