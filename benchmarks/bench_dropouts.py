"""How hard each controller brakes each truck when its radar loses a steady leader, where no braking is
needed.

python benchmarks/bench_dropouts.py [--policies ...] [--trucks ...] [--scenes ...] [--title ...]

Truck, leader, radar and the controller's core run in one process, as the nodes of a lock-step run do: 900 s
with the start script's defaults (seed 3), 200 s with drop-outs of 6 s on average (0.03 per second), and a
leader that pulls away at 0.2 m/s^2 from 18 to 28 m/s until it is beyond the radar's range of 45 m. `{truck}`
in a policy is replaced by the truck's name. Where the controller hands back, its command fades and the truck
coasts. The first 20 s of the long runs, in which the controller settles, do not count.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import harness
import numpy as np

from deeptruck_cacc.safety.guard import load_controller
from deeptruck_model import simulators
from deeptruck_nodes import leaders
from deeptruck_nodes.following import Following
from deeptruck_nodes.observation import SECOND, Alignment
from deeptruck_nodes.plant import Plant
from deeptruck_nodes.radar import Gap, Radar, RadarErrors
from deeptruck_nodes.roads import parse as parse_road

POLICIES = ["baseline:acc", "baseline:cacc", "baseline:idm", "baseline:pi", "baseline:mpc"]  # fmt: skip
TRUCKS = ["trucksim", "freightliner", "volvo"]
FREE = -1.0  # m/s^2, the hardest braking on a free road
SETTLED_S = 20.0
NOISY = RadarErrors(range_noise=0.1, speed_noise=0.05, dropout_rate=0.05)


class Scene(NamedTuple):
    """One run of the table."""

    leader: str
    radar: RadarErrors
    seconds: float
    initial_speed: float = 20.0
    seed: int = 0


SCENES = {
    "defaults": Scene("constant:speed=20", NOISY, 900.0, seed=3),
    "6 s drop-outs": Scene("constant:speed=20", RadarErrors(dropout_rate=0.03, dropout_s=6.0), 200.0, seed=3),
    "pulls away": Scene(
        "steps:speeds=18/28,every=5,acceleration=0.2", RadarErrors(reach=45.0), 60.0, initial_speed=18.0
    ),
}


class Drive(NamedTuple):
    """The figures of one run."""

    hardest: float  # acceleration after it has settled, m/s^2
    beyond: int  # steps beyond FREE
    least_gap: float  # m
    jerk: float  # hardest in steps without a command, m/s^3; NaN where there are none
    counts: dict[str, int]


def drive(truck: str, policy: str, scene: Scene) -> Drive:
    """One run in lock-step."""
    simulator = simulators.load(f"truck:{truck}")
    plant = Plant(simulator, parse_road("flat"), scene.initial_speed)
    following = Following(load_controller(policy, simulator.interface), 2.0, 3.0)
    leader = leaders.parse(scene.leader)
    assert not isinstance(leader, leaders.Sumo)
    ahead, radar, samples = Gap(leader, 0.0, 2.0), Radar(scene.radar, scene.seed), Alignment(True, False, 0.3)
    rates, least, jerk = [0.0], math.inf, math.nan
    for k in range(round(scene.seconds / plant.dt)):
        t, stamp = k * plant.dt, round((1.0 + k * plant.dt) * SECOND)
        ahead.update(t, plant.speed)
        gap, speed = radar.sense(t, ahead.gap, ahead.leader_speed)
        samples.put("speed", stamp, plant.speed)
        samples.put("engaged", stamp, 1.0)
        samples.put("gap", stamp, gap if math.isfinite(gap) else math.nan)
        seen = samples.put("leader_speed", stamp, speed)
        assert seen is not None
        command = following.take(seen)
        plant.step(*command)
        if math.isnan(sum(command)):
            jerk = min((plant.acceleration - rates[-1]) / plant.dt, math.inf if math.isnan(jerk) else jerk)
        rates.append(plant.acceleration)
        least = min(least, ahead.gap)
    settled = np.array(rates[1 + round(SETTLED_S / plant.dt) :] if scene.seconds > 100 else rates)
    return Drive(float(settled.min()), int((settled < FREE).sum()), least, jerk, following.counts)


def main() -> None:
    """Print the tables and write them to section `--title` of docs/results/dropouts.md."""
    defaults = {"--policies": POLICIES, "--trucks": TRUCKS, "--scenes": list(SCENES), "--title": "Baselines"}
    args = harness.options(__doc__, defaults)
    lines = harness.heading(args.title)
    for name in args.scenes:
        scene = SCENES[name]
        rows = []
        for truck in args.trucks:
            for policy in (text.format(truck=truck) for text in args.policies):
                run = drive(truck, policy, scene)
                counts = " | ".join(str(run.counts[key]) for key in COUNTED)
                rows.append(
                    f"{truck} | `{policy}` | {run.hardest:.2f} | {run.beyond * 0.1:.1f} | "
                    f"{run.least_gap:.1f} | {'-' if math.isnan(run.jerk) else f'{run.jerk:.1f}'} | {counts}"
                )
        lines += [f"## {name}: `{scene.leader}`, {scene.seconds:g} s", "", *harness.table(HEADS, rows), ""]
    harness.store("dropouts", lines)


COUNTED = {
    "drop_outs": "drop-outs",
    "shield_interventions": "shield acted",
    "full_brakings": "braked fully",
}
HEADS = " | ".join(
    (
        "truck | controller | hardest (m/s²) | beyond 1 m/s² (s) | smallest gap (m)",
        "jerk without a command (m/s³)",
        *COUNTED.values(),
    )
)


if __name__ == "__main__":
    main()
