"""The environment drives an outside simulator by its name, and a training knows it by its content."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from deeptruck_cacc.environments.adapters import CaccGymEnv
from deeptruck_cacc.training.identity import simulator_hash


def test_the_environment_drives_it(shuttle: Path) -> None:
    env = CaccGymEnv(f"python:{shuttle.stem}:make")
    env.reset(seed=0)
    for _ in range(3):
        observation, reward, *_ = env.step(np.array([0.5, -1.0], np.float32))
    assert np.isfinite(observation).all() and np.isfinite(reward)


def test_a_changed_module_is_another_simulator(shuttle: Path) -> None:
    text = f"python:{shuttle.stem}:make"
    before = simulator_hash(text)
    assert simulator_hash(text) == before
    shuttle.write_text(shuttle.read_text() + "\n# a remark\n")
    assert simulator_hash(text) != before
