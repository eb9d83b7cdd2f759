"""One evaluation: drive, measure, draw, write metrics.json."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_cacc import guard as guards
from deeptruck_cacc import truck_limits
from deeptruck_cacc.baselines import LAWS, baseline
from deeptruck_cacc.evaluation import figures, metrics, platoon
from deeptruck_cacc.hard_scenes import HARD, recorded, recorded_leaders
from deeptruck_cacc.pedals import PedalMap
from deeptruck_cacc.policy import Policy, load_policy
from deeptruck_cacc.rollouts import Trace, roll_out
from deeptruck_cacc.scenes import Scene
from deeptruck_model import simulators
from deeptruck_model.errors import InputError
from deeptruck_model.simulators import Simulator

FIELD = ("gap_closing", "long_following")
VARIANTS = {  # name: (parameter, value, scene): a truck other than the one trained for
    "payload_light": ("mass", 10e3, "moving"),
    "payload_heavy": ("mass", 36e3, "moving"),
    "wet_road": ("tyre_friction", 0.4, "stop"),
}


def evaluate(
    policy: str | Policy,
    simulator: str | Simulator,
    out: str | Path,
    *,
    rollouts: int = 100,
    seed: int = 1000,
    shield: bool = False,
    full: bool = False,
) -> dict[str, Any]:
    """Drive a policy and write `out`/metrics.json and figures; the metrics are returned as well.

    Always: the paper's set, a moving leader on hills, and the two field runs. `full` adds the scenes of
    hard_scenes.HARD, heavier and lighter trucks where the simulator has a mass, recorded leaders where the
    data is present, every baseline (on a pedal map calibrated on this simulator) and platoons. `shield`
    puts the guard in between, with a promise measured on the simulator. Raises InputError for an `out` that
    is a file.
    """
    out = Path(out)
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; give a folder for the figures")
    truck = simulators.load(simulator) if isinstance(simulator, str) else simulator
    driver = load_policy(policy, truck.interface) if isinstance(policy, str) else policy
    if abs(driver.dt - truck.dt) > 1e-9:
        raise InputError(f"the policy acts every {driver.dt:g} s, the simulator steps by {truck.dt:g} s")
    if shield:
        driver = guards.guard(driver, truck_limits.measure(truck))
    sets = {name: _drive(driver, *case) for name, case in _cases(truck, rollouts, seed, full)}
    for name, trace in sets.items():
        _draw(name, trace, out)
    results: dict[str, Any] = {
        "schema": 1,
        "policy": str(policy) if isinstance(policy, str) else type(policy).__name__,
        "simulator": str(simulator) if isinstance(simulator, str) else type(simulator).__name__,
        "seed": seed,
        "shield": shield,
        "sets": {name: _row(name, trace) for name, trace in sets.items()},
    }
    if full:
        results["baselines"] = _baselines(truck, rollouts, seed)
        results["platoon"] = _platoons(truck, driver, out)
    out.mkdir(parents=True, exist_ok=True)
    draft = out / ".metrics.json"
    draft.write_text(json.dumps(results, indent=1) + "\n")
    draft.replace(out / "metrics.json")
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
    for name in ("human", "acc"):
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


def _row(name: str, trace: Trace) -> dict[str, Any]:
    row = metrics.summary(trace)
    if name == "gap_closing":
        for label, bounds in (("paper", (0.35, 0.2)), ("reach", (0.1, 0.1))):
            times = metrics.settling_time(trace, *bounds)
            row[f"closed_s_{label}_bounds"] = float(times.max()) if np.isfinite(times.max()) else None
    return row


def _draw(name: str, trace: Trace, out: Path) -> None:
    if name in FIELD:
        figures.field_run(trace, name.replace("_", " "), out / f"{name}.png")
    else:
        figures.error_bands(trace, f"{name}: {trace.scene.batch} rollouts", out / f"{name}.png")


def _baselines(truck: Simulator, rollouts: int, seed: int) -> dict[str, Any]:
    pedals = PedalMap.calibrate(truck)
    return {
        law: {
            name: metrics.summary(
                _drive(
                    baseline(law, truck.interface, pedals, truck.dt),
                    truck,
                    _scene(name, rollouts, seed, truck.dt),
                )
            )
            for name in ("paper", "moving", "stop")
        }
        for law in LAWS
    }


def _platoons(truck: Simulator, driver: Policy, out: Path) -> dict[str, Any]:
    rows = {
        f"policy, {'V2V' if v2v else 'radar'}": platoon.string_stability(truck, driver, v2v=v2v)
        for v2v in (True, False)
    }
    pedals = PedalMap.calibrate(truck)
    for law in ("acc", "cacc"):
        rows[law] = platoon.string_stability(truck, baseline(law, truck.interface, pedals, truck.dt))
    figures.amplification(rows, out / "string_stability.png")
    return rows


def table(results: dict[str, Any]) -> Any:
    """The metrics as a rich table."""
    from rich.table import Table

    view = Table(title=f"{results['policy']} on {results['simulator']}")
    heads = (
        "scene",
        "time gap s",
        "worst",
        "speed m/s",
        "worst",
        "crashes",
        "min gap",
        "jerk rms",
        "l/100 km",
    )
    for head in (*heads, "shield %"):
        view.add_column(head, justify="left" if head == "scene" else "right")
    rows = dict(results["sets"])
    for law, sets in results.get("baselines", {}).items():
        rows |= {f"{law}: {name}": row for name, row in sets.items()}
    for name, row in rows.items():
        gap, speed, fuel = (
            row["time_gap_error_after_10s"],
            row["speed_error_after_25s"],
            row["fuel_l_per_100km"],
        )
        cells = [f"{gap['mean']:+.3f}", f"{gap['worst_abs']:.3f}", f"{speed['mean']:+.3f}"]
        cells += [f"{speed['worst_abs']:.3f}", str(row["crashes"]), f"{row['min_gap_m']:.1f}"]
        cells += [
            f"{row['jerk_rms']:.2f}",
            "-" if fuel is None else f"{fuel:.1f}",
            f"{100 * row['shield_share']:.1f}",
        ]
        view.add_row(name, *cells)
    return view
