"""Brake pulses behind a leader that slows gently, and the benefit of training with delayed commands.

python benchmarks/bench_braking.py [--work runs] [--trucks trucksim]

The ten seeds of bench_following.py, in WORK/following, drive on each truck itself; then three seeds of scene
`wide` and three of `late`, trained on the truck itself in WORK/late_commands. Finished trainings are kept
there and reused.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bench_following
import harness
import numpy as np
from bench_radar_noise import NOISE, TRUCKS, beginnings, noisy
from numpy.typing import NDArray

from deeptruck_cacc import load_policy, training
from deeptruck_cacc.controllers.scaling import ActionScale
from deeptruck_cacc.environments import hard_scenes, scenes
from deeptruck_cacc.environments.rollouts import Trace, roll_out
from deeptruck_cacc.environments.scenes import Scene
from deeptruck_cacc.evaluation.platoon import string_stability
from deeptruck_cacc.safety.guard import guard
from deeptruck_cacc.training.settings import AnalyticConfig
from deeptruck_model import trucks
from deeptruck_model.simulators import Simulator

LATE_S = (0.0, 0.1, 0.2)
SETTLED_S, RUN_S = 5.0, 65.0  # a minute is judged, in which each leader slows once
RECENT_S = 2.0
COLUMNS = {  # of the table: how it is written, and which of the seeds is the worst
    "brake pulses a minute": ".1f",
    "throttle peaks after braking a minute": ".2f",
    "hardest brake (%)": ".0f",
    "rms jerk (m/s³)": ".2f",
    "time gap, worst (s)": ".2f",
}
TRAINED = ("wide", "late")
FOLLOWED = ("paper", "moving")  # scenes whose figures must not be paid with
HARD = ("stop", "cut_in", "cut_out", "radar_jump")  # scenes in which the shield must keep its promise
GENTLE = """Ten seeds of each truck on the truck itself, mean and in brackets the worst of them. 32 leaders of
17 to 23 m/s slow by 5 m/s at 0.4 to 0.8 m/s² and later pick up half of it. The time gap is 2 s, the noise
that of the leader node's radar, and a minute of each run is judged. One brake pulse a minute is what it
takes. A pulse begins where the brake leaves 1 % of its reach, a throttle peak where the engine passes 80 %
within 2 s of braking. Commands reach the truck *late*: a bus and its controllers take time that no policy
saw in training."""
LATE = """Three seeds of each training on the truck itself. Scene `late` is `wide`, the default, with commands
that reach each truck at once, 0.1 or 0.2 s later. Mean of the seeds and in brackets the worst.

First behind the 32 leaders of [the section above](#behind-a-leader-that-slows-gently), which slow once in the
minute that is judged."""
PRICE = """What that costs in 100 runs of two other scenes: the worst time-gap error of a run after 10 s (s),
median of all seeds and in brackets the worst."""
STRING = """Eight trucks at 1.5 s behind a sine of 0.5 m/s, commands at once, first seed: the worst
amplification from truck to truck of all frequencies."""
CRASHES = """Crashes with the shield, of {count} runs of each cell: stops at 6 m/s², cut-ins, cut-outs and a
radar that looks past the leader."""


def main() -> None:
    """Print the tables and write them to two sections of docs/results/braking.md."""
    options = {"--work": Path("runs"), "--trucks": list(TRUCKS), "--seed": (1000, "of scenes and noise")}
    args = harness.options(__doc__, options)
    gentle = [*harness.heading("Behind a leader that slows gently"), GENTLE]
    late = [*harness.heading("Commands that come late"), LATE]
    for name in args.trucks:
        truck, following = trucks.load(name), args.work / "following" / name
        bench_following.learn(name, 10, following)
        found = zip(LATE_S, rows(truck, seeds(following / "policy"), args.seed), strict=True)
        lines = (f"{late_s:g} | {row}" for late_s, row in found)
        gentle += ["", f"## {name}", "", *harness.table(f"late (s) | {' | '.join(COLUMNS)}", lines)]
        home = args.work / "late_commands" / name
        policies = {scene: learn(truck, name, scene, home / scene) for scene in TRAINED}
        late += ["", f"## {name}", "", *pulses(truck, policies, args.seed)]
        late += ["", PRICE, "", *price(truck, policies, args.seed)]
        late += ["", STRING, "", *string(truck, policies)]
        late += ["", CRASHES.format(count=3 * 25 * len(HARD)), "", *crashes(truck, policies, args.seed)]
    harness.store("braking", gentle)
    harness.store("braking", late)


def rows(truck: Simulator, folders: list[Path], seed: int) -> list[str]:
    """Mean and worst value over the policies in `folders` of each of COLUMNS, one row for each delay."""
    found = []
    for late in LATE_S:
        each = [pedals(drive(truck, folder, late, seed), truck) for folder in folders]
        cells = [
            f"{np.mean(column):{kind}} ({max(column):{kind}})"
            for column, kind in zip(zip(*each, strict=True), COLUMNS.values(), strict=True)
        ]
        found.append(" | ".join(cells))
    return found


def seeds(policy: Path) -> list[Path]:
    """Folders of the seeds of a policy."""
    return sorted((policy / "seeds").iterdir())


def drive(truck: Simulator, policy: Path, late_s: float, seed: int) -> Trace:
    """Drive a policy behind decelerating leaders, with delayed commands."""
    scene = delayed(noisy(slowing(seed, truck.dt), *NOISE[1], seed), late_s, truck.dt)
    return roll_out(truck, guard(load_policy(policy), shield=False), scene)


def delayed(scene: Scene, late_s: float, dt: float) -> Scene:
    """The scene with all commands delayed by `late_s`."""
    return replace(scene, command_delay=np.full(scene.batch, round(late_s / dt)))


def slowing(seed: int, dt: float) -> Scene:
    """32 leaders that slow by 5 m/s at 0.4 to 0.8 m/s2 from 10 s on, and pick up half of it from 35 s on."""
    rng, time = np.random.default_rng(seed), dt * np.arange(round(RUN_S / dt))
    speed, rate = rng.uniform(17.0, 23.0, 32), rng.uniform(0.4, 0.8, (32, 1))
    slows = (time >= 10.0) & (time < 10.0 + 5.0 / rate)
    picks_up = (time >= 35.0) & (time < 35.0 + 2.5 / rate)
    scene = hard_scenes.settled(32, len(time), speed, 2.0)
    return replace(scene, leader_acceleration=rate * (1.0 * picks_up - 1.0 * slows))


def pedals(trace: Trace, truck: Simulator) -> list[float]:
    """The figures named in COLUMNS."""
    judged, scale = slice(round(SETTLED_S / trace.dt), None), ActionScale.of(truck)
    engine = trace["engine_command"][judged] / scale.engine_high
    brake = trace["brake_command"][judged] / scale.brake_high
    minutes = engine.size * trace.dt / 60
    peaks = (engine > 0.8) & recently(brake > 0.01, round(RECENT_S / trace.dt))
    return [
        beginnings(brake > 0.01) / minutes,
        beginnings(peaks) / minutes,
        100 * float(brake.max()),
        float(np.sqrt((trace["jerk"][judged] ** 2).mean())),
        float(np.abs(trace["time_gap_error"][judged]).max()),
    ]


def recently(flags: NDArray[np.bool_], steps: int) -> NDArray[np.bool_]:
    """Where flags (T, batch) were true in one of the last `steps` steps."""
    total = np.cumsum(np.vstack([np.zeros((steps, flags.shape[1]), int), flags]), axis=0)
    return np.asarray(total[steps:] - total[:-steps] > 0)


def learn(truck: Simulator, name: str, scene: str, policy: Path) -> list[Path]:
    """Folders of three seeds trained in a scene, which are trained if they do not exist."""
    if not (policy / "policy.json").exists():
        config, source = AnalyticConfig(scene=scene), f"truck:{name}"
        training.train(truck, policy, config=config, source=source, resume=training.begun(policy))
    return seeds(policy)


def pulses(truck: Simulator, policies: dict[str, list[Path]], seed: int) -> list[str]:
    """The figures named in COLUMNS, for each training and delay."""
    lines = []
    for scene, folders in policies.items():
        found = rows(truck, folders, seed)
        lines += [f"`{scene}` | {late:g} | {cells}" for late, cells in zip(LATE_S, found, strict=True)]
    return harness.table(f"trained in | late (s) | {' | '.join(COLUMNS)}", lines)


def price(truck: Simulator, policies: dict[str, list[Path]], seed: int) -> list[str]:
    """Time-gap error of each training in the scenes FOLLOWED, by delay."""
    names = [f"{name}, {late:g} s late" for name in FOLLOWED for late in LATE_S]
    lines = []
    for trained, folders in policies.items():
        cells = []
        for name in FOLLOWED:
            scene = scenes.DRAWERS[name](np.random.default_rng(seed), 100, 800, truck.dt)
            for late in LATE_S:
                slow = delayed(scene, late, truck.dt)
                worst = np.array([worst_time_gap(truck, folder, slow) for folder in folders])
                cells.append(f"{np.median(worst):.3f} ({worst.max():.3f})")
        lines.append(f"`{trained}` | {' | '.join(cells)}")
    return harness.table(f"trained in | {' | '.join(names)}", lines)


def string(truck: Simulator, policies: dict[str, list[Path]]) -> list[str]:
    """Amplification of speed changes along a platoon, for each training."""
    lines = []
    for trained, folders in policies.items():
        row = string_stability(truck, load_policy(folders[0]))
        worst = (max(row[f"worst_{name}_amplification"]) for name in ("speed", "gap_error"))
        lines.append(f"`{trained}` | {' | '.join(f'{value:.3f}' for value in worst)}")
    return harness.table("trained in | speed | gap error", lines)


def crashes(truck: Simulator, policies: dict[str, list[Path]], seed: int) -> list[str]:
    """Crashes in the scenes HARD with the shield, by delay."""
    lines = []
    for trained, folders in policies.items():
        counts = [sum(crashed(truck, folder, late, seed) for folder in folders) for late in LATE_S]
        lines.append(f"`{trained}` | {' | '.join(map(str, counts))}")
    return harness.table("trained in | " + " | ".join(f"{late:g} s late" for late in LATE_S), lines)


def worst_time_gap(truck: Simulator, folder: Path, scene: Scene) -> NDArray[np.float64]:
    """Largest time-gap error of each row after 10 s, (batch,)."""
    error = roll_out(truck, load_policy(folder), scene)["time_gap_error"]
    return np.asarray(np.abs(error[round(10.0 / truck.dt) :]).max(axis=0))


def crashed(truck: Simulator, folder: Path, late: float, seed: int) -> int:
    """Number of rows of HARD, 25 of each scene, that crash with the shield."""
    total = 0
    for name in HARD:
        draw, seconds = hard_scenes.HARD[name]
        scene = draw(np.random.default_rng(seed), 25, round(seconds / truck.dt), truck.dt)
        trace = roll_out(truck, guard(load_policy(folder)), delayed(scene, late, truck.dt))
        total += int(trace["crash"].any(axis=0).sum())
    return total


if __name__ == "__main__":
    main()
