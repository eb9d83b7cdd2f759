"""How often names are right on families that the recogniser has not seen, beside the library's forms alone.

python -m deeptruck_exam.command recogniser --out runs/recogniser
python benchmarks/bench_names.py --taught runs/recogniser [--work runs/names] [--cases 56] [--jobs 2]

Cases of the development families hide one effect each. The whole tool runs on each with the recogniser that
was taught without the case's family. A case that is done is not run again.
"""

from __future__ import annotations

import argparse
import json
import math
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

os.environ.setdefault("OMP_NUM_THREADS", "1")

from deeptruck_exam.cases import Case, make_case, open_truth
from deeptruck_exam.effects.planting import FAMILIES
from deeptruck_exam.limit import LEVELS
from deeptruck_exam.teaching.run import WITHOUT
from deeptruck_model import recordings, simulators
from deeptruck_model.mismatch import Mismatch, Recogniser, find_mismatch
from deeptruck_model.mismatch.posterior import naming
from deeptruck_model.mismatch.rules import Rules

SEED, LEAST = 41000, 1e-3  # a name that is not told has this probability
RESULTS = Path(__file__).parents[1] / "docs" / "results" / "bench_names.md"
WAYS = {"forms": "the library's forms alone", "told": "as the tool tells"}
Names = Mapping[str, float]


@dataclass(frozen=True)
class Named:
    """A case: the hidden effect, and the probability of each name in place of the first finding of missing
    physics, by each way; empty where there is none."""

    level: str
    family: str
    seed: int
    hidden: str
    forms: Names
    told: Names


def case(level: str, family: str, seed: int, work: Path, taught: Path) -> Named | None:
    """The case, kept in `work`; None where it hides a fault of a sensor."""
    kept = work / f"{level}-{family}-{seed}.json"
    if not kept.exists():
        by = Recogniser.load(taught / WITHOUT.format(family))
        naming.recogniser = lambda: by
        with TemporaryDirectory() as folder:
            made = make_case(Path(folder) / "case", level, seed, forms=family)
            found = named(made, level, family, seed)
        kept.write_text(json.dumps(found and asdict(found)))
    data = json.loads(kept.read_text())
    return Named(**data) if data else None


def named(made: Case, level: str, family: str, seed: int) -> Named | None:
    (effect, *_) = open_truth(made)["effects"]
    if effect["kind"] == "measurement_fault":
        return None
    found = (f.cause for f in found_in(made).findings)
    physics = [c for c in found if c is not None and c.kind == "missing_physics"]
    ways = (physics[0].by_forms, physics[0].names) if physics else ({}, {})
    return Named(level, family, seed, str(effect["name"]), *ways)


def found_in(made: Case) -> Mismatch:
    fit, held_out = (
        [max(recordings.read(path), key=len) for path in made.paths(which)]
        for which in (made.fit, made.held_out)
    )
    return find_mismatch(simulators.load(made.simulator), fit, held_out)


def credible(names: Names) -> list[str]:
    """The most probable names that hold the right one with the probability of a group."""
    order = sorted(names, key=lambda name: -names[name])
    before = np.cumsum([0.0, *(names[name] for name in order)])[:-1]
    return [name for name, p in zip(order, before, strict=True) if p < Rules.credible]


def row(cases: Sequence[Named], way: str) -> tuple[float, ...]:
    """Most probable, in the credible set, its size, log score, calibration error; means over the cases."""
    told: list[tuple[str, Names]] = [(c.hidden, getattr(c, way)) for c in cases]
    right = np.array([max(names, key=lambda n: names[n]) == hidden for hidden, names in told])
    most = np.array([max(names.values()) for _, names in told])
    bins = np.minimum((most * 5).astype(int), 4)
    gaps = [abs(float((right - most)[bins == b].sum())) for b in range(5)]
    return (
        float(right.mean()),
        float(np.mean([hidden in credible(names) for hidden, names in told])),
        float(np.mean([len(credible(names)) for _, names in told])),
        float(np.mean([math.log(max(names.get(hidden, 0.0), LEAST)) for hidden, names in told])),
        sum(gaps) / len(told),
    )


def page(cases: Sequence[Named]) -> list[str]:
    told = [c for c in cases if c.told]
    return [
        "# Names, on families the recogniser has not seen",
        "",
        f"`python benchmarks/bench_names.py --taught runs/recogniser --cases {len(cases)}`",
        "",
        f"{len(cases)} development cases with one hidden effect, seeds from {SEED}. In {len(told)} the tool",
        f"told missing physics. A name that is not told counts with {LEAST:g} in the log score (nats).",
        "",
        *table("weighed by", [(says, told, way) for way, says in WAYS.items()]),
        "",
        "As the tool tells, by level and by family:",
        "",
        *table("", [(x, [c for c in told if c.level == x], "told") for x in LEVELS]),
        "",
        *table("", [(x, [c for c in told if c.family == x], "told") for x in FAMILIES]),
    ]


def table(first: str, rows: Sequence[tuple[str, Sequence[Named], str]]) -> list[str]:
    head = [
        first,
        "cases",
        "most probable",
        "in the credible set",
        "its size",
        "log score",
        "calibration error",
    ]
    lines = [f"| {' | '.join(head)} |", "| --- " * len(head) + "|"]
    for says, some, way in rows:
        if some:
            lines.append(f"| {says} | {len(some)} | {' | '.join(f'{x:.2f}' for x in row(some, way))} |")
    return lines


def main() -> None:
    """Print the tables and write them to docs/results/bench_names.md."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--taught", type=Path, default=Path("runs/recogniser"))
    parser.add_argument("--work", type=Path, default=Path("runs/names"))
    parser.add_argument("--cases", type=int, default=56)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--keep-page", action="store_true", help="print only")
    args = parser.parse_args()
    args.work.mkdir(parents=True, exist_ok=True)
    rounds = range(math.ceil(args.cases / (len(LEVELS) * len(FAMILIES))))
    plan = [
        (level, f, SEED + 97 * k + 13 * i) for k in rounds for i, f in enumerate(FAMILIES) for level in LEVELS
    ]
    with ProcessPoolExecutor(args.jobs, get_context("spawn")) as pool:
        waiting = [pool.submit(case, *job, args.work, args.taught) for job in plan[: args.cases]]
        for k, done in enumerate(as_completed(waiting), 1):
            done.result()
            print(f"{k} of {len(waiting)}", flush=True)
    lines = page([c for c in (future.result() for future in waiting) if c is not None])
    print("\n".join(lines))
    if not args.keep_page:
        RESULTS.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
