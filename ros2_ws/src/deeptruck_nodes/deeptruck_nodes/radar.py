"""The gap between two vehicles, and a radar with noise, dropouts and jumps by lane changes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from deeptruck_cacc.environments.hard_scenes import LANE_CHANGE
from deeptruck_nodes.leaders import Leader


class Gap:
    """Integrates the gap to a leader from its speed and the follower's reported speed, by the trapezoidal
    rule."""

    def __init__(self, leader: Leader, initial: float, initial_time_gap: float) -> None:
        self._leader, self._initial, self._time_gap = leader, initial, initial_time_gap
        self._last: tuple[float, float] | None = None  # time, closing speed
        self.gap = math.nan
        self.leader_speed = math.nan

    def update(self, t: float, speed: float) -> None:
        """Advance to t seconds after the start with the follower's `speed` (m/s); at NaN the last closing
        speed is used."""
        self.leader_speed = self._leader.speed_at(t)
        opening = self.leader_speed - speed
        if self._last is None:
            if not math.isfinite(speed):
                return
            self.gap = self._initial or max(self._time_gap * speed, 5.0)
        else:
            last_t, last_opening = self._last
            opening = opening if math.isfinite(opening) else last_opening
            self.gap += (opening + last_opening) / 2 * (t - last_t)
        self._last = (t, opening)


@dataclass(frozen=True)
class RadarErrors:
    """Errors of the radar; the names are those of the leader node's parameters."""

    range_noise: float = 0.0
    speed_noise: float = 0.0
    dropout_rate: float = 0.0
    dropout_s: float = 0.3
    reach: float = 200.0
    lane_change_at_s: float = 0.0
    lane_change_s: float = LANE_CHANGE.duration_s
    lane_change_gap: float = LANE_CHANGE.gap_m
    lane_change_speed: float = LANE_CHANGE.speed
    lost_at_s: float = 0.0
    lost_for_s: float = 2.0


class Radar:
    """Adds errors to radar samples. Four random numbers are drawn per sample, so that equal seeds and samples
    give equal readings."""

    def __init__(self, errors: RadarErrors, seed: int) -> None:
        self._errors, self._rng = errors, np.random.default_rng(seed)
        self._blind_until = -math.inf
        self._last_t: float | None = None

    def sense(self, t: float, gap: float, leader_speed: float) -> tuple[float, float]:
        """Measured distance in m and leader's speed in m/s; (inf, nan) if nothing is detected."""
        e = self._errors
        noise = self._rng.standard_normal(2)
        begins, length = self._rng.random(), self._rng.exponential(e.dropout_s)
        if self._last_t is not None and begins < 1 - math.exp(-e.dropout_rate * (t - self._last_t)):
            self._blind_until = t + length
        self._last_t = t
        if e.lane_change_at_s and e.lane_change_at_s <= t < e.lane_change_at_s + e.lane_change_s:
            gap, leader_speed = gap + e.lane_change_gap, leader_speed + e.lane_change_speed
        lost = bool(e.lost_at_s) and e.lost_at_s <= t < e.lost_at_s + e.lost_for_s
        if lost or t < self._blind_until or not 0 < gap <= e.reach:
            return math.inf, math.nan
        return max(gap + e.range_noise * noise[0], 0.0), leader_speed + e.speed_noise * noise[1]
