"""What limits the smallest force that is seen beside a learned simulator: the data, or the simulator?

python benchmarks/bench_smallest_force.py [--work runs/smallest_force]      (needs DEEPTRUCK_REAL_DATA)

Simulators are learned from real drives, and a steady force is hidden in other drives of the same vehicle, as
in `prove --real`. It is enlarged until the tool would have told it: with the simulator's own error allowed
for, as the tool does, and without, which is what noise and the amount of data alone would let it see.
"""

from __future__ import annotations

import argparse
import os
from dataclasses import dataclass, replace
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

from deeptruck_exam.real.fleets import FLEETS, UPDATES, Fleet, examine_real
from deeptruck_model import recordings, simulators
from deeptruck_model.errors import InputError
from deeptruck_model.mismatch import find_mismatch
from deeptruck_model.mismatch.report.identifiability import smallest_visible

REAL_DATA = "DEEPTRUCK_REAL_DATA"
RESULTS = Path(__file__).parents[1] / "docs" / "results" / "smallest_force.md"
HEAD = (
    "# The smallest force seen beside a learned simulator",
    "",
    "`python benchmarks/bench_smallest_force.py`",
    "",
    "A steady force is hidden in real drives and enlarged until the tool would have told it. The own error",
    "is the rms, over means of some seconds, on drives that the simulator did not learn from. Without",
    "allowing for it, noise and the amount of data decide. All in m/s².",
    "",
    "| vehicle | fitted | own error | smallest force | without its own error |",
    "| --- | --- | --- | --- | --- |",
)


@dataclass(frozen=True)
class Smallest:
    """Of one vehicle: the minutes that were fitted, and m/s^2."""

    vehicle: str
    minutes: float
    own_error: float
    told: float
    without: float


def smallest(fleet: Fleet, folder: Path) -> Smallest | None:
    """The first drive of a fleet, fitted; None where something was found in it."""
    simulator = simulators.load(folder / "simulator")
    fit, held = (recordings.read(folder / "recordings" / f"drive_{k}") for k in (0, 1))
    found = find_mismatch(simulator, fit, held)
    seen, e = found.result.data.smallest_visible, found.evidence
    if seen is None or e is None or found.explanation is None:
        return None
    itself = replace(e, model_discrepancy=0.0, slow_noise=e.rules.slow_noise, itself=None)
    alone = smallest_visible(itself, found.explanation)
    fitted = (~e.held_out & e.valid).sum() * e.dt / 60
    return Smallest(fleet.name, float(fitted), e.model_discrepancy, seen.always, alone.always)


def main() -> None:
    """Write docs/results/smallest_force.md."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--work", type=Path, default=Path("runs/smallest_force"))
    parser.add_argument("--updates", type=int, default=UPDATES, help="of each simulator")
    args = parser.parse_args()
    data = os.environ.get(REAL_DATA)
    if not data:
        raise SystemExit(f"{REAL_DATA} is not set; it is the folder of the real logs (docs/recordings.md)")
    try:
        examine_real(Path(data), args.work, sources=(), updates=args.updates)
    except InputError as error:
        raise SystemExit(str(error)) from None
    lines = [*HEAD]
    for fleet in FLEETS:
        one = smallest(fleet, args.work / fleet.name) if (args.work / fleet.name).is_dir() else None
        if one is not None:
            lines.append(
                f"| {one.vehicle} | {one.minutes:.0f} min | {one.own_error:.3f} | {one.told:.3f} "
                f"| {one.without:.3f} |"
            )
    print("\n".join(lines))
    RESULTS.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
