"""CPU time of a step of the planner on a simulator: one truck, and a batch.

python benchmarks/bench_planner.py [--simulator runs/following/trucksim/simulator] [--batch 20]

The default is the deep truck that bench_following.py made.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
import pages

from deeptruck_cacc.controllers.planner import Planner
from deeptruck_cacc.environments import scenes
from deeptruck_cacc.environments.rollouts import roll_out
from deeptruck_model import simulators
from deeptruck_model.simulators import Simulator

STEPS = 600


class Timed(Planner):
    """A planner that keeps the CPU seconds of each step."""

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
    """Median and 99 % quantile of a step behind moving leaders on hills, for each truck of the batch."""
    scene = scenes.moving(np.random.default_rng(0), batch, STEPS, simulator.dt)
    driver = Timed(simulator)
    roll_out(simulator, driver, scene)
    each = 1e3 * np.array(driver.seconds[10:]) / batch  # the first steps compile
    return float(np.median(each)), float(np.quantile(each, 0.99))


def main() -> None:
    """Print the table and write its section of docs/results/speed.md."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--simulator", default="runs/following/trucksim/simulator")
    parser.add_argument("--batch", type=int, default=20)
    args = parser.parse_args()
    truck = simulators.load(args.simulator)
    lines = ["# The planner over a deep truck", ""]
    lines += ["`python benchmarks/bench_planner.py`, CPU time of one thread; a default deep truck.", ""]
    lines += ["| trucks | a step of a truck, p50 (ms) | p99 (ms) |", "|---|---|---|"]
    for batch in (1, args.batch):
        middle, most = milliseconds(truck, batch)
        lines.append(f"| {batch} | {middle:.2f} | {most:.2f} |")
    pages.store("speed", "\n".join(lines))
    print("\n".join(lines))


if __name__ == "__main__":
    main()
