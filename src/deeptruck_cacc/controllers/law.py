"""Following laws: requested acceleration from signals of leader and truck."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from deeptruck_cacc.controllers.policy import Observation
from deeptruck_cacc.controllers.scaling import ACCELERATION_UNIT, FeatureMap, observed
from deeptruck_core.arrays import Array

LEADER_S = 2.0  # time constant with which the leader's acceleration is expected to die away
LEAST_SPEED = 0.5  # m/s, as which less counts in a time gap, which nothing defines at standstill
LEAST_GAP_M = 5.0  # which predictive controllers keep wherever the pedals allow


@dataclass(frozen=True)
class Seen:
    """Inputs of a following law, each (batch,), SI; `integral` is the integral of the clipped gap
    error, m s."""

    leader_speed: Array
    speed: Array
    gap: Array
    target_gap: Array
    leader_acceleration: Array
    acceleration: Array
    integral: Array

    @property
    def gap_error(self) -> Array:
        """gap - v Tg, m."""
        return self.gap - self.target_gap

    @property
    def time_gap(self) -> Array:
        """The set time gap, s."""
        return np.asarray(self.target_gap / np.maximum(self.speed, LEAST_SPEED))

    def leader(self, time: Array) -> tuple[Array, Array]:
        """Predicted speed (m/s) and distance (m) of the leader after `time` (n,), s; each (batch, n)."""
        speed, pull = self.leader_speed[:, None], self.leader_acceleration[:, None]
        gone = LEADER_S * (1 - np.exp(-time / LEADER_S))
        distance = np.maximum(speed * time + pull * LEADER_S * (time - gone), 0.0)
        return np.maximum(speed + pull * gone, 0.0), np.maximum.accumulate(distance, axis=1)


Law = Callable[[Seen], Array]


@dataclass
class Perception:
    """Computes the inputs of a law from observations `dt` (s) apart; it stores past samples to estimate
    rates."""

    dt: float
    _memory: Array | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        self._features = FeatureMap.default(dt=self.dt)

    @property
    def slow_s(self) -> float:
        """Time constant of the estimated accelerations, s."""
        return self._features.slow_s

    def reset(self) -> None:
        """Forget the past."""
        self._memory = None

    def __call__(self, observation: Observation) -> tuple[Seen, Array]:
        """The inputs of a law and the grade, each (batch,)."""
        signals = observed(observation)
        signals[:, 3] *= np.maximum(signals[:, 1], LEAST_SPEED)  # else a truck that stands wants no gap
        if self._memory is None or len(self._memory) != len(signals):
            self._memory = self._features.start(len(signals))
        features, self._memory = self._features(signals, self._memory)
        accelerations = ("leader_acceleration", "acceleration")
        rates = features[:, [self._features.names.index(n) for n in accelerations]] * ACCELERATION_UNIT
        leader_speed, speed, gap, target_gap, grade = signals.T
        seen = Seen(leader_speed, speed, gap, target_gap, rates[:, 0], rates[:, 1], self._memory[:, 0])
        return seen, grade
