"""Fault injection: the bridge and the ECU emulator on one bus, and a world that misbehaves at random.

`python tests/truck_bridge/fault_runs.py --runs 1000` runs in lock-step (time is an argument, so a run takes
a fraction of its length) and judges, on what left the bridge, the invariants in `judge`. Every run is drawn
from its seed: `--first N --runs 1` repeats one. `fault_processes.py` does the same to real processes.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from fault_judge import ENGAGED_AT, judge, reactions
from fault_kinds import FAULTS
from fault_world import NAMES, build

FAULT_AT, LENGTH = 1.6, 5.0


@dataclass(frozen=True)
class Verdict:
    """Broken invariants, and the reaction to the fault: seconds, and the state it led to."""

    seed: int
    vehicle: str
    fault: str
    broken: tuple[str, ...]
    engaged: bool
    reaction_s: float
    release_s: float


def play(seed: int, names: Sequence[str] = NAMES) -> Verdict:
    """One run."""
    run = build(seed, names)
    fault = str(run.rng.choice(list(FAULTS)))
    at = FAULT_AT + float(run.rng.uniform(0.0, 0.1))
    until = at + float(run.rng.uniform(1.1, 2.0))
    undo: Callable[[], None] | None = None
    begun = engaged = False
    while run.now < LENGTH:
        if not engaged and run.now >= ENGAGED_AT:
            engaged = run.bridge.engage(run.now, person=True, lead_vehicle=True) == ()
            if not engaged and run.now > ENGAGED_AT + 0.3:
                break
        if not begun and run.now >= at:
            undo, begun = FAULTS[fault](run), True
        if undo is not None and run.now >= until:
            undo()
            undo = None
        run.step()
    run.bridge_side.shutdown()
    run.truck_side.shutdown()
    broken = tuple(judge(run, fault, at)) if engaged else ("did not engage",)
    return Verdict(seed, run.vehicle.name, fault, broken, engaged, *reactions(run, fault, at))


def report(verdicts: list[Verdict]) -> list[str]:
    """A table by fault."""
    lines = [f"{'fault':<24}{'runs':>6}{'ended':>7}{'reaction p50':>14}{'max':>8}{'release max':>13}  broken"]
    for fault in FAULTS:
        mine = [v for v in verdicts if v.fault == fault]
        ended = [v.reaction_s for v in mine if not math.isnan(v.reaction_s)]
        released = [v.release_s for v in mine if not math.isnan(v.release_s)]
        broken = Counter(b for v in mine for b in v.broken)
        times = (
            f"{1e3 * np.median(ended):>11.0f} ms{1e3 * max(ended):>5.0f} ms"
            if ended
            else f"{'-':>14}{'-':>8}"
        )
        last = f"{1e3 * max(released):>10.0f} ms" if released else f"{'-':>13}"
        lines.append(f"{fault:<24}{len(mine):>6}{len(ended):>7}{times}{last}  {dict(broken) or 'none'}")
    return lines


def main() -> int:
    """Run many and say what broke."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--vehicle", action="append", help="vehicle file or name; else ours, by turns")
    options = parser.parse_args()
    names = options.vehicle or NAMES
    verdicts = [play(seed, names) for seed in range(options.first, options.first + options.runs)]
    for line in report(verdicts):
        print(line)
    broken = [v for v in verdicts if v.broken]
    for verdict in broken[:20]:
        print(f"seed {verdict.seed} ({verdict.vehicle}, {verdict.fault}): {'; '.join(verdict.broken)}")
    print(f"{len(verdicts)} runs, {len(broken)} with a broken invariant")
    print(f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
