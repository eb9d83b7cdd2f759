"""Rollouts: a policy on a simulator in a scene, with all signals recorded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deeptruck_cacc.controllers.policy import Policy
from deeptruck_cacc.environments.environment import CaccEnv
from deeptruck_cacc.environments.scenes import Scene
from deeptruck_core.arrays import Array
from deeptruck_model.simulators import Simulator


@dataclass(frozen=True)
class Trace:
    """Signals of a batch of rollouts, each (T, batch), sampled after each step."""

    dt: float
    scene: Scene
    signals: dict[str, Array]

    def __getitem__(self, name: str) -> Array:
        return self.signals[name]

    @property
    def time(self) -> Array:
        """Seconds since the start, (T,)."""
        return np.arange(1.0, len(self["gap"]) + 1, dtype=float) * self.dt


def roll_out(simulator: Simulator, policy: Policy, scene: Scene) -> Trace:
    """Drive `policy` through `scene` from a reset and record all signals.

    Signals: everything in the environment's info, and speed, leader_speed, engine_command, brake_command,
    reward, acted (1 where a guard overrode the policy, 0 for a bare policy).
    """
    env = CaccEnv(simulator, scene.batch, scene.steps)
    seen = env.reset(scene)
    policy.reset()
    rows: dict[str, list[Array]] = {}
    while not env.done:
        commands = np.column_stack(policy.act(seen))
        seen, paid, info = env.step(commands)
        acted = np.asarray(getattr(policy, "acted", np.zeros(scene.batch)), float)
        info = {**info, "speed": env.speed, "leader_speed": env.leader_speed, "reward": paid, "acted": acted}
        info |= {"engine_command": commands[:, 0], "brake_command": commands[:, 1]}
        for name, values in info.items():
            rows.setdefault(name, []).append(np.asarray(values, float))
    return Trace(env.dt, scene, {name: np.array(values) for name, values in rows.items()})
