"""Runs one evaluation: drives, measures, draws, and writes metrics.json, figures and evaluation.html."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_cacc.controllers.baselines import LAWS, baseline
from deeptruck_cacc.controllers.loading import load_policy
from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.controllers.policy import Policy
from deeptruck_cacc.environments.hard_scenes import HARD, recorded, recorded_leaders
from deeptruck_cacc.environments.rollouts import Trace, roll_out
from deeptruck_cacc.environments.scenes import Scene
from deeptruck_cacc.evaluation import metrics, platoon
from deeptruck_cacc.evaluation.page import page
from deeptruck_cacc.safety import guard as guards
from deeptruck_cacc.safety import truck_limits
from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_model import simulators
from deeptruck_model.results import apart
from deeptruck_model.simulators import Simulator

Say = Callable[[str], None]

EVALUATION = files.Result("an evaluation of a policy")
FIELD = ("gap_closing", "long_following")
VARIANTS = {  # name: (parameter, value, scene): a truck other than the one trained for
    "payload_light": ("mass", 10e3, "moving"),
    "payload_heavy": ("mass", 36e3, "moving"),
    "wet_road": ("tyre_friction", 0.4, "stop"),
}
LEADERS = ("human", "acc")  # recorded ones
PLATOON = ("acc", "cacc")  # baselines that drive platoons too


def evaluate(
    policy: str | Policy,
    simulator: str | Simulator,
    out: str | Path,
    *,
    rollouts: int = 100,
    seed: int = 1000,
    shield: bool = False,
    full: bool = False,
    baselines: Iterable[str] = tuple(LAWS),
    draw: bool = True,
    overwrite: bool = False,
    say: Say = lambda step: None,
) -> dict[str, Any]:
    """Drive a policy and write `out`/metrics.json, figures and a page; the metrics are returned as well.

    Always: the paper's set, a leader of varying speed on hills and the two field runs, by the policy and by
    the baselines (on a pedal map of this simulator). `full` adds the scenes of hard_scenes.HARD, heavier and
    lighter trucks if the simulator has a mass, recorded leaders if the data are present, and platoons.
    `shield` puts the guard after policy and baselines, with assumptions measured on the simulator. `draw`
    False omits figures and page; `say` is called with each step. `out` is written completely or not at all,
    and an older evaluation is replaced only with `overwrite`. Raises InputError for an `out` that cannot be
    written, and for a policy of another truck or time step.
    """
    apart(Path(out), *(Path(x.removeprefix("planner:")) for x in (policy, simulator) if isinstance(x, str)))
    truck = simulators.load(simulator) if isinstance(simulator, str) else simulator
    driver = load_policy(policy, truck.interface) if isinstance(policy, str) else policy
    if abs(driver.dt - truck.dt) > 1e-9:
        raise InputError(f"the policy acts every {driver.dt:g} s, the simulator steps by {truck.dt:g} s")
    with EVALUATION.replacing(Path(out), overwrite=overwrite) as draft:
        pedals = PedalMap.calibrate(truck)
        laws = {name: baseline(name, truck.interface, pedals, truck.dt) for name in baselines}
        drivers: dict[str, Policy] = {"policy": driver, **laws}
        if shield:
            assumed = truck_limits.measure(truck)
            drivers = {name: guards.guard(one, assumed) for name, one in drivers.items()}
        cases = dict(_cases(truck, rollouts, seed, full))
        # What a heavier truck could have reached is asked of its own pedals.
        own = {name: pedals if on is truck else PedalMap.calibrate(on) for name, (on, _) in cases.items()}
        traces: dict[str, Trace] = {}
        rows: dict[str, dict[str, Any]] = {}
        for who, one in drivers.items():
            rows[who] = {}
            for name, (on, scene) in cases.items():
                say(f"driving {name}, {who}")
                trace = roll_out(on, _bridged(one, scene), scene)
                rows[who][name] = _row(name, trace, own[name])
                traces.setdefault(name, trace)  # of the policy, the first
        results: dict[str, Any] = {
            "schema": 1,
            "policy": policy if isinstance(policy, str) else type(policy).__name__,
            "simulator": simulator if isinstance(simulator, str) else type(simulator).__name__,
            "seed": seed,
            "shield": shield,
            "sets": rows.pop("policy"),
            "baselines": rows,
        }
        if full:
            say("driving platoons")
            results["platoon"] = {
                "policy, V2V": platoon.string_stability(truck, drivers["policy"]),
                "policy, radar": platoon.string_stability(truck, drivers["policy"], v2v=False),
                **{law: platoon.string_stability(truck, drivers[law]) for law in PLATOON if law in drivers},
            }
        (draft / "metrics.json").write_text(json.dumps(results, indent=1) + "\n")
        if draw:
            _draw(results, traces, truck, policy, draft)
            (draft / "evaluation.html").write_text(page(results, draft), encoding="utf-8")
    return results


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
        with suppress(InputError):  # the recordings are not part of the project
            yield f"recorded_{name}", (truck, recorded(recorded_leaders(name), 2.0))


def _scene(name: str, rollouts: int, seed: int, dt: float) -> Scene:
    draw, seconds = HARD[name]
    return draw(np.random.default_rng(seed), rollouts, round(seconds / dt), dt)


def _bridged(driver: Policy, scene: Scene) -> Policy:
    """The driver; behind a radar with errors with a guard, since tracker and hand-over come with every such
    scene."""
    blind = scene.seen is not None or scene.seen_gap_offset is not None
    return guards.guard(driver, shield=False) if blind and not isinstance(driver, guards.Guard) else driver


def _row(name: str, trace: Trace, pedals: PedalMap) -> dict[str, Any]:
    row = metrics.summary(trace, metrics.within_reach(trace.scene, pedals, trace.dt))
    if name == "gap_closing":
        for label, bounds in (("paper", (0.35, 0.2)), ("reach", (0.1, 0.1))):
            times = metrics.settling_time(trace, *bounds)
            for key, time in (("", times.max()), ("_median", np.median(times))):
                row[f"closed_s_{label}_bounds{key}"] = round(float(time), 3) if np.isfinite(time) else None
    return row


def _draw(
    results: dict[str, Any],
    traces: dict[str, Trace],
    truck: Simulator,
    policy: str | Policy,
    out: Path,
) -> None:
    """The figures of an evaluation, and the learning curve of a policy that was trained."""
    from deeptruck_cacc.evaluation import figures

    for name, trace in traces.items():
        if name in FIELD:
            figures.field_run(trace, out / f"{name}.png", truck.interface)
        else:
            figures.error_bands(trace, out / f"{name}.png")
    if "platoon" in results:
        figures.amplification(results["platoon"], out / "string_stability.png")
    folder = Path(policy) if isinstance(policy, str) else Path()
    curves = [folder / "learning_curve.jsonl", *sorted(folder.glob("seeds/*/learning_curve.jsonl"))]
    runs = [
        [json.loads(line) for line in curve.read_text().splitlines()]
        for curve in curves
        if isinstance(policy, str) and curve.exists()
    ]
    if runs and all(runs):
        figures.learning_curve(runs, out / "learning_curve.png")
