"""The promise: 100,000 random rollouts and an adversarial search; and what the shield costs on the truck.

python benchmarks/bench_shield.py [--policy POLICY] [--simulator truck:trucksim] [--rollouts 100000]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from deeptruck_cacc import load_policy
from deeptruck_cacc.environments import hard_scenes
from deeptruck_cacc.environments.rollouts import roll_out
from deeptruck_cacc.evaluation.metrics import summary
from deeptruck_cacc.safety import proof, truck_limits
from deeptruck_cacc.safety.guard import guard
from deeptruck_cacc.safety.shield import Promise
from deeptruck_model import simulators
from deeptruck_model.simulators import Simulator

SCENES = ("paper", "moving", "gap_closing", "long_following", "stop", "cut_in", "dropout", "descent")


def main() -> None:
    """Print the tables and write them to docs/results/shield.md."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--policy", default="baseline:cacc")
    parser.add_argument("--simulator", default="truck:trucksim")
    parser.add_argument("--rollouts", type=int, default=100_000)
    args = parser.parse_args()
    truck = simulators.load(args.simulator)
    promise = truck_limits.measure(truck)
    lines = ["# The shield", "", f"`python benchmarks/bench_shield.py --policy {args.policy}`", ""]
    lines += [f"Promise measured on {args.simulator}: `{', '.join(_facts(promise))}`", ""]
    lines += [*search(promise, args.rollouts), "", *cost(args.policy, truck, promise)]
    out = Path(__file__).parents[1] / "docs" / "results" / "shield.md"
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


def _facts(promise: Promise) -> list[str]:
    return [f"{name} {value:.4g}" for name, value in promise.to_dict().items()]


def search(promise: Promise, rollouts: int) -> list[str]:
    """Table of the searches for a violation."""
    found = {
        "random": proof.random_search(promise, rollouts),
        "adversarial": proof.adversarial_search(promise, generations=max(rollouts // 2500, 1)),
        "random, shield off": proof.random_search(promise, 2000, shielded=False),
    }
    lines = [
        "| search | rollouts | violations | least gap - d_safety (m) | steps overridden |",
        "|---|---|---|---|---|",
    ]
    return lines + [
        f"| {name} | {o.rollouts} | {o.violations} | {o.least_margin_m:.3f} | {100 * o.acted_share:.1f} % |"
        for name, o in found.items()
    ]


def cost(path: str, truck: Simulator, promise: Promise) -> list[str]:
    """Table of what the shield costs a policy: 100 rollouts of each scene with and without it."""
    heads = ("overridden", "crashes", "crashes, off", "worst time gap (s)", "worst time gap, off")
    lines = [f"| `{path}` | {' | '.join(heads)} |", "|---" * (len(heads) + 1) + "|"]
    for name in SCENES:
        draw, seconds = hard_scenes.HARD[name]
        scene = draw(np.random.default_rng(7), 100, round(seconds / truck.dt), truck.dt)
        policy = load_policy(path, truck.interface)
        on, off = (summary(roll_out(truck, guard(policy, promise, shield=s), scene)) for s in (True, False))
        gaps = [row["time_gap_error_after_10s"]["worst_abs"] for row in (on, off)]
        share = f"{100 * on['shield_share']:.3f} %"
        crashes = f"{on['crashes']} | {off['crashes']}"
        lines.append(f"| {name} | {share} | {crashes} | {gaps[0]:.3f} | {gaps[1]:.3f} |")
    return lines


if __name__ == "__main__":
    main()
