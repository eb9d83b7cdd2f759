"""Record the true truck, correct the old simulator, train on both and on the truth, drive the true truck."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.benefit import report
from benchmarks.benefit.belief import believed
from benchmarks.benefit.effects import CASES, STOPS, TESTS, Case
from benchmarks.benefit.plan import BENEFIT, EFFECTS, RECIPES, WORK, Effort, check
from deeptruck_cacc.controllers.loading import load_policy
from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.controllers.policy import Policy
from deeptruck_cacc.environments.reward import Reward
from deeptruck_cacc.environments.rollouts import Trace, roll_out
from deeptruck_cacc.environments.scenes import Scene
from deeptruck_cacc.evaluation import metrics
from deeptruck_cacc.safety.guard import guard
from deeptruck_cacc.training import analytic
from deeptruck_cacc.training.lent_gradient import with_gradient
from deeptruck_cacc.training.settings import AnalyticConfig
from deeptruck_model import files, mismatch, recordings, simulators
from deeptruck_model.checks import MANIFEST, METADATA
from deeptruck_model.errors import InputError
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import Simulator
from deeptruck_model.trucks import driving_cycles

Say = Callable[[str], None]
DRIVES, HELD_OUT, DRIVE_S = 8, 2, 400.0
SPEED_NOISE = 0.003  # m/s, a good wheel speed sensor
SETTLED_S = 10.0


def benefit(
    out: str | Path,
    effects: Sequence[str] = EFFECTS,
    recipes: Sequence[str] = tuple(RECIPES),
    effort: Effort = Effort(),
    *,
    resume: bool = False,
    overwrite: bool = False,
    say: Say = lambda line: None,
) -> dict[str, Any]:
    """Run the cases and write `out`/benefit.json, benefit.md and benefit.png.

    Drives, verdicts, simulators and policies are kept under `out`/work. A killed run leaves
    `files.unfinished(out)`, which `resume` continues. Raises InputError as `plan.check`.
    """
    out = Path(out)
    check(out, effects, recipes, resume=resume, overwrite=overwrite)
    results: dict[str, Any] = {}
    with BENEFIT.going_on(out, overwrite=overwrite, resume=resume) as draft:
        for name in effects:
            results[name] = _case(name, CASES[name], draft / WORK, recipes, effort, say)
            report.write(results, draft)
    return results


def _case(
    name: str, case: Case, work: Path, recipes: Sequence[str], effort: Effort, say: Say
) -> dict[str, Any]:
    say(f"{name}: finding what is missing")
    found = correct(case, work / "cases" / name)
    row: dict[str, Any] = {"says": case.says, **found, "recipes": {r: {} for r in recipes}}
    for recipe in recipes:
        for kind, (folder, simulator) in _simulators(name, case, work).items():
            say(f"{name}: the {kind} simulator, {recipe}")
            home = work / "policies" / folder / recipe
            kept = work / "exams" / f"{name}-{kind}-{recipe}.json"
            do = partial(_exams, case, simulator, home, recipe, effort)
            row["recipes"][recipe][kind] = _once(kept, effort, do)
    return row


def _once(path: Path, effort: Effort, do: Callable[[], list[dict[str, Any]]]) -> list[dict[str, Any]]:
    """The result of `do`, or its stored result if that was made with the same effort."""
    if path.exists() and (kept := json.loads(path.read_text()))["effort"] == asdict(effort):
        return list(kept["exams"])
    exams = do()
    files.write(path, json.dumps({"effort": asdict(effort), "exams": exams}).encode())
    return exams


def correct(case: Case, folder: Path) -> dict[str, Any]:
    """Drive and record the true truck, run the mismatch tool on the old simulator, and save
    `folder`/corrected.

    Returns a summary of the verdict. If no correction was validated, `folder`/corrected does not exist.
    """
    found = folder / "found"
    if not (found / "verdict.json").exists():
        if not (folder / "old" / MANIFEST).exists():  # a killed run may have left the folder empty
            case.old.save(folder / "old")
        drives = [r for k, d in enumerate(_drives(case)) for r in _through_a_bag(d, folder / f"drive{k}")]
        result = mismatch.find_mismatch(
            simulators.load(folder / "old"), drives[:-HELD_OUT], drives[-HELD_OUT:]
        )
        mismatch.write(result, found)
    verdict = json.loads((found / "verdict.json").read_text())
    corrected = folder / "corrected" / MANIFEST
    if verdict["fit"].get("validated") and not corrected.exists():
        mismatch.apply(found, folder / "corrected")
    errors = {k: verdict["fit"].get(k, {}).get("speed_rmse") for k in ("before", "parameters_only", "after")}
    return {
        "verdict": verdict["verdict"],
        "found": [f["effect"] for f in verdict["findings"]],
        "free_run_speed_rmse": errors,
        "applied": corrected.exists(),
    }


def _drives(case: Case) -> list[Recording]:
    """The first drives of the true truck that descend as the case asks."""
    out: list[Recording] = []
    for seed in range(100):
        drive = driving_cycles.drive(
            case.truck, seconds=DRIVE_S, seed=seed, settings=case.drives, name=f"d{seed}"
        )
        grade = drive.channels.get("grade", np.zeros(1))
        if -grade.mean() >= case.least_descent:
            drive.channels["speed"] += np.random.default_rng(seed).normal(0.0, SPEED_NOISE, len(drive))
            out.append(drive)
        if len(out) == DRIVES:
            return out
    raise InputError("too few drives descend as the case asks")


def _through_a_bag(drive: Recording, bag: Path) -> list[Recording]:
    if not (bag / METADATA).exists():
        recordings.write_bag(bag, [drive], interface=drive.interface)
    return list(recordings.read(bag, rate_hz=1.0 / drive.dt))


def _simulators(name: str, case: Case, work: Path) -> dict[str, tuple[str, Simulator]]:
    """For each kind of simulator the folder of its policies, and the simulator; without a correction the old
    one is used."""
    folder = work / "cases" / name
    corrected = folder / "corrected"
    learned_on = simulators.load(corrected if (corrected / MANIFEST).exists() else folder / "old")
    return {
        "old": (case.old_name.replace(" ", "_"), simulators.load(folder / "old")),
        "corrected": (f"{name}_corrected", learned_on),
        "true": (f"{name}_true", case.truck),
    }


def _policies(simulator: Simulator, home: Path, case: Case, name: str, effort: Effort) -> list[Policy]:
    recipe, usual = RECIPES[name], Reward()
    config = AnalyticConfig(
        seeds=effort.seeds,
        rollouts=effort.paths,
        iterations=effort.iterations,
        window=effort.window,
        windows=case.windows,
        scene=recipe.scenes + case.suffix,
        memory=recipe.memory,
    )
    costs = {key: recipe.care * getattr(usual, key) for key in ("alpha_p", "alpha_v", "alpha_e", "alpha_b")}
    analytic.train(with_gradient(simulator), home, config, reward=replace(usual, **costs), resume=True)
    return [load_policy(home / "seeds" / str(k)) for k in range(effort.seeds)]


def _exams(case: Case, simulator: Simulator, home: Path, recipe: str, effort: Effort) -> list[dict[str, Any]]:
    """Train on the simulator and drive the true truck with a shield that assumes the simulator's
    capabilities."""
    pedals, rows = PedalMap.calibrate(case.truck), []
    shields = {name: believed(simulator, hot=name == "hot_stop") for name in case.tests if name in STOPS}
    for policy in _policies(simulator, home, case, recipe, effort):
        drivers = {name: guard(policy, shields[name]) if name in shields else policy for name in case.tests}
        runs = {name: roll_out(case.truck, d, _scene(case, name, effort)) for name, d in drivers.items()}
        rows.append({name: measured(trace, pedals) for name, trace in runs.items()})
    return rows


def _scene(case: Case, name: str, effort: Effort) -> Scene:
    draw, seconds = TESTS[name]
    return draw(np.random.default_rng(2000), effort.rollouts, round(seconds / case.truck.dt), case.truck.dt)


def measured(trace: Trace, pedals: PedalMap) -> dict[str, float]:
    """The figures that the report shows of one policy in one scene.

    Errors are rms after 10 s, while the truck moves and has the power to hold the time gap; the brake is the
    mean of its command as a share of its range.
    """
    late = round(SETTLED_S / trace.dt)
    fair: NDArray[np.bool_] = metrics.within_reach(trace.scene, pedals, trace.dt)[late:]
    fair &= trace["speed"][late:] > 1.0
    row = metrics.summary(trace)
    return {
        "time_gap_rms_s": _rms(trace["time_gap_error"][late:][fair]),
        "time_gap_mean_s": float(trace["time_gap_error"][late:][fair].mean()) if fair.any() else float("nan"),
        "speed_rms": _rms(trace["speed_error"][late:][fair]),
        "min_gap_m": row["min_gap_m"],
        "below_safety": row["crashes"],
        "rollouts": row["rollouts"],
        "jerk_rms": row["jerk_rms"],
        "brake_share": float(trace["brake_command"].mean() / max(pedals.scale.brake_high, 1e-12)),
    }


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")
