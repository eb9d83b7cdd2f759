"""Adapters of the environment for Gymnasium, one pair of trucks, and Stable-Baselines3, a batch of them.

Importing this module registers `deeptruck/Cacc-v0`. Actions are in [-1, 1]^2 (see ActionScale) and
observations are the features of FeatureMap, clipped to +-REACH.
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from deeptruck_cacc.controllers.scaling import FeatureMap, paper_signals
from deeptruck_cacc.environments import scenes
from deeptruck_cacc.environments.environment import PATH, CaccEnv
from deeptruck_cacc.environments.registration import register
from deeptruck_cacc.environments.reward import Reward
from deeptruck_core.errors import InputError
from deeptruck_model import simulators
from deeptruck_model.simulators import Simulator

REACH = 50.0
Floats = NDArray[np.float32]


class _Face:
    """Common part of the adapters: a batched environment, its feature map and the spaces of one member."""

    def _open(
        self,
        simulator: Simulator | str,
        batch: int,
        steps: int,
        scene: str,
        reward: Reward | None,
        memory: bool,
        seed: int,
    ) -> None:
        if scene not in scenes.DRAWERS:
            raise InputError(f"there is no scene '{scene}'; known: {', '.join(scenes.DRAWERS)}")
        truck = simulators.load(simulator) if isinstance(simulator, str) else simulator
        self.cacc = CaccEnv(truck, batch, steps, scenes.DRAWERS[scene], reward or Reward(), seed)
        self.features = FeatureMap.default(memory=memory, dt=truck.dt)
        width = len(self.features.names)
        self.one_observation = gymnasium.spaces.Box(-REACH, REACH, (width,), np.float32)
        self.one_action = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)

    def _start(self, seed: int | None) -> Floats:
        observation = self.cacc.reset(seed=seed)
        self._memory = self.features.start(self.cacc.batch)
        return self._see(observation)

    def _see(self, observation: dict[str, Any]) -> Floats:
        features, self._memory = self.features(paper_signals(observation), self._memory)
        return np.clip(features, -REACH, REACH).astype(np.float32)

    def _act(self, action: NDArray[Any]) -> tuple[Floats, NDArray[np.float64], dict[str, Any]]:
        commands = self.cacc.scale.commands(np.asarray(action, float))
        observation, reward, info = self.cacc.step(commands)
        return self._see(observation), reward, info


class CaccGymEnv(_Face, gymnasium.Env):
    """`deeptruck/Cacc-v0`: one pair of trucks. `simulator` is a path for simulators.load or a Simulator."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012

    def __init__(
        self,
        simulator: Simulator | str = "truck:trucksim",
        *,
        steps: int = PATH,
        scene: str = "paper",
        reward: Reward | None = None,
        memory: bool = False,
        render_mode: str | None = None,
    ) -> None:
        self._open(simulator, 1, steps, scene, reward, memory, 0)
        self.observation_space, self.action_space = self.one_observation, self.one_action
        self.render_mode = render_mode

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Start a path; with a seed, it and all following paths are reproducible."""
        super().reset(seed=seed)
        return self._start(int(self.np_random.integers(2**31)))[0], {}

    def step(self, action: NDArray[Any]) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Advance by one dt. A crash is reported in info and reduces the reward; the path is truncated after
        `steps`."""
        seen, reward, info = self._act(np.asarray(action)[None])
        return seen[0], float(reward[0]), False, self.cacc.done, {name: v[0] for name, v in info.items()}


class CaccSb3VecEnv(_Face, VecEnv):
    """The batch as a Stable-Baselines3 VecEnv; the dicts of its members are filled at the end of a path."""

    def __init__(
        self,
        simulator: Simulator | str = "truck:trucksim",
        num_envs: int = 25,
        *,
        steps: int = PATH,
        scene: str = "paper",
        reward: Reward | None = None,
        memory: bool = False,
        seed: int = 0,
    ) -> None:
        self._open(simulator, num_envs, steps, scene, reward, memory, seed)
        self._return = np.zeros(num_envs)
        self._empty: list[dict[str, Any]] = [{} for _ in range(num_envs)]
        VecEnv.__init__(self, num_envs, self.one_observation, self.one_action)

    def reset(self) -> Floats:
        """Start a path in every member; a seed set by `seed` is used once."""
        seed = self._seeds[0] if self._seeds else None
        self._reset_seeds()
        self._return[:] = 0.0
        return self._start(seed)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Store the actions for step_wait."""
        self._actions = actions

    def step_wait(self) -> tuple[Floats, NDArray[Any], NDArray[np.bool_], list[dict[str, Any]]]:
        """One dt of every member."""
        seen, reward, _ = self._act(self._actions)
        self._return += reward
        done = np.full(self.num_envs, self.cacc.done)
        if not self.cacc.done:
            return seen, reward.astype(np.float32), done, self._empty
        infos = [
            {
                "terminal_observation": s,
                "TimeLimit.truncated": True,
                "episode": {"r": r, "l": self.cacc.steps, "t": 0.0},
            }
            for s, r in zip(seen, self._return.tolist(), strict=True)
        ]
        self._return = np.zeros(self.num_envs)
        return self._start(None), reward.astype(np.float32), done, infos

    def close(self) -> None:
        """Does nothing; the environment has no open resources."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """The attribute, repeated for each index."""
        value = getattr(self, attr_name, None)
        return [value for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set the attribute for the whole batch."""
        setattr(self, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call the method once on the batch."""
        result = getattr(self, method_name)(*args, **kwargs)
        return [result for _ in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """False for every member."""
        return [False for _ in self._get_indices(indices)]


register()
