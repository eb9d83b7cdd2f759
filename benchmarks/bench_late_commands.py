"""What training for a bus is worth: policies of scene `wide` and of `late`, with commands up to 0.2 s late.

python benchmarks/bench_late_commands.py [--work runs/late_commands] [--trucks trucksim]

Policies are trained on the truck itself. What is done in --work is kept.
"""

from __future__ import annotations

from pathlib import Path

import bench_gentle_braking
import harness
import numpy as np
from bench_gentle_braking import COLUMNS, LATE_S, delayed
from bench_radar_noise import TRUCKS
from numpy.typing import NDArray

from deeptruck_cacc import load_policy, training
from deeptruck_cacc.environments import hard_scenes, scenes
from deeptruck_cacc.environments.rollouts import roll_out
from deeptruck_cacc.environments.scenes import Scene
from deeptruck_cacc.evaluation.platoon import string_stability
from deeptruck_cacc.safety.guard import guard
from deeptruck_cacc.training.settings import AnalyticConfig
from deeptruck_model import trucks
from deeptruck_model.simulators import Simulator

TRAINED = ("wide", "late")
FOLLOWED = ("paper", "moving")  # scenes whose figures must not be paid with
HARD = ("stop", "cut_in", "cut_out", "radar_jump")  # scenes in which the shield must keep its promise
SAYS = """Three seeds of each training on the truck itself. Scene `late` is `wide`, the default, with commands
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
    """Print the tables and write them to a section of docs/results/braking.md."""
    work, seed = Path("runs/late_commands"), (1000, "of scenes and noise")
    args = harness.options(__doc__, {"--work": work, "--trucks": list(TRUCKS), "--seed": seed})
    lines = [*harness.heading("Commands that come late"), SAYS]
    for name in args.trucks:
        truck, policies = trucks.load(name), {}
        for scene in TRAINED:
            policies[scene] = learn(truck, name, scene, args.work / name / scene)
        lines += ["", f"## {name}", "", *pulses(truck, policies, args.seed)]
        lines += ["", PRICE, "", *price(truck, policies, args.seed)]
        lines += ["", STRING, "", *string(truck, policies)]
        lines += ["", CRASHES.format(count=3 * 25 * len(HARD)), "", *crashes(truck, policies, args.seed)]
    harness.store("braking", lines)


def learn(truck: Simulator, name: str, scene: str, policy: Path) -> list[Path]:
    """The folders of three seeds trained in a scene, unless they are there."""
    if not (policy / "policy.json").exists():
        config, source = AnalyticConfig(scene=scene), f"truck:{name}"
        training.train(truck, policy, config=config, source=source, resume=training.begun(policy))
    return sorted(bench_gentle_braking.seeds(policy))


def pulses(truck: Simulator, policies: dict[str, list[Path]], seed: int) -> list[str]:
    """As bench_gentle_braking.COLUMNS has it, for each training and delay."""
    lines = []
    for scene, folders in policies.items():
        rows = bench_gentle_braking.rows(truck, folders, seed)
        lines += [f"`{scene}` | {late:g} | {cells}" for late, cells in zip(LATE_S, rows, strict=True)]
    return harness.table(f"trained in | late (s) | {' | '.join(COLUMNS)}", lines)


def price(truck: Simulator, policies: dict[str, list[Path]], seed: int) -> list[str]:
    """The time-gap error of each training in FOLLOWED, by delay."""
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
    """What grows along a platoon of each training."""
    lines = []
    for trained, folders in policies.items():
        row = string_stability(truck, load_policy(folders[0]))
        worst = (max(row[f"worst_{name}_amplification"]) for name in ("speed", "gap_error"))
        lines.append(f"`{trained}` | {' | '.join(f'{value:.3f}' for value in worst)}")
    return harness.table("trained in | speed | gap error", lines)


def crashes(truck: Simulator, policies: dict[str, list[Path]], seed: int) -> list[str]:
    """Crashes in HARD with the shield, by delay."""
    lines = []
    for trained, folders in policies.items():
        counts = [sum(crashed(truck, folder, late, seed) for folder in folders) for late in LATE_S]
        lines.append(f"`{trained}` | {' | '.join(map(str, counts))}")
    return harness.table("trained in | " + " | ".join(f"{late:g} s late" for late in LATE_S), lines)


def worst_time_gap(truck: Simulator, folder: Path, scene: Scene) -> NDArray[np.float64]:
    """Of each row after 10 s, (batch,)."""
    error = roll_out(truck, load_policy(folder), scene)["time_gap_error"]
    return np.asarray(np.abs(error[round(10.0 / truck.dt) :]).max(axis=0))


def crashed(truck: Simulator, folder: Path, late: float, seed: int) -> int:
    """Rows of HARD, 25 of each, that crash behind the shield."""
    total = 0
    for name in HARD:
        draw, seconds = hard_scenes.HARD[name]
        scene = draw(np.random.default_rng(seed), 25, round(seconds / truck.dt), truck.dt)
        trace = roll_out(truck, guard(load_policy(folder)), delayed(scene, late, truck.dt))
        total += int(trace["crash"].any(axis=0).sum())
    return total


if __name__ == "__main__":
    main()
