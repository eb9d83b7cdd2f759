"""The shield as a Gymnasium wrapper with the interface of a control barrier function filter."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from deeptruck_cacc.environments.adapters import CaccGymEnv
from deeptruck_cacc.safety.assumptions import Assumptions
from deeptruck_cacc.safety.shield import Shield
from deeptruck_cacc.safety.truck_limits import known
from deeptruck_core.errors import InputError

Floats = NDArray[np.float32]


class ShieldedEnv(gymnasium.Wrapper[Floats, NDArray[Any], Floats, NDArray[Any]]):
    """`deeptruck/Cacc-v0` behind the shield of docs/cacc_shield.md: unsafe actions are filtered instead of
    penalised.

    `info` of each step has three commands, each (2,) [engine, brake] in the interface's units:

    - `u_nom`: nominal, requested by the action,
    - `u_safe`: filtered by the shield; reward and next observation result from this one,
    - `u_applied`: the command at the truck, after the scene's command gain and delay;

    and `shield_acted` (u_safe is not u_nom) and `shield_braking` (only full braking is safe).

    The assumptions are the given ones, else those measured for a truck of this name, else the cautious
    default.
    Raises InputError for an environment that is not CaccGymEnv, and for a truck without a brake command.
    """

    def __init__(self, env: gymnasium.Env[Floats, NDArray[Any]], assumed: Assumptions | None = None) -> None:
        super().__init__(env)
        inner = env.unwrapped
        if not isinstance(inner, CaccGymEnv):
            raise InputError(f"{type(inner).__name__} is not deeptruck/Cacc-v0, which ShieldedEnv wraps")
        self._cacc = inner.cacc
        interface = self._cacc.simulator.interface
        if interface.brake_unit is None:
            raise InputError(f"{interface.name} has no brake command, and a shield brakes")
        assumed = replace(assumed or known(interface) or Assumptions(), dt=self._cacc.dt)
        self._shield = Shield(assumed, self._cacc.scale.engine_low, self._cacc.scale.brake_high)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Start a path with cold brakes."""
        self._shield.reset()
        return self.env.reset(seed=seed, options=options)

    def step(self, action: NDArray[Any]) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """One dt under the filtered action."""
        scale, seen = self._cacc.scale, self._cacc.observe()
        nominal = scale.commands(np.asarray(action, float)[None])
        safe = np.column_stack(
            self._shield.filter(seen["gap"], seen["leader_speed"], seen["speed"], *nominal.T)
        )
        observation, reward, terminated, truncated, info = self.env.step(scale.actions(safe)[0])
        info |= {
            "u_nom": nominal[0],
            "u_safe": safe[0],
            "u_applied": self._cacc.applied[0],
            "shield_acted": bool(self._shield.acted[0]),
            "shield_braking": bool(self._shield.braking[0]),
        }
        return observation, float(reward), terminated, truncated, info
