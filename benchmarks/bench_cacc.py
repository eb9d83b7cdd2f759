"""Steps per second of the batched environment compared with DummyVecEnv, and the cost of ten TRPO seeds in
one batch.

python benchmarks/bench_cacc.py [--simulator truck:trucksim] [--seconds 3]
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import harness
import numpy as np
import torch
from stable_baselines3.common.vec_env import DummyVecEnv

from deeptruck_cacc.environments.adapters import CaccGymEnv, CaccSb3VecEnv
from deeptruck_cacc.training import TrpoConfig, train
from deeptruck_model import simulators
from deeptruck_model.simulators import Simulator


def rate(env: Any, seconds: float) -> float:
    """Member steps per second of an SB3 VecEnv under random actions."""
    rng = np.random.default_rng(0)
    env.reset()
    actions = rng.uniform(-1, 1, (64, env.num_envs, 2)).astype(np.float32)
    for k in range(5):
        env.step(actions[k])
    count, began = 0, time.perf_counter()
    while time.perf_counter() - began < seconds:
        env.step(actions[count % 64])
        count += 1
    return count * env.num_envs / (time.perf_counter() - began)


def seconds(truck: Simulator, config: TrpoConfig) -> float:
    """Median CPU seconds between iterations, so that other programs on the machine do not count."""
    stamps: list[float] = []
    with tempfile.TemporaryDirectory() as out:
        train(truck, Path(out) / "policy", config, progress=lambda *_: stamps.append(time.process_time()))
    return float(np.median(np.diff(stamps)))


def main() -> None:
    """Print the table and write its section of docs/results/speed.md."""
    args = harness.options(__doc__, {"--simulator": "truck:trucksim", "--seconds": 3.0, "--iterations": 8})
    torch.set_num_threads(1)
    truck = simulators.load(args.simulator)
    base = rate(DummyVecEnv([lambda: CaccGymEnv(truck) for _ in range(25)]), args.seconds)
    rates = {"DummyVecEnv 25": base}
    for batch in (1, 25, 250, 1000):
        rates[f"batched {batch}"] = rate(CaccSb3VecEnv(truck, batch), args.seconds)
    rows = [f"{name} | {value:,.0f} | {value / base:.1f}" for name, value in rates.items()]
    ten = seconds(truck, TrpoConfig(seeds=10, iterations=args.iterations))
    lines = harness.heading(f"The batched environment over {args.simulator}")
    lines += [*harness.table("environment | steps/s | times DummyVecEnv", rows), ""]
    lines += ["TRPO, batches of 20,000 steps:", ""]
    lines += harness.table("trainer | CPU s an iteration", [f"ten seeds in one batch | {ten:.2f}"])
    harness.store("speed", lines)


if __name__ == "__main__":
    main()
