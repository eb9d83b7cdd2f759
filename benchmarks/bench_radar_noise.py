"""The influence of radar noise on the pedals: the chosen policy of each truck with and without its filter.

python benchmarks/bench_radar_noise.py [--work runs/following]

Steady leaders, time gap 2 s, and the moving leader on hills. The policies are those of bench_following.py.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bench_following
import harness
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from deeptruck_cacc import load_policy
from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.controllers.policy import MlpPolicy, Policy
from deeptruck_cacc.controllers.scaling import ActionScale
from deeptruck_cacc.environments import scenes
from deeptruck_cacc.environments.hard_scenes import recorded, recorded_leaders, settled
from deeptruck_cacc.environments.rollouts import Trace, roll_out
from deeptruck_cacc.environments.scenes import Scene
from deeptruck_cacc.evaluation import metrics
from deeptruck_cacc.safety.guard import guard
from deeptruck_model import trucks
from deeptruck_model.errors import InputError
from deeptruck_model.simulators import Simulator

TRUCKS = ("trucksim", "volvo", "freightliner")
NOISE = ((0.0, 0.0), (0.1, 0.05), (0.2, 0.1))  # m, m/s; the second is the leader node's
SETTLED_S = 20.0
SAYS = """The chosen policy of each truck on the truck itself, and the same weights without the filter.
Noise is white, standard deviations for each reading; 0.1 m and 0.05 m/s are the leader node's. Behind
steady leaders 32 runs of 80 s count, without their first 20 s. Commands are shares of their reach. Behind the
moving leader on hills it is the 100 scenes of [following](following.md), behind recorded cars
(`DEEPTRUCK_REAL_DATA`) pieces of 80 s. Both count where power suffices, after 10 s.

![both pedals behind a steady leader](radar_noise.png)"""
COLUMNS = {  # of a table: how it is written
    "engine, sd (%)": ".1f",
    "change a step (%)": ".1f",
    "brake pulses a minute": ".1f",
    "mean jerk (m/s³)": ".2f",
    "fuel (l/100 km)": ".2f",
    "time gap, worst (s)": ".3f",
}
MOVING = {
    "worst (s)": "time_gap_worst_within_reach",
    "99 % within (s)": "time_gap_p99_within_reach",
    "scenes within 0.1 s": "rollouts_within_0.1_s",
    "rms jerk (m/s³)": "jerk_rms",
    "fuel (l/100 km)": "fuel_l_per_100km",
}


def main() -> None:
    """Print the tables and write them to a section of docs/results/braking.md, with a figure."""
    seed = (1000, "of scenes and noise")
    args = harness.options(__doc__, {"--work": bench_following.WORK, "--seed": seed})
    lines = [*harness.heading("What a radar's noise does to the pedals"), SAYS, ""]
    for name in TRUCKS:
        bench_following.learn(name, 10, args.work / name)
        drivers, truck = both(args.work / name / "policy"), trucks.load(name)
        lines += [f"## {name}", "", *behind_steady_leaders(truck, drivers, args.seed), ""]
        for leader, scene in moving(args.seed, truck.dt).items():
            lines += [*behind_moving_leaders(truck, drivers, leader, scene, args.seed), ""]
    harness.store("braking", lines)
    picture = harness.RESULTS / "radar_noise.png"
    draw(trucks.load(TRUCKS[0]), both(args.work / TRUCKS[0] / "policy"), args.seed, picture)


def both(path: Path) -> dict[str, Policy]:
    """The chosen policy as it is, and with the same weights but without the filter."""
    policy = load_policy(path)
    assert isinstance(policy, MlpPolicy)
    bare = replace(policy, features=replace(policy.features, radar=None))
    return {"without the filter": bare, "with the filter": policy}


def noisy(scene: Scene, range_sd: float, speed_sd: float, seed: int) -> Scene:
    """The scene with a radar that has white noise of these standard deviations (m, m/s)."""
    rng, shape = np.random.default_rng(seed), scene.grade.shape
    gap, speed = rng.normal(0.0, 1.0, (2, *shape))
    return replace(scene, seen_gap_offset=range_sd * gap, seen_speed_offset=speed_sd * speed)


def behind_steady_leaders(truck: Simulator, drivers: dict[str, Policy], seed: int) -> list[str]:
    """The figures named in COLUMNS, for each driver and noise."""
    scene = steady(seed, truck.dt)
    lines = []
    for name, driver in drivers.items():
        for noise in NOISE:
            trace = roll_out(truck, guard(driver, shield=False), noisy(scene, *noise, seed))
            values = pedals(trace, ActionScale.of(truck))
            cells = [format(x, kind) for x, kind in zip(values, COLUMNS.values(), strict=True)]
            lines.append(f"{name} | {noise[0]:g}, {noise[1]:g} | {' | '.join(cells)}")
    return harness.table(f"behind a steady leader | noise (m, m/s) | {' | '.join(COLUMNS)}", lines)


def steady(seed: int, dt: float) -> Scene:
    """32 leaders of constant 12 to 22 m/s for 80 s, followed at the same speed with a time gap of 2 s."""
    return settled(32, round(80.0 / dt), np.random.default_rng(seed).uniform(12.0, 22.0, 32), 2.0)


def pedals(trace: Trace, scale: ActionScale) -> list[float]:
    """The figures named in COLUMNS. A pulse begins where the brake exceeds 1 % of its range."""
    late = round(SETTLED_S / trace.dt)
    engine = 100 * trace["engine_command"][late:] / scale.engine_high
    braked = trace["brake_command"][late:] > 0.01 * scale.brake_high
    minutes = braked.size * trace.dt / 60
    pulses = beginnings(braked) / minutes
    fuel = 1e5 * (trace["fuel"][late:] * 1e-3).sum() / trace["speed"][late:].sum()
    return [
        float(engine.std(axis=0).mean()),
        float(np.abs(np.diff(engine, axis=0)).mean()),
        float(pulses),
        float(np.abs(trace["jerk"][late:]).mean()),
        float(fuel),
        float(np.abs(trace["time_gap_error"][late:]).max()),
    ]


def beginnings(flags: NDArray[np.bool_]) -> int:
    """How often flags (T, batch) become true."""
    return int(np.count_nonzero(flags[1:] & ~flags[:-1]))


def moving(seed: int, dt: float) -> dict[str, Scene]:
    """The moving leader of bench_following.py, and cars recorded under ACC if the data is available."""
    found = {"a moving leader": scenes.moving(np.random.default_rng(seed), 100, 800, dt)}
    try:
        return found | {"cars under ACC": recorded(recorded_leaders("acc"), 2.0)}
    except InputError:
        return found


def behind_moving_leaders(
    truck: Simulator, drivers: dict[str, Policy], name: str, scene: Scene, seed: int
) -> list[str]:
    """The figures named in MOVING after 10 s, where the truck has enough power."""
    reach = metrics.within_reach(scene, PedalMap.calibrate(truck), truck.dt)
    lines = []
    for driver_name, driver in drivers.items():
        for noise in NOISE[:2]:
            row = metrics.summary(roll_out(truck, driver, noisy(scene, *noise, seed)), reach)
            cells = [f"{row[key]:.3g}" for key in MOVING.values()]
            lines.append(f"{driver_name} | {noise[0]:g}, {noise[1]:g} | {' | '.join(cells)}")
    heads = f"behind {name} ({scene.batch} scenes) | noise (m, m/s) | {' | '.join(MOVING)}"
    return harness.table(heads, lines)


def draw(truck: Simulator, drivers: dict[str, Policy], seed: int, path: Path) -> None:
    """Figure of both pedals over 20 s behind a steady leader, with the leader node's noise."""
    scene, scale = noisy(steady(seed, truck.dt), *NOISE[1], seed), ActionScale.of(truck)
    figure = Figure(figsize=(8, 4), layout="constrained")
    axes = figure.subplots(len(drivers), 1, sharex=True, sharey=True)
    for (name, driver), axis in zip(drivers.items(), axes, strict=True):
        trace = roll_out(truck, guard(driver, shield=False), scene)
        shown = slice(round(40.0 / trace.dt), round(60.0 / trace.dt))
        for pedal, reach in (("engine", scale.engine_high), ("brake", scale.brake_high)):
            axis.plot(trace.time[shown], 100 * trace[f"{pedal}_command"][shown, 0] / reach, label=pedal)
        axis.set_title(name, loc="left")
        axis.set_ylabel("command [% of reach]")
    axes[0].legend(ncols=2, loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False)
    axes[-1].set_xlabel("time [s]")
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
