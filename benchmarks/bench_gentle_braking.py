"""Does the brake pulse behind a leader that slows gently? Ten seeds of each truck, on the truck itself.

python benchmarks/bench_gentle_braking.py [--work runs/following] [--trucks trucksim]

The policies are those of bench_following.py.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bench_following
import harness
import numpy as np
from bench_radar_noise import NOISE, TRUCKS, beginnings, noisy
from numpy.typing import NDArray

from deeptruck_cacc import load_policy
from deeptruck_cacc.controllers.scaling import ActionScale
from deeptruck_cacc.environments.hard_scenes import settled
from deeptruck_cacc.environments.rollouts import Trace, roll_out
from deeptruck_cacc.environments.scenes import Scene
from deeptruck_cacc.safety.guard import guard
from deeptruck_model import trucks
from deeptruck_model.simulators import Simulator

Array = NDArray[np.float64]

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
SAYS = """Ten seeds of each truck on the truck itself, mean and in brackets the worst of them. 32 leaders of
17 to 23 m/s slow by 5 m/s at 0.4 to 0.8 m/s² and later pick up half of it. The time gap is 2 s, the noise
that of the leader node's radar, and a minute of each run is judged. One brake pulse a minute is what it
takes. A pulse begins where the brake leaves 1 % of its reach, a throttle peak where the engine passes 80 %
within 2 s of braking. Commands reach the truck *late*: a bus and its controllers take time that no policy
saw in training."""


def main() -> None:
    """Print the tables and write them to a section of docs/results/braking.md."""
    seed = (1000, "of scenes and noise")
    work = bench_following.WORK
    args = harness.options(__doc__, {"--work": work, "--trucks": list(TRUCKS), "--seed": seed})
    lines = [*harness.heading("Behind a leader that slows gently"), SAYS]
    for name in args.trucks:
        bench_following.learn(name, 10, args.work / name)
        policy = args.work / name / "policy"
        lines += ["", f"## {name}", "", *table(trucks.load(name), policy, args.seed)]
    harness.store("braking", lines)


def table(truck: Simulator, policy: Path, seed: int) -> list[str]:
    """As COLUMNS has it, for each delay."""
    found = zip(LATE_S, rows(truck, sorted(seeds(policy)), seed), strict=True)
    return harness.table(f"late (s) | {' | '.join(COLUMNS)}", (f"{late:g} | {row}" for late, row in found))


def rows(truck: Simulator, folders: list[Path], seed: int) -> list[str]:
    """Mean and worst of the policies in `folders` as COLUMNS has it, a row for each delay."""
    found = []
    for late in LATE_S:
        each = [pedals(drive(truck, folder, late, seed), truck) for folder in folders]
        cells = [
            f"{np.mean(column):{kind}} ({max(column):{kind}})"
            for column, kind in zip(zip(*each, strict=True), COLUMNS.values(), strict=True)
        ]
        found.append(" | ".join(cells))
    return found


def seeds(path: Path) -> list[Path]:
    """The folders of all seeds of a policy."""
    return list((path / "seeds").iterdir())


def drive(truck: Simulator, policy: Path, late_s: float, seed: int) -> Trace:
    """A policy behind the leaders that slow, its commands late."""
    scene = delayed(noisy(slowing(seed, truck.dt), *NOISE[1], seed), late_s, truck.dt)
    return roll_out(truck, guard(load_policy(policy), shield=False), scene)


def delayed(scene: Scene, late_s: float, dt: float) -> Scene:
    """The scene with all commands so late."""
    return replace(scene, command_delay=np.full(scene.batch, round(late_s / dt)))


def slowing(seed: int, dt: float) -> Scene:
    """32 leaders that slow by 5 m/s at 0.4 to 0.8 m/s2 from 10 s on, and pick up half of it from 35 s on."""
    rng, time = np.random.default_rng(seed), dt * np.arange(round(RUN_S / dt))
    speed, rate = rng.uniform(17.0, 23.0, 32), rng.uniform(0.4, 0.8, (32, 1))
    slows = (time >= 10.0) & (time < 10.0 + 5.0 / rate)
    picks_up = (time >= 35.0) & (time < 35.0 + 2.5 / rate)
    scene = settled(32, len(time), speed, 2.0)
    return replace(scene, leader_acceleration=rate * (1.0 * picks_up - 1.0 * slows))


def pedals(trace: Trace, truck: Simulator) -> list[float]:
    """The numbers of COLUMNS."""
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


if __name__ == "__main__":
    main()
