"""The paper's environment of two trucks on a road, for a whole batch and any Simulator."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from deeptruck_cacc.controllers.scaling import ActionScale
from deeptruck_cacc.environments import scenes
from deeptruck_cacc.environments.reward import Reward
from deeptruck_cacc.environments.scenes import Drawer, Scene
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.signals import ACCELERATION, FUEL, SPEED
from deeptruck_model.simulators import Simulator

PATH = 800  # steps of a path in the paper


@dataclass
class CaccEnv:
    """The paper's CACC environment, batched, in physical units.

    p_leader += v_leader dt, v_leader += a_leader dt, p_ego += v_ego dt, v_ego = f_DT,v(u, w | state): Euler
    steps as printed. Only the gap matters, so positions are not stored. A crash costs alpha_crash at every
    step and does not end the path, as in the paper; all paths of a batch end together after `steps`.
    """

    simulator: Simulator
    batch: int = 1
    steps: int = PATH
    draw: Drawer = scenes.paper
    reward: Reward = field(default_factory=Reward)
    seed: int = 0

    def __post_init__(self) -> None:
        if self.batch < 1 or self.steps < 1:
            raise InputError("an environment needs a batch and a path length of at least 1")
        self.scale = ActionScale.of(self.simulator)
        self.dt = self.simulator.dt
        self._rng = np.random.default_rng(self.seed)
        self._n_u = len(self.simulator.interface.u)
        self._fuel = self.simulator.interface.fuel
        self._has_grade = bool(self.simulator.interface.w)

    def reset(self, scene: Scene | None = None, *, seed: int | None = None) -> dict[str, Array]:
        """Start a path on `scene`, or on a random one, and return the first observation."""
        if seed is not None:
            self._rng = np.random.default_rng(seed)
        self.scene = self.draw(self._rng, self.batch, self.steps, self.dt) if scene is None else scene
        self.batch, self.steps = self.scene.batch, self.scene.steps
        self.k = 0
        self.leader_speed, self.speed, self.gap = (
            np.array(x, float) for x in (self.scene.leader_speed, self.scene.speed, self.scene.gap)
        )
        self.acceleration = np.zeros(self.batch)
        self.applied = np.zeros((self.batch, 2))  # commands that reached the trucks in the last step
        self._sent: list[Array] = []
        y0 = np.zeros((self.batch, len(self.simulator.interface.y)))
        y0[:, SPEED] = self.speed
        self._state = self.simulator.reset(y0)
        self._jump()
        return self.observe()

    @property
    def done(self) -> bool:
        """Whether the paths of the batch have ended."""
        return self.k >= self.steps

    @property
    def time_gap_error(self) -> Array:
        """gap / v - Tg, s, (batch,), with v of at least 1 m/s."""
        return self.gap / np.maximum(self.speed, 1.0) - self.scene.time_gap

    def observe(self) -> dict[str, Array]:
        """The controller's present observation, each (batch,): the paper's signals through the
        scene's radar."""
        scene, k = self.scene, min(self.k, self.steps - 1)
        gap, leader_speed = self.gap, self.leader_speed
        if scene.seen_gap_offset is not None:
            gap = gap + scene.seen_gap_offset[:, k]
        if scene.seen_speed_offset is not None:
            leader_speed = leader_speed + scene.seen_speed_offset[:, k]
        if scene.seen is not None:
            gap = np.where(scene.seen[:, k], gap, np.nan)
            leader_speed = np.where(scene.seen[:, k], leader_speed, np.nan)
        return {
            "leader_speed": leader_speed,
            "speed": self.speed,
            "gap": gap,
            "target_time_gap": scene.time_gap,
            "grade": scene.grade[:, k] if self._has_grade else np.zeros(self.batch),
        }

    def step(self, commands: Array) -> tuple[dict[str, Array], Array, dict[str, Array]]:
        """One step under commands (batch, 2) in the interface's units: observation, reward (batch,), info.

        info, each (batch,): acceleration, jerk, fuel (cm^3/s, NaN if the truck does not measure it), gap, ttc
        (s, inf when not closing), time_gap_error (s), speed_error (m/s), crash. The reward is computed after
        the step, so that it includes the effect of the action.
        """
        y = self._advance(commands)
        jerk = (y[:, ACCELERATION] - self.acceleration) / self.dt
        self.acceleration = y[:, ACCELERATION]
        self._jump()
        info = self._info(y, jerk)
        gap_error = self.gap - self.speed * self.scene.time_gap
        engine = commands[:, 0] / self.scale.engine_high
        brake = commands[:, 1] / max(self.scale.brake_high, 1e-12)
        return self.observe(), self.reward(self.gap, gap_error, info["speed_error"], engine, brake), info

    def _advance(self, commands: Array) -> Array:
        """Kinematics of both trucks over one dt; returns y of the ego truck."""
        scene, k = self.scene, min(self.k, self.steps - 1)
        grade = (
            scene.grade[:, k] if scene.hidden_grade is None else scene.grade[:, k] + scene.hidden_grade[:, k]
        )
        w = grade[:, None] if self._has_grade else np.zeros((self.batch, 0))
        if scene.command_gain is not None:
            commands = self.scale.within(commands * scene.command_gain)
        if scene.command_delay is not None:
            commands = self._arrived(commands, scene.command_delay)
        self.applied = commands
        self._state, y = self.simulator.step(self._state, commands[:, : self._n_u], w)
        self.gap = self.gap + (self.leader_speed - self.speed) * self.dt
        self.leader_speed = np.maximum(self.leader_speed + scene.leader_acceleration[:, k] * self.dt, 0.0)
        self.speed = y[:, SPEED]
        self.k += 1
        return y

    def _arrived(self, commands: Array, delay: NDArray[np.int64]) -> Array:
        """The delayed commands that reach each truck now; the first command counts as given since before the
        start."""
        self._sent = [*self._sent, commands][-1 - int(delay.max()) :]
        oldest = np.maximum(len(self._sent) - 1 - delay, 0)
        return np.stack(self._sent)[oldest, np.arange(self.batch)]

    def _jump(self) -> None:
        if self.k >= self.steps:
            return
        if self.scene.gap_jump is not None:
            self.gap = self.gap + self.scene.gap_jump[:, self.k]
        if self.scene.leader_speed_jump is not None:
            self.leader_speed = np.maximum(self.leader_speed + self.scene.leader_speed_jump[:, self.k], 0.0)

    def _info(self, y: Array, jerk: Array) -> dict[str, Array]:
        closing = self.speed - self.leader_speed
        with np.errstate(divide="ignore", invalid="ignore"):
            ttc = np.where(closing > 0, self.gap / closing, np.inf)
        return {
            "acceleration": self.acceleration,
            "jerk": jerk,
            "fuel": y[:, FUEL] if self._fuel else np.full(self.batch, np.nan),
            "gap": self.gap,
            "ttc": ttc,
            "time_gap_error": self.time_gap_error,
            "speed_error": self.leader_speed - self.speed,
            "crash": self.gap <= self.reward.d_safety,
        }
