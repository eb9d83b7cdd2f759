"""The mismatch tool on a truck that others wrote, FASTSim's (`pip install 'deeptruck[proof]'`).

python benchmarks/bench_foreign.py [--cases 5] [--seed 100000] [--out build/foreign]

Runs `deeptruck-model prove --plant fastsim` and stores its page as docs/results/foreign.md.
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import harness

from deeptruck_exam.folder import check_plant
from deeptruck_exam.plants import page
from deeptruck_exam.plants.prove import prove_plant


def main() -> None:
    options = harness.options(
        __doc__,
        {
            "--cases": (5, "seeds"),
            "--seed": (100_000, "the first of them"),
            "--jobs": (2, "cases at once"),
            "--out": (Path(harness.ROOT / "build" / "foreign"), "a stopped run in it goes on"),
        },
    )
    if find_spec("fastsim") is None:
        harness.skip("FASTSim is not installed: pip install 'deeptruck[proof]'")
    check_plant("fastsim", options.out)
    seeds = range(options.seed, options.seed + options.cases)
    harness.store("foreign", page.lines(prove_plant(options.out, seeds, options.jobs)))


if __name__ == "__main__":
    main()
