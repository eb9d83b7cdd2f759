"""How often the mismatch tool is right, on cases of the exam on which nothing was chosen.

    python benchmarks/bench_mismatch.py [--out DIR] [--seed 400000] [--cases 3] [--nulls 15]

For every level of the exam `--cases` cases are made with physics trucks, and `--nulls` cases of
`nothing_missing`. The tool runs on each, and its verdict is compared with the truth. A correction that it
offers is driven along eight more drives of the same truck, which the tool has not seen. Rows are kept in DIR,
so that a stopped run continues. Writes its section of docs/results/mismatch.md.
"""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import harness
import numpy as np
from ideal_observer import AHEAD, ideal, true_force, with_events
from threadpoolctl import threadpool_limits

from deeptruck_core.errors import InputError
from deeptruck_exam.cases.case import Case, further_drives, make_case, open_truth
from deeptruck_exam.cases.levels import LEVELS
from deeptruck_exam.cases.plan import MINUTES
from deeptruck_exam.scoring import score
from deeptruck_exam.scoring.evaluation import arrays, open_loop
from deeptruck_exam.tool import excluded
from deeptruck_model import simulators
from deeptruck_model.mismatch import Mismatch
from deeptruck_model.mismatch.find import called, compared, concluded
from deeptruck_model.mismatch.folders import AS_GIVEN, CORRECTION, REFIT
from deeptruck_model.mismatch.mechanisms.families import (
    FAMILY,
    LEFT_OVER,
    PARAMETER_ERRORS,
    ROOT,
    SENSOR_ERRORS,
    UNKNOWN,
)
from deeptruck_model.mismatch.posterior.names import Compared
from deeptruck_model.mismatch.residual.noise import Z95
from deeptruck_model.mismatch.rules import Rules

NULL = "nothing_missing"
PARAMETERS = "only_parameters"
NO_NAME = ("input_not_recorded", "each_drive_differs")  # levels at which no name is right
NAMED_OFF, CORRECTED_OFF, BUDGET_OFF = 0.1, 0.15, 0.3  # m/s, along held-out drives
LEAST = 0.01  # probability of a name that is not listed
PARAMETER_OFF = 0.05  # relative, from which a parameter of the simulator differs from the truck's
LISTED = 0.1  # probability from which a node counts for calibration
BINS = 5

SIZE = ("parameter", "true", "value", "ci95", "holds")

Row = dict[str, Any]


def main() -> None:
    """Examine the tool, print the table and write it to a section of docs/results/mismatch.md."""
    levels = (list(LEVELS), "levels of the exam")
    given = harness.options(
        __doc__,
        {
            "--out": (Path("build/bench_mismatch"), "folder of the rows"),
            "--seed": (400_000, "first seed"),
            "--cases": (3, "of each level"),
            "--nulls": (15, f"of {NULL}"),
            "--minutes": (MINUTES, "of each recording"),
            "--levels": levels,
            "--effect": ("", "law that every case hides, in the place of those that seeds select"),
            "--print": (False, "print alone"),
            "--kept": (False, "of the cases that are kept alone"),
        },
    )
    rows = []
    for level in given.levels:
        for k in range(given.nulls if level == NULL else given.cases):
            if given.kept and not kept(given.out, level, given.seed + k).exists():
                continue
            rows.append(examined(given.out, level, given.seed + k, given.minutes, given.effect or None))
            print(json.dumps(rows[-1]), flush=True)
    lines = [
        *harness.heading(f"Cases of the exam, seeds from {given.seed}"),
        *summary(rows),
        "",
        *by_level(rows),
        "",
        *by_name(rows),
    ]
    if given.print:
        print("\n".join(lines))
    else:
        harness.store("mismatch", lines)


def examined(out: Path, level: str, seed: int, minutes: float, effect: str | None = None) -> Row:
    """The row of one case; read from `out` if it is kept there."""
    path = kept(out, level, seed)
    if path.exists():
        stored: Row = json.loads(path.read_text())
        return stored
    folder = out / f"{level}-{seed}"
    shutil.rmtree(folder, ignore_errors=True)  # of a stopped run
    case = make_case(folder, level, seed, effect, minutes=minutes)
    truth = open_truth(case)
    began = time.process_time()
    try:
        found, c = run(case)
    except InputError as error:
        row = {"cpu_s": time.process_time() - began, **judged(truth, {}, str(error))}
    else:
        row = {"cpu_s": time.process_time() - began, **judged(truth, found.verdict)}
        row["ideal"] = shown_by_the_data(case, truth, c)
        if row["offered"] != AS_GIVEN:
            row["further"] = along_further_drives(case, truth, found, row["offered"])
    shutil.rmtree(folder)
    path.write_text(json.dumps(row))
    return row


def kept(out: Path, level: str, seed: int) -> Path:
    """The file in which the row of a case is kept."""
    return out / f"{level}-{seed}.json"


def run(case: Case) -> tuple[Mismatch, Compared]:
    """Run the tool on a case, on one core, as `find_mismatch` does; and what it compared."""
    rules, left_out = Rules(), excluded(case)
    with threadpool_limits(1):
        truck, fit, held = called(
            case.simulator,
            [str(path) for path in case.paths(case.fit)],
            [str(path) for path in case.paths(case.held_out)],
            seed=0,
            exclude=left_out,
            without=(),
            say=None,
            rules=rules,
            mass_kg=None,
        )
        c = compared(truck, fit, held, exclude=left_out, rules=rules)
        if not isinstance(c, Compared):
            raise InputError(f"nothing can be compared: {c.unusable_because}")
        return concluded(truck, c, rules, lambda step: None), c


def shown_by_the_data(case: Case, truth: Mapping[str, Any], c: Compared) -> Row | None:
    """What an ideal observer could tell of a case with one hidden force; None for any other case."""
    if len(truth["effects"]) != 1 or truth["simulator"] != "physics":
        return None
    with np.load(case.folder / "truth" / "drives.npz") as archive:
        extra = dict(zip((*case.fit, *case.held_out), archive["extra"], strict=True))
    effect = truth["effects"][0]
    with threadpool_limits(1):
        found = ideal(with_events(c), true_force(c, extra), effect["name"], effect["accepts"])
    return found and {**asdict(found), "attainable": found.attainable, "held": found.held}


def along_further_drives(
    case: Case, truth: Mapping[str, Any], found: Mismatch, offered: str
) -> dict[str, float]:
    """Speed errors (rms, m/s) of the simulator as given and of the one offered, along drives that the tool
    has not seen."""
    better = found.corrected if offered == CORRECTION else found.refitted
    assert better is not None  # something is offered
    trucks = {"given": simulators.load(case.simulator), "offered": better}
    interface = trucks["given"].interface
    zero = dict.fromkeys((*interface.u, *interface.w), 0.0)  # inputs that are not recorded, as when compared
    further = further_drives(truth)
    filled = [{n: np.full(len(r), x) for n, x in zero.items()} | r.channels for r in further]
    drives = arrays(
        [replace(r, interface=interface, channels=c) for r, c in zip(further, filled, strict=True)]
    )
    return {name: open_loop(truck, *drives).rmse()["speed_rmse"] for name, truck in trucks.items()}


def judged(truth: Mapping[str, Any], verdict: Mapping[str, Any], says: str = "") -> Row:
    """The verdict compared with the truth, as plain data."""
    names = score.score_names(truth, verdict)
    fit, budget = verdict.get("fit") or {}, verdict.get("budget") or {}
    offered = fit.get("offered", AS_GIVEN)
    held = {n: fit[n]["speed_rmse"] for n in ("before", "parameters_only", "after") if n in fit}
    end = {AS_GIVEN: "before", CORRECTION: "after"}.get(offered, "parameters_only")
    parts = [p["part"] for p in budget.get("parts") or () if p["part"] not in (LEFT_OVER, UNKNOWN)]
    findings = verdict.get("findings") or ()
    nodes = probabilities(verdict)
    return {
        "level": truth["level"],
        "seed": truth["seed"],
        **{n: names[n] for n in ("true", "said", "verdict", "right_first", "in_group", "set_size")},
        "also_true": parameters_off(truth),
        "recall": names.get("recall"),
        "false_names": names.get("false_names"),
        "probability": nodes.get(names["true"][0], 0.0) if len(names["true"]) == 1 else None,
        "nodes": [*nodes.items()],
        "stated": [f["stated"] for f in findings if f["stated"] != ROOT],
        "parts": parts[:1],
        "budget_off": budget.get("speed_rmse"),
        "offered": offered,
        "before": held.get("before"),
        "after": held.get(end),
        "events": score.score_events(truth, verdict),
        "found_events": [
            (x["recording"], x["start_s"], x["end_s"], x["probability"]) for x in verdict.get("events") or ()
        ],
        "sizes": [{n: i[n] for n in SIZE} for i in score.score_intervals(truth, verdict)],
        "contains": contains_stated(verdict, offered),
        "input_stated": score.input_stated(truth, verdict, says),
        "each_drive_found": score.each_drive_found(truth, verdict),
        "says": says,
    }


def contains_stated(verdict: Mapping[str, Any], offered: str) -> bool | None:
    """Whether the offered simulator has every name that is stated; None where none is, or none is offered."""
    findings = verdict.get("findings") or ()
    stated = {f["effect"] for f in findings if f["stated"] == f["effect"]} - {UNKNOWN, *SENSOR_ERRORS}
    if not stated or offered == AS_GIVEN:
        return None
    return stated <= (set(PARAMETER_ERRORS) if offered == REFIT else set(verdict["fit"]["corrected"]))


def sds_off(size: Mapping[str, Any]) -> float:
    """By how many of its standard deviations a size is off."""
    low, high = size["ci95"]
    return float(abs(size["value"] - size["true"]) / max((high - low) / (2.0 * Z95), 1e-12))


def is_attainable(row: Row) -> bool:
    """Whether the data of a case show its effect; a parameter, a sensor or a slope, which is no force of its
    own, counts as shown."""
    return bool(row["ideal"]["attainable"]) if row.get("ideal") else True


def parameters_off(truth: Mapping[str, Any]) -> list[str]:
    """Parameters that the simulator has otherwise than the truck. Of one that was fitted to drives with the
    effect in them they are no error of the tool's to name, and no answer to what is missing."""
    given, true = truth.get("simulator_parameters") or {}, truth.get("true_parameters") or {}
    return [p for p, value in given.items() if abs(value - true[p]) > PARAMETER_OFF * abs(true[p])]


def probabilities(verdict: Mapping[str, Any]) -> dict[str, float]:
    """Probabilities by name and family: those of the findings, and those in the tree of the first one."""
    out = {n["node"]: float(n["probability"]) for n in verdict.get("tree") or ()}
    for f in verdict.get("findings") or ():
        out |= {f["family"]: float(f["family_probability"]), f["effect"]: float(f["probability"])}
    return out


def summary(rows: Sequence[Row]) -> list[str]:
    """Lines of the table of all cases."""
    one = [r for r in rows if len(r["true"]) == 1 and r["level"] not in NO_NAME]
    first = [r for r in one if r["said"]]
    shown = [r for r in one if is_attainable(r)]
    open_cases = [r for r in one if not is_attainable(r)]
    named_rows = [r for r in rows if r["level"] not in NO_NAME]
    stated = [(s, [*r["true"], *r["also_true"]]) for r in named_rows for s in r["stated"]]
    said_at = [
        (dict(r["nodes"]).get(n, 0.0), n in (*r["true"], *r["also_true"]))
        for r in named_rows
        for n in r["said"]
    ]
    several = [r for r in rows if r["level"] == "several"]
    nulls = [r for r in rows if r["level"] == NULL]
    wrong = [r for r in rows if r["level"] == PARAMETERS]
    named = [r for r in one if _above(r["before"], NAMED_OFF)]
    split = [r for r in one if _above(r["budget_off"], BUDGET_OFF)]
    driven = [r for r in rows if r["true"] and _above(r["before"], CORRECTED_OFF)]
    further = [r["further"] for r in rows if "further" in r]
    worse = [f for f in further if f["offered"] > f["given"]]
    said = sum(len(r["said"]) for r in several)
    rare = [r["events"] for r in rows if r["level"] == "rare"]
    hours = sum(8 * MINUTES / 60.0 for _ in nulls)
    known = [s for r in rows for s in r["sizes"]]
    off = [sds_off(s) for s in known] or [float("nan")]
    sizes = [r["set_size"] for r in first]
    ratio = np.exp(np.mean([np.log(r["after"] / r["before"]) for r in driven])) if driven else np.nan
    logs = [np.log(max(r["probability"], LEAST)) for r in one]
    out = {
        f"attainable, by {AHEAD:g} evidence temperatures: right first; in the set": _of(
            r["right_first"] for r in shown
        )
        + f"; {_of(r['in_group'] for r in shown)}",
        "the others: right first; no name stated": _of(r["right_first"] for r in open_cases)
        + f"; {_of(not any(s in FAMILY and s != UNKNOWN for s in r['stated']) for r in open_cases)}",
        "single effects, right first": _of(r["right_first"] for r in one),
        "in the credible set; names in a set": f"{_of(r['in_group'] for r in one)}; {np.mean(sizes):.1f}",
        "family right first": _of(FAMILY[r["said"][0]] == FAMILY[r["true"][0]] for r in first)
        + f", of all {len(one)}",
        "log score of names; calibration error": f"{np.mean(logs):.2f}; {calibration_error(rows):.2f}",
        "statements that are right, of parameters that are off too": _of(
            s in (*t, *(FAMILY[n] for n in t)) for s, t in stated
        ),
        "names said at 0.95 or more that are right; at 0.8 to 0.95; at 0.5 to 0.8": "; ".join(
            _of(x for p, x in said_at if low <= p < high)
            for low, high in ((0.95, 1.1), (0.8, 0.95), (0.5, 0.8))
        ),
        f"something named, where off by {NAMED_OFF:g} m/s or more": _of(bool(r["said"]) for r in named),
        f"largest part of the budget is the true family, where off by more than {BUDGET_OFF:g} m/s": _of(
            r["parts"] == [FAMILY[r["true"][0]]] for r in split
        ),
        "several at once: names recalled; precision": _of(t in r["said"] for r in several for t in r["true"])
        + f"; {sum(n in r['true'] for r in several for n in r['said'])} of {said}",
        f"held-out error, what is offered over as given, where off by more than {CORRECTED_OFF:g} m/s, "
        "geometric mean": f"{ratio:.2f} of {len(driven)}",
        "offered, and worse on eight further drives": f"{len(worse)} of {len(further)}",
        "a stated name is in the simulator that is offered": _of(
            r["contains"] for r in rows if r["contains"] is not None
        ),
        "nulls with a finding": _of(bool(r["said"]) for r in nulls),
        "nulls with wrong parameters: with a name that is no parameter; silent": _of(
            not set(r["said"]) <= set(PARAMETER_ERRORS) for r in wrong
        )
        + f"; {_of(not r['said'] for r in wrong)}",
        "events of level rare: located by half or more": f"{sum(e['located'] for e in rare)} of "
        f"{sum(e['true'] for e in rare)}",
        "events in nulls": f"{sum(len(r['found_events']) for r in nulls)} in {hours:.1f} h",
        "true sizes inside their 95 % intervals; standard deviations off, median and largest": _of(
            s["holds"] for s in known
        )
        + f"; {np.median(off):.1f}, {np.max(off):.1f}",
        "a withheld input is reported, and no name given that it explains": _of(
            bool(r["input_stated"]) for r in rows if r["input_stated"] is not None
        ),
        "what differs between drives is the largest part of the budget": _of(
            bool(r["each_drive_found"]) for r in rows if r["each_drive_found"] is not None
        ),
        "CPU s a case, median": f"{np.median([r['cpu_s'] for r in rows]):.1f}",
    }
    return harness.table("of | figure", (f"{name} | {figure}" for name, figure in out.items()))


def calibration_error(rows: Iterable[Row]) -> float:
    """Mean difference between the probabilities of names and families and how often these are right, over the
    nodes of trees in BINS bins."""
    nodes = [
        (p, node in (*true, *(FAMILY[n] for n in true)))
        for r in rows
        for true in [[*r["true"], *r["also_true"]]]
        if r["level"] not in NO_NAME
        for node, p in r["nodes"]
        if p >= LISTED and node != "nothing"
    ]
    if not nodes:
        return float("nan")
    p, right = np.array(nodes, dtype=float).T
    bins = np.minimum((p * BINS).astype(int), BINS - 1)
    apart = [np.mean(bins == k) * abs(p[bins == k].mean() - right[bins == k].mean()) for k in np.unique(bins)]
    return float(np.sum(apart))


def by_level(rows: Sequence[Row]) -> list[str]:
    """Lines of a table of wrong statements by level."""
    out = []
    for level in dict.fromkeys(r["level"] for r in rows):
        own = [r for r in rows if r["level"] == level]
        wrong = [
            f"{', '.join(r['said']) or 'nothing'} for {', '.join(r['true']) or 'nothing'} ({r['seed']})"
            for r in own
            if (r["said"] != r["true"] if level not in NO_NAME else r["input_stated"] is False)
            and not (level == PARAMETERS and set(r["said"]) <= set(PARAMETER_ERRORS))
        ]
        named = [r["right_first"] for r in own if r["true"]]  # of nothing there is no name
        out.append(f"{level.replace('_', ' ')} | {_of(named) if named else '-'} | {'; '.join(wrong)}")
    return harness.table("level | right first | otherwise", out)


def by_name(rows: Sequence[Row]) -> list[str]:
    """Lines of a table of what the laws of each name hold of the true force, in attainable cases."""
    out = []
    shown = [r for r in rows if r.get("ideal") and is_attainable(r)]
    for name in sorted({r["true"][0] for r in shown}):
        each = [r for r in shown if r["true"] == [name]]
        held = ", ".join(f"{r['ideal']['held']:.2f}" for r in each)
        ahead = ", ".join(f"{r['ideal']['tool_ahead']:.0f} of {r['ideal']['ahead']:.0f}" for r in each)
        rival = ", ".join(
            f"{r['ideal']['rival'].replace('_', ' ')} "
            f"{r['ideal']['rival_nats'] / r['ideal']['force_nats']:.2f}"
            for r in each
        )
        out.append(f"{name.replace('_', ' ')} | {held} | {rival} | {ahead}")
    return harness.table(
        "name | share of the true force's evidence that its laws hold | the best rival's | ahead of every "
        "set without it, in evidence temperatures",
        out,
    )


def _above(value: float | None, least: float) -> bool:
    return value is not None and value >= least


def _of(flags: Iterable[bool]) -> str:
    known = list(flags)
    return f"{sum(known)} of {len(known)}"


if __name__ == "__main__":
    main()
