"""`prove --plant fastsim`: hides one property at a time of FASTSim's truck, and runs the tool."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from deeptruck_core import files
from deeptruck_exam.cases.case import Case
from deeptruck_exam.folder import PLANT
from deeptruck_exam.jobs import in_parallel
from deeptruck_exam.plants import cases, fastsim_truck, page
from deeptruck_exam.plants.cases import CONCEALED, NAMES, Concealed
from deeptruck_exam.plants.simulators import DATA_SHEET, OWN, SIMULATORS, make
from deeptruck_exam.scoring.score import FAILED, score_names
from deeptruck_exam.tool import ToolRun, run_tool

FIT = NAMES[:-1]
Run = tuple[Path, str, int, str, str]  # folder, what is concealed, seed, simulator and its name
OFFERS = ("as_given", "parameters_only", "correction")  # `fit.offered` of verdict.json, as page.DRIVEN
NULL, NULL_FACTOR = "nothing", 4  # nulls need numbers: of its own equations so many times the cases
FEW = 2  # seeds of the data sheet, whose own differences take five times as long
BLIND = "slope"  # concealed by not logging it, so that no simulator may ask for it


def prove_plant(
    out: Path,
    seeds: Sequence[int],
    jobs: int = 1,
    concealed: Sequence[str] = tuple(CONCEALED),
    simulators: Sequence[str] = SIMULATORS,
    updates: int = 0,
) -> list[dict[str, Any]]:
    """Examine the tool on FASTSim's truck; writes plant.md and plant.json into `out` and returns the rows.

    Existing rows are kept, unless the tool failed, so that an interrupted run can be resumed. With FASTSim's
    own equations as the simulator there are NULL_FACTOR times as many nulls as seeds, unless there is a
    single seed; with the truck of the data sheet there are FEW seeds. `updates` of the learned simulator, 0
    for the default of training. Raises ModuleNotFoundError if FASTSim is not installed, InputError if a
    simulator cannot be made.
    """
    fastsim_truck.fastsim()
    with PLANT.in_place(out):
        print("making the simulators, some minutes", flush=True)
        made = make(out / "simulators", updates=updates)
        blind = make(out / "blind", grade=False, updates=updates) if BLIND in concealed else {}
        wanted = [(key, seed, s) for s in simulators for key in concealed for seed in _seeds(seeds, key, s)]
        print(f"{len(wanted)} runs of the tool, 7 to 40 s each", flush=True)
        each = [(out, k, seed, (blind if k == BLIND else made)[s], s) for k, seed, s in wanted]
        for _ in in_parallel(_examine, each, jobs, "runs"):
            pass
        rows = [_kept(out, key, seed, simulator) for _, key, seed, _, simulator in each]
        files.write(out / "plant.json", json.dumps(rows, indent=1).encode())
        files.write(out / "plant.md", "\n".join(page.lines(rows)).encode())
        return rows


def _seeds(seeds: Sequence[int], key: str, simulator: str) -> Sequence[int]:
    if simulator == DATA_SHEET:
        return seeds[:FEW]
    if (simulator, key) == (OWN, NULL) and len(seeds) > 1:
        return [*seeds, *range(max(seeds) + 1, max(seeds) + 1 + (NULL_FACTOR - 1) * len(seeds))]
    return seeds


def _folder(out: Path, key: str, seed: int) -> Path:
    return out / "cases" / f"{key}-{seed}"


def _row(out: Path, key: str, seed: int, simulator: str) -> Path:
    return _folder(out, key, seed) / f"{simulator.replace(' ', '_')}.json"


def _kept(out: Path, key: str, seed: int, simulator: str) -> dict[str, Any]:
    """The stored row of a run; {} if it has not ended."""
    path = _row(out, key, seed, simulator)
    kept: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {}
    return kept


def _examine(work: Run) -> None:
    out, key, seed, made, simulator = work
    if _kept(out, key, seed, simulator).get("outcome", FAILED) != FAILED:
        return
    folder, concealed = _folder(out, key, seed), CONCEALED[key]
    geared = simulator == DATA_SHEET
    place = folder / "geared" if geared else folder
    if not (place / "recordings" / NAMES[-1]).exists():
        cases.written(cases.drives(concealed, seed, geared=geared), place / "recordings")
    case = Case(place, made, FIT, NAMES[-1:], {}, "")
    path = _row(out, key, seed, simulator)
    run = run_tool(case, folder / f"found_{path.stem}")
    about = {"key": key, "concealed": concealed.what, "simulator": simulator, "seed": seed}
    files.write(path, json.dumps({**about, **judged(concealed, run)}, indent=1).encode())


def judged(concealed: Concealed, run: ToolRun) -> dict[str, Any]:
    """The statement, whether it is right, and the free-run speed errors in m/s on the held-out drive: of the
    simulator as given, with refitted parameters only, corrected, and offered; None if there are none."""
    fit = run.verdict.get("fit") or {}
    first: Mapping[str, Any] = next(iter(run.verdict.get("findings") or ()), {})
    errors = {name: (fit.get(name) or {}).get("speed_rmse") for name in page.DRIVEN}
    errors["offered"] = errors[page.DRIVEN[OFFERS.index(fit.get("offered", OFFERS[0]))]]
    return {
        **score_names(concealed.scored(), run.verdict),
        "probability": first.get("probability"),
        "size": first.get("strength"),
        "validated": bool(fit.get("validated")),
        **errors,
        "seconds": run.seconds,
        "says": run.says[-300:] if run.returncode else "",
    }
