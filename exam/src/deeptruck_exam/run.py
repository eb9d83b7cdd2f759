"""One case from beginning to end: make it, run the tool, open the truth, score. A scored case is read
instead.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_core import files
from deeptruck_exam.cases.absorption import retune
from deeptruck_exam.cases.case import Case, make_case, open_truth
from deeptruck_exam.cases.plan import MINUTES
from deeptruck_exam.folder import clear
from deeptruck_exam.scoring import score
from deeptruck_exam.scoring.evaluation import arrays, open_loop
from deeptruck_exam.tool import ToolRun, run_tool
from deeptruck_exam.worlds.trucks import TUNABLE
from deeptruck_model import simulators
from deeptruck_model.recordings import Recording, read
from deeptruck_model.trucks import PhysicsTruck

SCORE = "score.json"


def examine(
    folder: Path,
    level: str,
    seed: int,
    effect: str | None = None,
    simulator: str = "physics",
    minutes: float = MINUTES,
    *,
    with_rivals: bool = True,
    keep: bool = False,
) -> dict[str, Any]:
    """The score of one case as plain data, also written to `folder`/score.json. Recordings are removed unless
    `keep`."""
    done = folder / SCORE
    if done.exists():
        result: dict[str, Any] = json.loads(done.read_text())
        return result
    clear(folder)
    case = make_case(folder, level, seed, effect, simulator, minutes)
    run = run_tool(case, folder / "found")
    result = {
        "level": level,
        "seed": seed,
        "simulator": simulator,
        "sha256": case.sha256,
        **judge(case, run, with_rivals=with_rivals),
    }
    if not keep:
        clear(folder, "recordings", "found/simulator", "found/refitted")
    files.write(done, json.dumps(result, indent=1).encode())
    return result


def judge(case: Case, run: ToolRun, *, with_rivals: bool = True) -> dict[str, Any]:
    """Open the truth and score the tool's run against it."""
    truth = open_truth(case)
    result: dict[str, Any] = {
        "returncode": run.returncode,
        "seconds": run.seconds,
        **score.score_names(truth, run.verdict),
        "recognised_unknown": score.recognised_unknown(truth, run.verdict),
        "input_stated": score.input_stated(truth, run.verdict, run.says),
        "each_drive_found": score.each_drive_found(truth, run.verdict),
        "overlap": score.overlap(truth, run.verdict),
        "events": score.score_events(truth, run.verdict),
        "intervals": score.score_intervals(truth, run.verdict),
        "information_nats": truth["information_nats"],
        "information_left_nats": truth["information_left_nats"],
        "share_of_time": truth["share_of_time"],
        "condition": truth["condition"],
    }
    if run.returncode:
        result["says"] = run.says
    if with_rivals and truth["effects"] and truth["verdict"] != "measurement_fault":
        errors = held_out_errors(case, truth)
        result["errors"], result["share"] = errors, score.improvement(errors)
    return result


def held_out_errors(case: Case, truth: Mapping[str, Any]) -> dict[str, Mapping[str, float]]:
    """Open-loop errors of the given simulator ('before'), one with refitted parameters, the oracle, which has
    the true parameters and effects, and the tool's corrected simulator ('tool')."""
    simulator = simulators.load(case.simulator)
    fit, held = _recordings(case, case.fit), _recordings(case, case.held_out)
    with np.load(case.folder / "truth" / "drives.npz") as archive:
        kept = {name: archive[name] for name in ("extra", "grade")}
    rows = slice(len(case.fit), None)
    blind = "grade" not in held[0].channels
    oracle = simulator
    if truth["simulator"] != "deep":
        truck: Any = simulator.with_parameters(truth["nominal_parameters"])
        oracle = truck.with_grade_input() if blind else truck
    u, w, y = arrays(held)
    errors: dict[str, Mapping[str, float]] = {"before": open_loop(simulator, u, w, y).rmse()}
    if isinstance(simulator, PhysicsTruck):
        start = {name: simulator.parameters()[name] for name in TUNABLE}
        refitted = simulator.with_parameters(retune(simulator, start, fit))
        errors["parameters_only"] = open_loop(refitted, u, w, y).rmse()
    road = kept["grade"][rows][:, :, None] if blind and truth["simulator"] != "deep" else w
    errors["oracle"] = open_loop(oracle, u, road, y, kept["extra"][rows][:, : y.shape[1]]).rmse()
    corrected = case.folder / "found" / "simulator"
    errors["tool"] = errors["before"]  # a tool that offers nothing improves nothing
    if (corrected / simulators.MANIFEST).exists():
        errors["tool"] = open_loop(simulators.load(corrected), u, w, y).rmse()
    return errors


def _recordings(case: Case, names: tuple[str, ...]) -> list[Recording]:
    return [max(read(path), key=len) for path in case.paths(names)]
