"""What every training writes: learning curves while it runs, and the policies of all seeds at its end."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_cacc.controllers.policy import MlpPolicy
from deeptruck_cacc.environments.reward import Reward
from deeptruck_cacc.training.settings import Config, TrpoConfig
from deeptruck_core.terminal.progress import board
from deeptruck_model.deep.card import git_hash
from deeptruck_model.outside.reference import is_outside, refer


class Log:
    """Writes TensorBoard scalars to `out`/tensorboard and the same numbers to learning_curve.jsonl."""

    def __init__(self, out: Path) -> None:
        out.mkdir(parents=True, exist_ok=True)
        self._board = board(out / "tensorboard", 0)
        self._path = out / "learning_curve.jsonl"

    def write(self, iteration: int, values: dict[str, Any]) -> None:
        """Write one line and one point of each value; for lists (one value per seed) the mean is charted."""
        with self._path.open("a") as file:
            file.write(json.dumps({"iteration": iteration, **values}) + "\n")
        for name, value in values.items():
            self._board.add_scalar(name, float(np.mean(value)), iteration)

    def close(self) -> None:
        """Flush TensorBoard, whose thread would otherwise write after the folder of a failed run is gone."""
        self._board.close()


def save(
    out: Path, policies: list[MlpPolicy], scores: list[float], config: Config, reward: Reward, source: str
) -> None:
    """Write each seed's policy to `out`/seeds/K, and the one with the least validation score to `out`.

    Their cards say how they were trained; `source` names the simulator.
    """
    card = {
        "trainer": "trpo" if isinstance(config, TrpoConfig) else "analytic",
        "config": asdict(config),
        "simulator": source,
        "simulator_sha256": simulator_sha256(source),
        "reward": {name: x if np.isfinite(x) else None for name, x in asdict(reward).items()},
        "git": git_hash() or "unknown",
    }
    for k, (policy, score) in enumerate(zip(policies, scores, strict=True)):
        validation = {"scenes": "paper and moving, fresh", "score": score}
        policy.card = {**card, "seed": config.seed + k, "validation": validation}
        policy.write(out / "seeds" / str(config.seed + k))
    policies[int(np.argmin(scores))].write(out)


def simulator_sha256(simulator: str) -> str:
    """SHA-256 over the files of a simulator directory or an outside simulator, or over the name of a physics
    truck."""
    digest = hashlib.sha256()
    if is_outside(simulator):
        digest.update(json.dumps(refer(simulator).to_dict()).encode())
    elif simulator and Path(simulator).is_dir():
        for file in sorted(p for p in Path(simulator).iterdir() if p.is_file()):
            digest.update(file.name.encode() + file.read_bytes())
    else:
        digest.update(simulator.encode())
    return digest.hexdigest()
