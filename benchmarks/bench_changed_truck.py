"""A truck that was changed, beside a simulator learned before: is the change seen, and is it named?

python benchmarks/bench_changed_truck.py [--work runs/changed_truck] [--hours 1] [--jobs 2]

A deep truck learns from drives of a physics truck. The truck then gets another load, other brakes or tyres,
or wind, and drives three recordings to fit and one to hold out. Told is how far the deep truck is off there
beside its own error, and what the tool says. A case that is done is not run again.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np

os.environ.setdefault("OMP_NUM_THREADS", "1")


from deeptruck_model import deep, driving_cycles, simulators, trucks
from deeptruck_model.mismatch import find_mismatch
from deeptruck_model.mismatch.validate import own_error

TRUCK, SEEDS, FIT, SECONDS = "trucksim", 3, 3, 240.0
CHANGES: tuple[tuple[str, tuple[float, ...]], ...] = (
    ("mass", (0.7, 0.85, 1.15, 1.3, 1.5)),
    ("brake_gain", (0.6, 0.8, 1.3)),
    ("rolling_resistance", (0.7, 1.4, 1.8)),
    ("headwind", (-8.0, -4.0, 4.0, 8.0)),
    ("nothing", (1.0,)),
)
UNDECIDED = ("undetermined",)
WORSE = 1.33  # times the simulator's own error, beyond which silence is wrong
RESULTS = Path(__file__).parents[1] / "docs" / "results" / "changed_truck.md"


class Headwind:
    """Wind against the truck, m/s, in place of calm air."""

    def __init__(self, wind_m_s: float, drag_area: float) -> None:
        self.wind, self.drag_area = wind_m_s, drag_area

    def reset(self, batch: int) -> None: ...

    def force(self, view: trucks.View, dt: float) -> np.ndarray:
        air = view.speed + self.wind
        return -0.5 * 1.225 * self.drag_area * (air * np.abs(air) - view.speed**2)


@dataclass(frozen=True)
class Case:
    """A change, its size, and what came of it: errors (m/s) are of free runs on the held-out drive."""

    change: str
    size: float
    seed: int
    own: float = 0.0
    here: float = 0.0
    after: float = 0.0
    verdict: str = ""
    said: tuple[str, ...] = ()
    group: tuple[str, ...] = ()
    validated: bool = False

    @property
    def key(self) -> str:
        return f"{self.change}_{self.size:g}_{self.seed}"

    @property
    def seen(self) -> bool:
        """Whether the deep truck drives clearly worse here than on its own drives."""
        return self.here > WORSE * self.own

    @property
    def silent(self) -> bool:
        return self.verdict == "nothing_missing"

    @property
    def named(self) -> bool:
        return self.change in self.group

    @property
    def undecided(self) -> bool:
        return self.verdict in UNDECIDED or self.said[:1] == ("unknown",)


def changed(case: Case) -> trucks.PhysicsTruck:
    truck = trucks.load(TRUCK)
    own = truck.parameters()
    if case.change == "headwind":
        return truck.with_forces([Headwind(case.size, own["drag_area"])])
    return (
        truck
        if case.change == "nothing"
        else truck.with_parameters({case.change: case.size * own[case.change]})
    )


def run(case: Case, simulator: str, work: Path) -> Case:
    """The case with what came of it, kept in `work`."""
    path = work / f"{case.key}.json"
    if not path.exists():
        truck, seed = changed(case), 7000 + 10 * case.seed
        drives = [driving_cycles.drive(truck, seconds=SECONDS, seed=seed + k) for k in range(FIT + 1)]
        path.write_text(json.dumps(asdict(_judged(case, simulators.load(simulator), drives))))
    kept = json.loads(path.read_text())
    return Case(**{**kept, "said": tuple(kept["said"]), "group": tuple(kept["group"])})


def _judged(case: Case, simulator: simulators.Simulator, drives: Sequence[driving_cycles.Recording]) -> Case:
    found = find_mismatch(simulator, drives[:FIT], drives[FIT:])
    fit, first = found.result.fit, found.findings[:1]
    horizon = fit.horizon_s if fit else 20.0
    errors = fit.errors if fit else None
    return Case(
        case.change, case.size, case.seed,
        own_error(simulator, False, horizon) or 0.0,
        errors.before.speed if errors else 0.0,
        errors.after.speed if errors else 0.0,
        str(found.result.kind),
        tuple(f.effect for f in found.findings),
        tuple(name for f in first for name in (f.effect, *f.cannot_be_told_from)),
        found.result.validated,
    )  # fmt: skip


def taught(work: Path, hours: float) -> str:
    path = work / "simulator"
    if not path.exists():
        drives = [driving_cycles.drive(trucks.load(TRUCK), hours=hours / 4, seed=k) for k in range(4)]
        deep.train(drives, path, deep.Arguments())
    return str(path)


def page(cases: Sequence[Case], hours: float) -> list[str]:
    """One row a change; failures by name below."""
    lines = [
        "# A changed truck beside a simulator learned before",
        "",
        f"`python benchmarks/bench_changed_truck.py --hours {hours:g}`",
        "",
        f"A deep truck learned from {hours:g} h of `{TRUCK}`. Speed errors are those of free runs on the",
        "held-out drive, median, m/s. *Clearly worse* is a third above the deep truck's own error.",
        "",
        "| change | cases | own | here | after | clearly worse | and silent | named | undecided | other |",
        "| --- " * 10 + "|",
    ]
    for change, _ in CHANGES:
        of_it = [c for c in cases if c.change == change]
        if of_it:
            own, here, after = (np.median([getattr(c, k) for c in of_it]) for k in ("own", "here", "after"))
            worse = [c for c in of_it if c.seen]
            counts = (
                len(worse), sum(c.silent for c in worse), sum(c.named for c in of_it),
                sum(c.undecided and not c.named for c in of_it),
                sum(not (c.named or c.undecided or c.silent) for c in of_it),
            )  # fmt: skip
            cells = (change, len(of_it), f"{own:.2f}", f"{here:.2f}", f"{after:.2f}", *counts)
            lines.append(f"| {' | '.join(map(str, cells))} |")
    wrong = [c for c in cases if not (c.named or c.undecided or c.silent)]
    lines += ["", "Other names:" if wrong else "No other name was told in any case.", ""]
    lines += [
        f"- {c.change} {c.size:g}: {' '.join(c.said)}{', validated' if c.validated else ''}" for c in wrong
    ]
    return lines


def main() -> None:
    """Print the table and write it to docs/results/changed_truck.md."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--work", type=Path, default=Path("runs/changed_truck"))
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--keep-page", action="store_true", help="print only")
    args = parser.parse_args()
    args.work.mkdir(parents=True, exist_ok=True)
    simulator = taught(args.work, args.hours)
    cases = [Case(change, size, seed) for seed in range(SEEDS) for change, sizes in CHANGES for size in sizes]
    with ProcessPoolExecutor(args.jobs, get_context("spawn")) as pool:
        waiting = [pool.submit(run, case, simulator, args.work) for case in cases]
        done = [future.result() for future in waiting]
    lines = page(done, args.hours)
    print("\n".join(lines))
    if not args.keep_page:
        RESULTS.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
