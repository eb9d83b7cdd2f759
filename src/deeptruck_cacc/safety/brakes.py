"""What the truck's own brakes give: its deceleration against that of the command."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from deeptruck_cacc.safety.assumptions import Assumptions
from deeptruck_core.arrays import Array


@dataclass
class Brakes:
    """Learns the `gain` of the brakes (batch,), the share of the promised deceleration that they give, and
    limits how fast a policy presses them.

    The least command of the response time and the `rate_s` after it, by the least that is assumed of
    it, is held against the deceleration of those `rate_s`. The slope counts
    in their favour by its error, or by the steepest that is meant where it is not known. Where they give
    less than `fails_below` for `lasts_s` without a break, they have failed.
    """

    assumed: Assumptions
    rate_s: float = 0.4
    least: float = 1.0  # m/s^2, below which a command says nothing of the brakes
    moving: float = 2.0  # m/s
    falls_s: float = 0.2  # time constants
    rises_s: float = 2.0
    least_gain: float = 0.2  # as which less counts
    fails_below: float = 0.6
    lasts_s: float = 0.5
    gain: Array = field(default_factory=lambda: np.zeros(0))
    failed_s: Array = field(default_factory=lambda: np.zeros(0))
    _shares: Array = field(default_factory=lambda: np.zeros((0, 0)), repr=False)  # sent, the newest last
    _speeds: Array = field(default_factory=lambda: np.zeros((0, 0)), repr=False)
    _policy: Array = field(default_factory=lambda: np.zeros(0), repr=False)  # share it pressed last

    def reset(self) -> None:
        """Brakes that give what is promised."""
        self._begin(0)

    def _begin(self, batch: int) -> None:
        self.gain, self.failed_s, self._policy = np.ones(batch), np.zeros(batch), np.zeros(batch)
        self._shares = np.zeros((round((self.assumed.response_s + self.rate_s) / self.assumed.dt) + 1, batch))
        self._speeds = np.full((round(self.rate_s / self.assumed.dt) + 1, batch), np.nan)

    def gain_of(self, batch: int) -> Array:
        """The gain, 1 for a batch that was not seen yet."""
        return self.gain if len(self.gain) == batch else np.ones(batch)

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Where they give less than they must, (batch,)."""
        return np.asarray(self.failed_s > self.lasts_s - 1e-9)

    def spare(self) -> None:
        """The last command was not obeyed, so that nothing is to be learned from it."""
        self._shares, self._policy = np.zeros_like(self._shares), np.zeros_like(self._policy)

    def sent(self, share: Array) -> None:
        """Note the share of the brake command that was sent, (batch,)."""
        self._shares = np.concatenate([self._shares[1:], share[None]])

    def slewed(self, share: Array, most: Array) -> Array:
        """The share that a policy asks for, at most `most` and changing by the promised jerk, (batch,)."""
        step = self.assumed.jerk * self.assumed.dt / self.assumed.brake_gain
        bite = self.assumed.bite  # up to there brakes give nothing
        wanted = np.minimum(share, most)
        reached = np.clip(wanted, self._policy - step, np.maximum(self._policy, bite) + step)
        reached = np.where((wanted <= bite) & (self._policy <= bite + step), wanted, reached)
        self._policy = np.nan_to_num(reached)
        return np.where(np.isfinite(share), self._policy, share)

    def see(self, speed: Array, grade: Array, heat: Array) -> None:
        """Judge the brakes by the truck's speed (m/s), slope and heat in the brakes (J/kg), each (batch,)."""
        p = self.assumed
        if len(self.gain) != len(speed):
            self._begin(len(speed))
        self._speeds = np.concatenate([self._speeds[1:], speed[None]])
        slowing = (self._speeds[0] - speed) / ((len(self._speeds) - 1) * p.dt)
        downhill = np.where(np.isfinite(grade), p.grade_error - grade, p.steepest)
        promised = p.least_braking(self._shares.min(axis=0), heat)
        ratio = (slowing + p.slope_pull * downhill) / np.maximum(promised, self.least)
        repeats = (self._speeds == speed).all(axis=0)  # the speed is frozen, whatever the brakes give
        judged = (promised >= self.least) & (speed > self.moving) & np.isfinite(ratio) & ~repeats
        ratio = np.clip(ratio, self.least_gain, 1.0)
        time = np.where(ratio < self.gain, self.falls_s, self.rises_s)
        self.gain = np.where(
            judged, self.gain + np.minimum(p.dt / time, 1.0) * (ratio - self.gain), self.gain
        )
        low = np.where(ratio < self.fails_below, self.failed_s + p.dt, 0.0)
        self.failed_s = np.where(judged, low, self.failed_s)
