"""Search for violations of the shield's promise by 100,000 random rollouts and an adversary; and the cost of
the shield on the truck.

python benchmarks/bench_shield.py [--policy POLICY] [--simulator truck:trucksim] [--rollouts 100000]
"""

from __future__ import annotations

import harness
import numpy as np

from deeptruck_cacc import load_policy
from deeptruck_cacc.environments import hard_scenes
from deeptruck_cacc.environments.rollouts import roll_out
from deeptruck_cacc.evaluation.metrics import summary
from deeptruck_cacc.safety import proof, truck_limits
from deeptruck_cacc.safety.assumptions import Assumptions
from deeptruck_cacc.safety.guard import guard
from deeptruck_cacc.safety.shield import Shield
from deeptruck_model import simulators
from deeptruck_model.simulators import Simulator

SAYS = """In `long_following` the radar sees another vehicle for 2 s, 30 m farther. The shield does not
accept it as the leader, so the truck slows down by about 0.6 m/s and regains it; without the shield it
drives on."""
SCENES = ("paper", "moving", "gap_closing", "long_following", "stop", "cut_in", "dropout", "descent")


def main() -> None:
    """Print the tables and write them to their section of docs/results/shield.md."""
    args = harness.options(
        __doc__, {"--policy": "baseline:cacc", "--simulator": "truck:trucksim", "--rollouts": 100_000}
    )
    truck = simulators.load(args.simulator)
    assumed = truck_limits.measure(truck)
    facts = ", ".join(f"{name} {value:.4g}" for name, value in vars(assumed).items())
    lines = [
        *harness.heading("Search for violations"),
        f"Assumptions measured on {args.simulator}: `{facts}`",
        "",
    ]
    lines += [*search(assumed, args.rollouts), "", *bridged(assumed), "", *cost(args.policy, truck, assumed)]
    lines += ["", *SAYS.splitlines()]
    harness.store("shield", lines)


def search(assumed: Assumptions, rollouts: int) -> list[str]:
    """Table of the searches for a violation."""
    found = {
        "random": proof.random_search(assumed, rollouts),
        "adversarial": proof.adversarial_search(assumed, generations=max(rollouts // 2500, 1)),
        "random, shield off": proof.random_search(assumed, 2000, shielded=False),
    }
    return harness.table(
        "search | rollouts | violations | least gap - d_safety (m) | steps overridden | "
        "braked before need (m)",
        (
            f"{name} | {o.rollouts} | {o.violations} | {o.least_margin_m:.3f} | {100 * o.acted_share:.1f} %"
            f" | {o.earliest_m:.1f}"
            for name, o in found.items()
        ),
    )


def bridged(assumed: Assumptions) -> list[str]:
    """Table of the smallest gap if a leader of 20 m/s, at a time gap of 2 s, is not detected for a while and
    brakes.

    The truck keeps its speed until the shield brakes, and then decelerates as promised. Nothing is promised
    for a leader that brakes harder than (5).
    """
    rows = []
    for braking in (0.0, 1.0, 2.0, 3.0, 6.0):
        ends = [_vanishes(assumed, braking, seconds) for seconds in (1.0, 2.0, 3.0)]
        rows.append(f"{braking:g} m/s² | " + " | ".join(ends))
    heads = "for 1 s | 2 s | 3 s"
    return harness.table(f"a leader that begins to brake when it vanishes, by | {heads}", rows)


def _vanishes(p: Assumptions, braking: float, seconds: float) -> str:
    """Smallest gap, or the speed of the impact; and the hardest braking before the leader was
    detected again."""
    shield, own, leader, gap, pressed = Shield(p, 0.0, 1.0), 20.0, 20.0, 40.0, 0.0
    least, hardest = gap, 0.0
    for k in range(-20, round(20.0 / p.dt)):
        lost = 0 < k * p.dt <= seconds
        seen = (np.array([np.nan if lost else value]) for value in (gap, leader))
        _, (brake,) = shield.filter(*seen, np.array([own]), np.array([0.5]), np.zeros(1))
        pressed = pressed + p.dt if brake >= 1.0 else 0.0
        rate = -brake * p.braking if brake < 1.0 or pressed > p.response_s else 0.0
        hardest = max(hardest, -rate) if lost else hardest
        before, own = own, max(own + p.dt * rate, 0.0)
        leader, last = max(leader - p.dt * braking * (k >= 0), 0.0), leader
        gap += p.dt * (last + leader - before - own) / 2
        least = min(least, gap)
        if gap <= 0.0:
            return f"hit at {own - leader:.1f} m/s"
    return f"{least:.1f} m left, braked by {hardest:.1f} m/s² unseen"


def cost(path: str, truck: Simulator, assumed: Assumptions) -> list[str]:
    """Table of the cost of the shield to a policy: 100 rollouts of each scene with and without it."""
    rows = []
    for name in SCENES:
        draw, seconds = hard_scenes.HARD[name]
        scene = draw(np.random.default_rng(7), 100, round(seconds / truck.dt), truck.dt)
        policy = load_policy(path, truck.interface)
        on, off = (summary(roll_out(truck, guard(policy, assumed, shield=s), scene)) for s in (True, False))
        gaps = [row["time_gap_error_after_10s"]["worst_abs"] for row in (on, off)]
        share = f"{100 * on['shield_share']:.3f} %"
        crashes = f"{on['crashes']} | {off['crashes']}"
        rows.append(f"{name} | {share} | {crashes} | {gaps[0]:.3f} | {gaps[1]:.3f}")
    heads = "overridden | crashes | crashes, off | worst time gap (s) | worst time gap, off"
    return harness.table(f"`{path}` | {heads}", rows)


if __name__ == "__main__":
    main()
