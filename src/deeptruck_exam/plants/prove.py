"""`prove --plant fastsim`: conceals one thing at a time of a truck that others wrote, and runs the tool."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from deeptruck_exam.cases.case import Case
from deeptruck_exam.folder import PLANT
from deeptruck_exam.jobs import in_parallel
from deeptruck_exam.plants import cases, fastsim_truck, page
from deeptruck_exam.plants.cases import CONCEALED, NAMES
from deeptruck_exam.plants.simulators import SIMULATORS, make
from deeptruck_exam.scoring.score import score_names
from deeptruck_exam.tool import ToolRun, run_tool
from deeptruck_model import files

PLANTS = ("fastsim",)
FIT = NAMES[:-1]
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

    A row that is there is kept, so that a stopped run goes on. `updates` of the learned simulator, 0 for as
    many as training chooses. Raises ModuleNotFoundError where FASTSim is not installed, InputError where a
    simulator cannot be made.
    """
    fastsim_truck.fastsim()
    with PLANT.in_place(out):
        print("making the simulators, some minutes", flush=True)
        made = make(out / "simulators", updates=updates)
        blind = make(out / "blind", grade=False, updates=updates) if BLIND in concealed else {}
        wanted = [(key, seed) for seed in seeds for key in concealed]
        print(f"{len(wanted)} cases of {len(simulators)} simulators, some seconds each", flush=True)
        each = [(out, *w, blind if w[0] == BLIND else made, simulators) for w in wanted]
        in_parallel(_examine, each, jobs)
        rows = [
            json.loads((_folder(out, key, seed) / f"{_short(simulator)}.json").read_text())
            for key, seed in wanted
            for simulator in simulators
        ]
        files.rewrite(out / "plant.json", json.dumps(rows, indent=1).encode())
        files.rewrite(out / "plant.md", "\n".join(page.lines(rows)).encode())
    return rows


def _folder(out: Path, key: str, seed: int) -> Path:
    return out / "cases" / f"{key}-{seed}"


def _short(simulator: str) -> str:
    return simulator.replace(" ", "_")


def _examine(out: Path, key: str, seed: int, made: Mapping[str, str], simulators: Sequence[str]) -> None:
    folder, concealed = _folder(out, key, seed), CONCEALED[key]
    left = [s for s in simulators if not (folder / f"{_short(s)}.json").exists()]
    if not left:
        return
    cases.written(cases.drives(concealed, seed), folder / "recordings")
    for simulator in left:
        case = Case(folder, made[simulator], FIT, NAMES[-1:], {}, "")
        run = run_tool(case, folder / f"found_{_short(simulator)}")
        about = {"key": key, "concealed": concealed.what, "simulator": simulator, "seed": seed}
        row = {**about, **judged(key, run)}
        files.write(folder / f"{_short(simulator)}.json", json.dumps(row, indent=1).encode())


def judged(key: str, run: ToolRun) -> dict[str, Any]:
    """What was said, whether it is right, and the speed errors in m/s of free runs on the drive held out: of
    the simulator as given, with parameters alone refitted, and corrected; None where there are none."""
    fit = run.verdict.get("fit") or {}
    first: Mapping[str, Any] = next(iter(run.verdict.get("findings") or ()), {})
    errors = {name: (fit.get(name) or {}).get("speed_rmse") for name in page.ERRORS}
    return {
        **score_names(CONCEALED[key].scored(), run.verdict),
        "probability": first.get("probability"),
        "size": first.get("strength"),
        "validated": bool(fit.get("validated")),
        **errors,
        "seconds": run.seconds,
        "says": run.says[-300:] if run.returncode else "",
    }
