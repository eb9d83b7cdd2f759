"""The planner on a deep truck: CPU time of a step, and how well it drives the truck itself in hard scenes.

python benchmarks/bench_planner.py [--work runs/following/trucksim] [--batch 20] [--truck trucksim]

The simulator and the policy in --work are those of bench_following.py. With --truck nothing is timed: planner
and chosen policy drive that truck with radar noise, in a platoon and with the shield.
"""

from __future__ import annotations

import time
from pathlib import Path

import bench_radar_noise
import harness
import numpy as np

from deeptruck_cacc import load_policy
from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.controllers.planner import Planner
from deeptruck_cacc.controllers.policy import Policy
from deeptruck_cacc.controllers.scaling import ActionScale
from deeptruck_cacc.environments import scenes
from deeptruck_cacc.environments.hard_scenes import HARD, settled
from deeptruck_cacc.environments.rollouts import roll_out
from deeptruck_cacc.evaluation import metrics, platoon
from deeptruck_cacc.safety import truck_limits
from deeptruck_cacc.safety.guard import guard
from deeptruck_model import simulators, trucks
from deeptruck_model.simulators import Simulator

STEPS = 600
AMPLITUDES = (0.2, 0.5, 1.0)  # m/s, of the first leader's sine
FREQUENCIES = platoon.FREQUENCIES[::3]  # Hz; a third of them, for the planner's time
DANGEROUS = ("stop", "cut_in", "cut_out", "moving")
ROLLOUTS = 8  # of a scene
SEED = 1000  # of the scenes, those of bench_following.py


class Timed(Planner):
    """A planner that records the CPU seconds of each step."""

    def __init__(self, simulator: Simulator) -> None:
        super().__init__(simulator)
        self.seconds: list[float] = []

    def act(self, observation):  # type: ignore[no-untyped-def]
        """The planner's commands."""
        began = time.process_time()
        commands = super().act(observation)
        self.seconds.append(time.process_time() - began)
        return commands


def milliseconds(simulator: Simulator, batch: int) -> tuple[float, float]:
    """Median and 99 % quantile of the time of a step behind moving leaders on hills, ms per truck of the
    batch."""
    scene = scenes.moving(np.random.default_rng(0), batch, STEPS, simulator.dt)
    driver = Timed(simulator)
    roll_out(simulator, driver, scene)
    each = 1e3 * np.array(driver.seconds[10:]) / batch  # the first steps compile
    return float(np.median(each)), float(np.quantile(each, 0.99))


def through_noise(truck: Simulator, drivers: dict[str, Policy]) -> list[str]:
    """Pedals behind steady leaders and errors behind moving ones, by the noise of the radar."""
    steady = settled(ROLLOUTS, 800, np.random.default_rng(SEED).uniform(12.0, 22.0, ROLLOUTS), 2.0)
    moving = scenes.moving(np.random.default_rng(SEED), ROLLOUTS, 800, truck.dt)
    reach = metrics.within_reach(moving, PedalMap.calibrate(truck), truck.dt)
    rows = []
    for name, driver in drivers.items():
        for noise in bench_radar_noise.NOISE[:2]:
            quiet, busy = (
                roll_out(truck, guard(driver, shield=False), bench_radar_noise.noisy(scene, *noise, SEED))
                for scene in (steady, moving)
            )
            pulses, jerk, _, worst = bench_radar_noise.pedals(quiet, ActionScale.of(truck))[2:]
            row = metrics.summary(busy, reach)
            rows.append(
                f"{name} | {noise[0]:g}, {noise[1]:g} | {pulses:.1f} | {jerk:.2f} | {worst:.3f} | "
                f"{row['time_gap_worst_within_reach']:.3f} | {row['rollouts_within_0.1_s']} of {ROLLOUTS}"
            )
    heads = (
        "controller | noise (m, m/s) | steady leader: brake pulses a minute | mean jerk (m/s³) | "
        "time gap, worst (s) | moving leader: worst (s) | scenes within 0.1 s"
    )
    return [*harness.table(heads, rows), ""]


def along_a_platoon(truck: Simulator, drivers: dict[str, Policy]) -> list[str]:
    """Amplification of speed changes, the largest over all frequencies, by the first leader's amplitude."""
    lines = []
    keys = {
        "worst from truck to truck": "worst_speed_amplification",
        "head to tail": "head_to_tail_speed_amplification",
    }
    for name, driver in drivers.items():
        rows = [
            platoon.string_stability(truck, driver, amplitude=a, frequencies=FREQUENCIES) for a in AMPLITUDES
        ]
        for says, key in keys.items():
            lines.append(f"{name}, {says} | {' | '.join(f'{max(row[key]):.3f}' for row in rows)}")
    heads = f"eight trucks at 1.5 s, V2V | {' | '.join(f'{a:g} m/s' for a in AMPLITUDES)}"
    return [*harness.table(heads, lines), ""]


def behind_the_shield(truck: Simulator, drivers: dict[str, Policy]) -> list[str]:
    """Crashes, smallest gap and how often the shield intervenes, by scene."""
    promise = truck_limits.measure(truck)
    rows = []
    for scene_name in DANGEROUS:
        draw, seconds = HARD[scene_name]
        scene = draw(np.random.default_rng(SEED), ROLLOUTS, round(seconds / truck.dt), truck.dt)
        for name, driver in drivers.items():
            bare, kept = (
                metrics.summary(roll_out(truck, guard(driver, promise, shield=on), scene))
                for on in (False, True)
            )
            rows.append(
                f"{scene_name.replace('_', ' ')} | {name} | {bare['crashes']} | {bare['min_gap_m']:.1f} | "
                f"{kept['crashes']} | {kept['min_gap_m']:.1f} | {100 * kept['shield_share']:.2f}"
            )
    heads = "scene | controller | crashes bare | least gap (m) | with shield | least gap (m) | acts (%)"
    return harness.table(heads, rows)


def speed(simulator: Simulator, count: int) -> list[str]:
    """The section of docs/results/speed.md."""
    found = [(batch, *milliseconds(simulator, batch)) for batch in (1, count)]
    rows = (f"{batch} | {middle:.2f} | {most:.2f}" for batch, middle, most in found)
    title = "The planner over a deep truck", ", CPU time of one thread; a default deep truck."
    table = harness.table("trucks | a step of a truck, p50 (ms) | p99 (ms)", rows)
    return [*harness.heading(*title), *table]


def hard(name: str, simulator: Simulator, policy: Path) -> list[str]:
    """The section of docs/results/following.md."""
    drivers: dict[str, Policy] = {"policy": load_policy(policy), "planner": Planner(simulator)}
    truck, sines = trucks.load(name), ", ".join(f"{f:.2f}" for f in FREQUENCIES)
    return [
        *harness.heading(f"The planner on {name} in noise, in a platoon and behind the shield"),
        f"Planner and chosen policy on the truck itself, {ROLLOUTS} rollouts a scene. Steady leaders: time",
        "gap 2 s, after 20 s. Moving leader: on hills, where power suffices, after 10 s.",
        f"The platoon's leader drives sines of {sines} Hz; the worst of them counts.",
        "",
        *through_noise(truck, drivers),
        *along_a_platoon(truck, drivers),
        *behind_the_shield(truck, drivers),
    ]


def main() -> None:
    """Print the tables and write their sections of docs/results/speed.md or following.md."""
    work, truck = Path("runs/following/trucksim"), ("", "drive this truck instead of timing a step")
    args = harness.options(__doc__, {"--work": work, "--batch": 20, "--truck": truck})
    simulator = simulators.load(str(args.work / "simulator"))
    if args.truck:
        harness.store("following", hard(args.truck, simulator, args.work / "policy"))
    else:
        harness.store("speed", speed(simulator, args.batch))


if __name__ == "__main__":
    main()
