"""Steps a second of the batched environment beside the same environment in DummyVecEnv, in one run.

python benchmarks/bench_cacc.py [--simulator truck:trucksim] [--seconds 3]
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import DummyVecEnv

from deeptruck_cacc.faces import CaccGymEnv, CaccSb3VecEnv
from deeptruck_model import simulators


def rate(env: Any, seconds: float) -> float:
    """Member steps a second of an SB3 VecEnv under random actions."""
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


def main() -> None:
    """Print the table and write docs/results/bench_cacc.md."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--simulator", default="truck:trucksim")
    parser.add_argument("--seconds", type=float, default=3.0)
    args = parser.parse_args()
    truck = simulators.load(args.simulator)
    base = rate(DummyVecEnv([lambda: CaccGymEnv(truck) for _ in range(25)]), args.seconds)
    rows = {"DummyVecEnv 25": base}
    for batch in (1, 25, 250, 1000):
        rows[f"batched {batch}"] = rate(CaccSb3VecEnv(truck, batch), args.seconds)
    lines = [f"# The batched environment over {args.simulator}", "", "`python benchmarks/bench_cacc.py`", ""]
    lines += ["| environment | steps/s | times DummyVecEnv |", "|---|---|---|"]
    lines += [f"| {name} | {value:,.0f} | {value / base:.1f} |" for name, value in rows.items()]
    out = Path(__file__).parents[1] / "docs" / "results" / "bench_cacc.md"
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
