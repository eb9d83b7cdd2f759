"""Are stretches of road that nobody told found where they are, and corrected there?

python benchmarks/bench_places.py [--out docs/results/places.md]

Eight drives of 200 s over one road in a physics truck, two of them held out. Forces act at places that
neither the simulator nor the recorded slope has. Cases differ in these, and in what drives tell of where they
are.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deeptruck_model import driving_cycles, trucks
from deeptruck_model.constants import GRAVITY
from deeptruck_model.mismatch import find_mismatch
from deeptruck_model.recordings import Recording
from deeptruck_model.trucks.driver import EPISODE, LOGGED, drive_along

Array = NDArray[np.float64]
Force = tuple[float, float, float]  # from and to, m, and m/s^2 against the motion

TRUCK = trucks.load("trucksim")
SPACING_M, LONG_M, SECONDS, DRIVES, HELD = 10.0, 9000.0, 200.0, 8, 2
SPEED_NOISE, POSITION_NOISE_M = 0.02, 2.0
DEGREE_M = float(np.radians(1.0)) * 6371e3
SOFT: Force = (900.0, 1150.0, 0.15)
TWO: tuple[Force, ...] = (SOFT, (1400.0, 1500.0, 0.25))
HUMP: tuple[Force, ...] = (SOFT, (1400.0, 1450.0, 0.3), (1450.0, 1500.0, -0.3))


@dataclass(frozen=True)
class Case:
    """Forces at places; how much further along the road each drive begins than the last; and how many of the
    drives tell positions."""

    says: str
    forces: Sequence[Force] = (SOFT,)
    apart_m: float = 60.0
    positions: int = DRIVES


CASES = (
    Case("nothing, positions", ()),
    Case("one stretch, positions"),
    Case("two stretches, positions", TWO),
    Case("a stretch and a hump, positions", HUMP),
    Case("one stretch, positions in five of eight drives", positions=5),
    Case("two stretches, no positions, one start", TWO, apart_m=0.0, positions=0),
    Case("one stretch, no positions, other starts", positions=0),
)


def drive(case: Case, k: int) -> Recording:
    """Drive k of a case."""
    begins, rng = case.apart_m * k, np.random.default_rng(100 + k)
    targets = 7.0 + driving_cycles.speed_profile(SECONDS, seed=rng, dt=TRUCK.dt) / 3.0
    place = begins + SPACING_M * np.arange(int((LONG_M - begins) / SPACING_M))
    told = 0.01 * np.sin(place / 400.0)
    felt = told + sum((f * (place >= a) * (place < b) for a, b, f in case.forces), np.zeros(1)) / GRAVITY
    log = drive_along(TRUCK, targets, np.zeros(len(targets)), np.array([], EPISODE), felt, SPACING_M)
    channels = {c: np.ascontiguousarray(log[:, i]) for i, c in enumerate(LOGGED) if c != "elevation"}
    along = begins + np.cumsum(channels["speed"]) * TRUCK.dt
    channels["grade"] = np.interp(along, place, told)
    channels["speed"] = channels["speed"] + rng.normal(0.0, SPEED_NOISE, len(along))
    if k < case.positions:
        channels["latitude"] = 48.0 + (along + rng.normal(0.0, POSITION_NOISE_M, len(along))) / DEGREE_M
        channels["longitude"] = np.full(len(along), 11.0)
    return Recording(f"drive-{k}", TRUCK.dt, channels, TRUCK.interface, notes=())


def row(case: Case) -> str:
    """What is said of a case, and what its correction is worth."""
    drives = [drive(case, k) for k in range(DRIVES)]
    found = find_mismatch(TRUCK, drives[:-HELD], drives[-HELD:])
    fit, e = found.result.fit, found.evidence
    said = [" or ".join(f"`{n}`" for n in (f.effect, *f.cannot_be_told_from[:1])) for f in found.findings]
    places = [p for f in found.findings if f.cause and f.cause.term for p in f.cause.term.variant.places]
    where = ", ".join(f"{a:.0f} to {b:.0f}" for a, b in places) or ""
    half = SPACING_M / 2.0  # between points of the road it is a line: what is at one begins halfway before
    wanted = ", ".join(f"{a - half:.0f} to {b - half:.0f}" for a, b, _ in case.forces)
    errors = fit.errors if fit is not None else None
    assert e is not None and fit is not None and errors is not None
    worth = f"{errors.before.speed:.3f} | {errors.parameters_only.speed:.3f} | {errors.after.speed:.3f}"
    validated = "yes" if fit.validated else "no"
    return f"| {case.says} | {wanted} | {'; '.join(said) or 'nothing'} | {where} | {worth} | {validated} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, help="the page to write; else the table is printed alone")
    out = parser.parse_args().out
    lines = [
        "# Stretches of road that nobody told",
        "",
        "`python benchmarks/bench_places.py --out docs/results/places.md`",
        "",
        f"Eight drives of {SECONDS:.0f} s over one road, two held out; forces of 0.15 to 0.3 m/s² at places.",
        "Errors are of speed over 40 s along the held-out drives, told the places they know, rms in m/s.",
        "[How places are known](../mismatch_road.md).",
        "",
        "| case | acts at, m | said | where, m | as given | parameters alone | corrected | validated |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for case in CASES:
        lines.append(row(case))
        print(lines[-1], flush=True)
    lines += [
        "",
        "In the fifth case the held-out drives tell no positions: the correction changes nothing along",
        "them, and they validate nothing. From other starts without positions nothing tells that it is the",
        "road's.",
    ]
    if out is not None:
        out.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
