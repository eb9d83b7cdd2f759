"""Runs one evaluation: drives, measures, draws, and writes metrics.json."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_cacc.controllers.baselines import LAWS, baseline
from deeptruck_cacc.controllers.loading import PLANNER, load_policy
from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.controllers.policy import Policy
from deeptruck_cacc.environments.hard_scenes import HARD, recorded, recorded_leaders
from deeptruck_cacc.environments.rollouts import Trace, roll_out
from deeptruck_cacc.environments.scenes import Scene
from deeptruck_cacc.evaluation import figures, metrics, platoon
from deeptruck_cacc.evaluation.against_best import against_best
from deeptruck_cacc.evaluation.output import (
    CURVE,
    EVALUATION,
    FIELD,
    LEADERS,
    METRICS,
    PAGE,
    STABILITY,
    VARIANTS,
    check_dt,
    seed_folders,
)
from deeptruck_cacc.evaluation.page import page
from deeptruck_cacc.safety import guard as guards
from deeptruck_cacc.safety import truck_limits
from deeptruck_cacc.safety.assumptions import Assumptions
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model import simulators
from deeptruck_model.simulators import Simulator

Say = Callable[[str], None]


@dataclass(frozen=True)
class Extent:
    """The scenes and figures of an evaluation; see `evaluate`."""

    rollouts: int = 100
    seed: int = 1000
    shield: bool = False
    full: bool = False
    draw: bool = True
    say: Say = lambda step: None
    planner: str = ""


def evaluate(
    policy: str | Policy,
    simulator: str | Simulator,
    out: str | Path,
    *,
    rollouts: int = 100,
    seed: int = 1000,
    shield: bool = False,
    full: bool = False,
    draw: bool = True,
    overwrite: bool = False,
    say: Say = lambda step: None,
    planner: str = "",
) -> dict[str, Any]:
    """Drive a policy and write `out`/metrics.json and figures; the metrics are returned as well.

    Always: the paper's set, a leader of varying speed on hills and the two field runs, by the policy and by
    every baseline (on a pedal map of this simulator). `full` adds the scenes of hard_scenes.HARD, heavier and
    lighter trucks if the simulator has a mass, recorded leaders if the data are present, and platoons.
    `planner` is a simulator for a planner, as a further baseline. `shield` puts the guard after policy and
    baselines, with assumptions measured on the simulator. `draw` False omits the scenes' figures; `say` is
    called with each step. `out` is written completely or not at all, and an older evaluation is replaced only
    with `overwrite`. Raises InputError for an `out` that cannot be written, and for a policy of another
    truck.
    """
    extent = Extent(rollouts, seed, shield, full, draw, say, planner)
    with EVALUATION.replacing(Path(out), overwrite=overwrite) as draft:
        return _evaluate(policy, simulator, draft, extent)


def _evaluate(
    policy: str | Policy,
    simulator: str | Simulator,
    draft: Path,
    extent: Extent,
    baselines: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """See `evaluate`; `baselines` are those of an earlier evaluation with the same simulator and extent."""
    rollouts, seed, full = extent.rollouts, extent.seed, extent.full
    truck = simulators.load(simulator) if isinstance(simulator, str) else simulator
    driver = load_policy(policy, truck.interface) if isinstance(policy, str) else policy
    check_dt(driver, truck.dt)
    assumed = truck_limits.measure(truck) if extent.shield else None
    driver = _behind(driver, assumed)
    pedals = PedalMap.calibrate(truck)
    cases = dict(_cases(truck, rollouts, seed, full))
    sets = {name: _drive(driver, *cases[name]) for name in _each(extent, "driving", cases)}
    # What a heavier truck could have reached is asked of its own pedals.
    own = {name: pedals if on is truck else PedalMap.calibrate(on) for name, (on, _) in cases.items()}
    results: dict[str, Any] = {
        "schema": 1,
        "policy": str(policy) if isinstance(policy, str) else type(policy).__name__,
        "simulator": str(simulator) if isinstance(simulator, str) else type(simulator).__name__,
        "seed": seed,
        "shield": extent.shield,
        "sets": {name: _row(name, trace, own[name]) for name, trace in sets.items()},
    }
    bare: dict[str, Policy] = {law: baseline(law, truck.interface, pedals, truck.dt) for law in LAWS}
    if extent.planner:
        bare["planner"] = load_policy(f"{PLANNER}{extent.planner}", truck.interface)
    drivers = {law: _behind(one, assumed) for law, one in bare.items()}
    results["baselines"] = baselines or _baselines(drivers, cases, own, extent)
    results["against_best"] = against_best(results)
    if full:
        extent.say("driving platoons")
        results["platoon"] = _platoons(truck, driver, drivers)
    for name in _each(extent, "drawing", sets) if extent.draw else ():
        _draw(name, sets[name], truck.interface, draft)
    if full:
        figures.amplification(results["platoon"], draft / STABILITY)
    if isinstance(policy, str):
        _draw_learning(Path(policy), draft)
    _write(results, draft, extent.draw)
    return results


def evaluate_seeds(
    policy: str | Path, simulator: str, out: str | Path, *, overwrite: bool = False, **options: Any
) -> dict[str, Any]:
    """Run `evaluate` for every policy under `policy`/seeds, each into `out`/K, and combine the worst results.

    'sets' has the numbers of the worst seed for each entry; 'seeds' the results of each seed. Raises
    InputError if `policy` has no seeds.
    """
    folders = seed_folders(Path(policy))
    with EVALUATION.replacing(Path(out), overwrite=overwrite) as draft:
        each: dict[str, dict[str, Any]] = {}
        for p in folders:
            driven = next(iter(each.values()))["baselines"] if each else None
            each[p.name] = _evaluate(str(p), simulator, _made(draft / p.name), Extent(**options), driven)
        results = _together(policy, each)
        _draw_learning(Path(policy), draft)
        _write(results, draft, Extent(**options).draw)
    return results


def _made(folder: Path) -> Path:
    folder.mkdir()
    return folder


def _together(policy: str | Path, each: dict[str, dict[str, Any]]) -> dict[str, Any]:
    first = next(iter(each.values()))
    sets = {name: _worst([result["sets"][name] for result in each.values()]) for name in first["sets"]}
    results = {**first, "policy": f"{policy}, worst of {len(each)} seeds", "sets": sets}
    results["seeds"] = {name: result["sets"] for name, result in each.items()}
    results["against_best"] = against_best(results)
    return results


def _worst(rows: list[Any]) -> Any:
    """For each entry of several summaries, the number farthest from zero (the least for gap, ttc and return);
    lists with a number per rollout are concatenated."""
    if isinstance(rows[0], dict):
        low = ("min_gap_m", "min_ttc_s", "mean_return", "share_within_reach", "rollouts_within_0.1_s")
        return {
            key: min(row[key] for row in rows) if key in low else _worst([row.get(key) for row in rows])
            for key in rows[0]
        }
    if isinstance(rows[0], list):
        return rows
    return None if any(row is None for row in rows) else max(rows, key=abs)


def _draw_learning(policy: Path, out: Path) -> None:
    files = [policy / "learning_curve.jsonl", *sorted(policy.glob("seeds/*/learning_curve.jsonl"))]
    runs = [_whole_lines(f) for f in files if f.exists()]
    if runs and all(runs):
        figures.learning_curve(runs, out / CURVE)


def _whole_lines(path: Path) -> list[dict[str, Any]]:
    """The complete lines of a learning curve; an incomplete last line after a kill or on a full disk is
    omitted."""
    rows: list[dict[str, Any]] = []
    with suppress(json.JSONDecodeError):
        for line in path.read_text().splitlines():
            rows.append(json.loads(line))
    return rows


def _write(results: dict[str, Any], out: Path, with_page: bool) -> None:
    (out / METRICS).write_text(json.dumps(results, indent=1) + "\n")
    if with_page:
        (out / PAGE).write_text(page(results, out), encoding="utf-8")


def _cases(
    truck: Simulator, rollouts: int, seed: int, full: bool
) -> Iterator[tuple[str, tuple[Simulator, Scene]]]:
    for name in HARD if full else ("paper", "moving", *FIELD):
        yield name, (truck, _scene(name, rollouts, seed, truck.dt))
    if not full:
        return
    for name, (parameter, value, scene) in VARIANTS.items():
        if parameter in truck.parameters():
            other = truck.with_parameters({parameter: value})
            yield name, (other, _scene(scene, rollouts, seed, truck.dt))
    for name in LEADERS:
        try:
            leaders = recorded_leaders(name)
        except InputError:
            continue  # the recordings are not part of the project
        yield f"recorded_{name}", (truck, recorded(leaders, 2.0))


def _scene(name: str, rollouts: int, seed: int, dt: float) -> Scene:
    draw, seconds = HARD[name]
    return draw(np.random.default_rng(seed), rollouts, round(seconds / dt), dt)


def _drive(driver: Policy, truck: Simulator, scene: Scene) -> Trace:
    # A bare policy is not asked to see without a radar: tracker and hand-over come with every such scene.
    blind = scene.seen is not None or scene.seen_gap_offset is not None
    bridged = guards.guard(driver, shield=False) if blind and not isinstance(driver, guards.Guard) else driver
    return roll_out(truck, bridged, scene)


def _row(name: str, trace: Trace, pedals: PedalMap) -> dict[str, Any]:
    row = metrics.summary(trace, metrics.within_reach(trace.scene, pedals, trace.dt))
    if name == "gap_closing":
        for label, bounds in (("paper", (0.35, 0.2)), ("reach", (0.1, 0.1))):
            times = metrics.settling_time(trace, *bounds)
            for key, time in (("", times.max()), ("_median", np.median(times))):
                row[f"closed_s_{label}_bounds{key}"] = round(float(time), 3) if np.isfinite(time) else None
    return row


def _draw(name: str, trace: Trace, interface: TruckInterface, out: Path) -> None:
    if name in FIELD:
        figures.field_run(trace, out / f"{name}.png", interface)
    else:
        figures.error_bands(trace, out / f"{name}.png")


def _each(extent: Extent, doing: str, names: Iterable[str]) -> Iterator[str]:
    """The names one by one; each is reported before it is yielded."""
    for name in names:
        extent.say(f"{doing} {name}")
        yield name


def _behind(driver: Policy, assumed: Assumptions | None) -> Policy:
    """The policy or baseline with the guard, if assumptions are given."""
    return driver if assumed is None else guards.guard(driver, assumed)


def _baselines(
    drivers: dict[str, Policy],
    cases: dict[str, tuple[Simulator, Scene]],
    pedals: dict[str, PedalMap],
    extent: Extent,
) -> dict[str, Any]:
    """Rows by baseline and case; `pedals` are those of each case's truck."""
    return {
        law: {name: _row(name, _drive(drivers[law], *case), pedals[name]) for name, case in cases.items()}
        for law in _each(extent, "driving", drivers)
    }


def _platoons(truck: Simulator, driver: Policy, drivers: dict[str, Policy]) -> dict[str, Any]:
    rows = {
        f"policy, {'V2V' if v2v else 'radar'}": platoon.string_stability(truck, driver, v2v=v2v)
        for v2v in (True, False)
    }
    for law in ("acc", "cacc"):
        rows[law] = platoon.string_stability(truck, drivers[law])
    return rows
