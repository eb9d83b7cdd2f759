"""The two flows of the mismatch tool on the same cases: right names, probabilities and CPU time.

python benchmarks/bench_mismatch_flows.py CASES --out flows.json [--flow budget] [--make 2 --seed 1]

CASES holds folders of the exam's cases; `--make` adds so many of each level. Each flow runs in this process,
one thread. A case that is in the results already is not run again, so that a run can be gone on with.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

from deeptruck_exam.cases.case import Case, make_case, open_truth
from deeptruck_exam.cases.levels import LEVELS
from deeptruck_exam.scoring.score import score_names
from deeptruck_model import mismatch, mismatch_flow, recordings, simulators
from deeptruck_model.mismatch_flow.tree import FAMILY, ROOT, UNKNOWN

Find = Callable[..., Any]
FLOWS: dict[str, Find] = {"search": mismatch.find_mismatch, "budget": mismatch_flow.find_mismatch}


def run(case: Case, find: Find) -> dict[str, Any]:
    """The numbers of one case by one flow."""
    simulator = simulators.load(case.simulator)
    fit, held = (
        recordings.read_all(case.paths(names), rate_hz=1.0 / simulator.dt)
        for names in (case.fit, case.held_out)
    )
    excluded = [n for n in case.environment.get("DEEPTRUCK_MISMATCH_EXCLUDE", "").split(",") if n]
    began = time.process_time()
    verdict = find(simulator, fit, held, exclude=excluded).verdict
    return numbers(open_truth(case), verdict) | {"cpu_s": round(time.process_time() - began, 2)}


def numbers(truth: Mapping[str, Any], verdict: Mapping[str, Any]) -> dict[str, Any]:
    """What is compared: names, families, what was stated, and errors on held-out drives."""
    scored = score_names(truth, verdict)
    findings, fit = verdict["findings"], verdict["fit"]
    families = {FAMILY.get(name, UNKNOWN) for name in scored["true"]}
    said = {FAMILY.get(f["effect"], UNKNOWN) for f in findings}
    first = findings[0] if findings else {}
    stated = first.get("stated", ROOT)
    parts = verdict.get("budget", {}).get("parts", ())
    return {
        "level": truth["level"],
        "true": scored["true"],
        "said": scored["said"],
        "verdict": verdict["verdict"],
        "probability": first.get("probability"),
        "right_first": scored["right_first"],
        "in_group": scored["in_group"],
        "set_size": scored["set_size"],
        "family_first": FAMILY.get(first.get("effect", ""), "") in families,
        "families_found": len(families & said),
        "families_true": len(families),
        "families_said": len(said),
        "stated": stated,
        "stated_right": None if stated == ROOT else stated in families or stated in scored["true"],
        "before": fit.get("before", {}).get("speed_rmse"),
        "after": fit.get("after", {}).get("speed_rmse"),
        "validated": bool(fit.get("validated")),
        "left_over": next((p["share"] for p in parts if p["part"] == "left_over"), None),
    }  # fmt: skip


def table(results: Mapping[str, Mapping[str, Any]], flows: Sequence[str]) -> list[str]:
    """One column for each flow, over the cases that all of them have run."""
    common = [name for name in results if all(flow in results[name] for flow in flows)]
    lines = [f"{len(common)} cases", f"| | {' | '.join(flows)} |", "| --- " * (len(flows) + 1) + "|"]
    columns = [_column([results[name][flow] for name in common]) for flow in flows]
    return [*lines, *(f"| {row} | {' | '.join(c[row] for c in columns)} |" for row in columns[0])]


def _column(rows: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    single = [r for r in rows if r["level"] not in ("several", "nothing_missing")]
    several = [r for r in rows if r["level"] == "several"]
    silent = [r for r in rows if r["level"] == "nothing_missing"]
    stated = [r for r in single if r["stated_right"] is not None]
    driven = [r for r in rows if r["before"] is not None]
    after = sorted(r["after"] if r["validated"] else r["before"] for r in driven)
    sizes = [r["set_size"] for r in single if r["set_size"]]

    def share(key: str, of: Sequence[Mapping[str, Any]]) -> str:
        return f"{sum(bool(r[key]) for r in of)} of {len(of)}"

    def ratio(key: str, by: str) -> str:
        return f"{sum(r[key] for r in several) / max(sum(r[by] for r in several), 1):.2f}"

    return {
        "right first": share("right_first", single),
        "in the credible set": share("in_group", single),
        "names in a set": f"{sum(sizes) / max(len(sizes), 1):.1f}",
        "family right first": share("family_first", single),
        "stated, and right": share("stated_right", stated),
        "several at once: families recalled, precision": f"{ratio('families_found', 'families_true')}, "
        f"{ratio('families_found', 'families_said')}",
        "nothing missing: with a finding": share("said", silent),
        "held-out speed error, median, m/s": f"{after[len(after) // 2]:.3f}" if after else "",
        "CPU s": f"{sum(r['cpu_s'] for r in rows) / max(len(rows), 1):.1f}",
    }


def main() -> None:
    """Run what is missing, and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("cases", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--flow", action="append", choices=tuple(FLOWS))
    parser.add_argument("--make", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    for k in range(options.make):
        for level in LEVELS:
            folder = options.cases / f"{level}_{options.seed + k}"
            if not folder.exists():
                make_case(folder, level, options.seed + k)
    results: dict[str, Any] = json.loads(options.out.read_text()) if options.out.exists() else {}
    flows = options.flow or list(FLOWS)
    for folder in sorted(path.parent for path in options.cases.glob("*/case.json")):
        for flow in flows:
            if flow not in results.setdefault(folder.name, {}):
                results[folder.name][flow] = run(Case.read(folder), FLOWS[flow])
                options.out.write_text(json.dumps(results, indent=1))
                print(folder.name, flow, results[folder.name][flow]["said"], flush=True)
    print("\n".join(table(results, flows)))


if __name__ == "__main__":
    main()
