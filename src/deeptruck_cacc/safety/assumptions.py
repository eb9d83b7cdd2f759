"""What is assumed of leader, truck and radar, and the gap that follows from it (docs/cacc_shield.md)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.constants import ROUNDED_GRAVITY

# An object that is no longer seen goes on braking as it was seen to for `GOES_ON_S` and then keeps its
# speed: it may have left the lane. One that braked by more than `EMERGENCY`, harder than for most exits,
# goes on to a standstill.
GOES_ON_S = 2.0  # s; ours
EMERGENCY = 2.4  # m/s^2; ours


@dataclass(frozen=True)
class Assumptions:
    """What is assumed of the leader, the truck and the radar; under it the gap never falls below `d_safety`.

    Once the brake is fully commanded at speed v, the truck's speed stays below
    v + a(v) * min(t, response_s) - braking(heat) * (t - response_s), on the steepest road meant.
    """

    d_safety: float = 2.0  # m
    leader_braking: float = 6.0  # m/s^2, the hardest the leader brakes
    track_s: float = 0.5  # s, time constant with which its braking is taken from its speed
    braking: float = 4.2  # m/s^2, the least the truck brakes when cold, by the full brake command
    limit_share: float = 1.0  # of that command that reaches the brakes: a vehicle's bridge may limit it
    response_s: float = 0.6  # s, until it does
    max_acceleration: float = 2.2  # m/s^2, the most it accelerates, whatever is commanded
    power_per_mass: float = 24.0  # W/kg; a(v) = min(max_acceleration, power_per_mass / v)
    fade_from: float = 400.0  # J/kg in the brakes from which they fade
    fade_per_heat: float = 2.5e-4  # share of braking lost for each J/kg beyond
    least_braking_share: float = 0.4  # of `braking`, however hot
    stop_heat: float = 1.2  # heat of a stop as a share of v^2/2: above 1 by the slope it may stand on
    strongest_braking: float = 7.5  # m/s^2: the fastest the brakes can heat, which the tyres limit
    bite: float = 0.0  # share of the brake command up to which the brakes give nothing on the level
    brake_gain: float = 7.5  # m/s^2 for each share beyond, the most they give
    # Brakes that keep a deceleration give more on a descent:
    descent_share: float = 0.0  # of the command, for each unit of descent
    steepest: float = 0.03  # descent that is meant where the slope is not known
    grade_error: float = 0.01  # of a slope that is: the pitch of a truck that brakes
    release_s: float = 0.3  # s, time constant of their release: FMVSS 121 S5.3.4, 5 psi within 0.55 s
    # They cool by 1.23 + 0.0256 V an hour, V in mile/h: Myers, Ashkenas and Johnson (1980), FHWA-RD-79-116
    cooling_at_rest: float = 3.4e-4  # 1/s
    cooling_by_speed: float = 1.6e-5  # 1/m, for each m/s
    gap_error: float = 0.3  # m, radar
    speed_error: float = 0.1  # m/s, radar and wheels
    dt: float = 0.1  # s between calls
    soft_m: float = 1.5  # m before the limit where the engine is cut and the brake comes in gently
    soft_s: float = 0.3  # s, time constant of that distance, so that a radar's noise does not brake
    closing: float = 0.5  # m/s, by which the truck may be faster than its leader in ordinary following
    ease_m: float = (
        10.0  # m before the limit where, behind a leader that is not seen, `mild_braking` comes in
    )
    ease_s: float = 0.5  # s, in which the engine is then taken back, and given back whatever took it
    mild_braking: float = 0.6  # m/s^2, as which the truck then slows down on the level
    mild_brake: float = 0.08  # share of the brake command by which it does
    # The room before the limit may shrink to `soft_m` with this time constant; with 4 and 6 s the truck
    # braked harder behind random leaders.
    yield_s: float = 9.0  # s
    yielding: float = 1.5  # m/s^2, the hardest braking that this asks for, and that any policy may ask for
    firm: float = 3.0  # m/s^2, the hardest that it asks for behind an object that brakes
    pressed_above: float = 0.3  # m/s^2, from which it asks the brakes for it,
    released_below: float = 0.06  # and down to which, once pressed
    learns_s: float = 2.0  # s, over which it learns what the truck brakes less than it asks,
    most_short: float = 0.8  # m/s^2, and at most: a descent of 8 %
    harder: float = 1.3  # times what stopping behind an object needs a policy may ask for too
    jerk: float = 3.0  # m/s^3, by which the braking of a policy changes
    bridged_s: float = 3.0  # s, for which a steady leader may vanish without more than `mild_braking`,
    bridged_time_gap: float = 2.8  # s, from this time gap on (5 to 29 m/s)

    def braking_when(self, heat: Array, gain: Array | float = 1.0) -> Array:
        """Least deceleration (m/s^2) with `heat` J/kg in the brakes, which give `gain` of what is promised;
        at most the leader's."""
        lost = self.fade_per_heat * np.maximum(heat - self.fade_from, 0.0)
        share = np.maximum(1.0 - lost, self.least_braking_share) * gain * self.limit_share
        return np.asarray(np.minimum(self.braking * share, self.leader_braking))

    def share_of(self, deceleration: Array | float) -> Array:
        """Share of the brake command that gives at most a deceleration, m/s^2, on the level without drag."""
        return np.asarray(self.bite + deceleration / self.brake_gain)

    @property
    def emergency(self) -> float:
        """The bound of a braking, m/s^2, which errors of two readings are in, that is taken to go on."""
        return EMERGENCY + 2 * self.speed_error / self.track_s

    @property
    def slope_pull(self) -> float:
        """What a unit of slope adds to the deceleration by the brakes, m/s^2: less than gravity where they
        keep a deceleration."""
        return max(ROUNDED_GRAVITY - self.descent_share * self.brake_gain, 0.0)

    def least_braking(self, share: Array, heat: Array) -> Array:
        """Least deceleration (m/s^2) on the level by a share of the brake command: the line from
        `mild_braking` at `mild_brake` to the full one, which brakes that saturate lie above; 0 below."""
        full = self.braking_when(heat) + self.slope_pull * self.steepest
        beyond = (np.minimum(share, self.limit_share) - self.mild_brake) / (
            self.limit_share - self.mild_brake
        )
        line = self.mild_braking + beyond * (full - self.mild_braking)
        return np.asarray(np.where(beyond > 0.0, line, 0.0))

    def heat_after(self, heat: Array, pressed: Array, speed: Array) -> Array:
        """Most heat (J/kg) one step later, with a share `pressed` of the brake command in the brakes."""
        gained = np.minimum(self.brake_gain * np.maximum(pressed - self.bite, 0.0), self.strongest_braking)
        lost = self.cooling_at_rest + self.cooling_by_speed * speed
        return np.asarray(heat + self.dt * (gained * speed - lost * heat))

    def acceleration_at(self, speed: Array) -> Array:
        """Largest acceleration of the truck at a speed, m/s^2."""
        return np.asarray(np.minimum(self.max_acceleration, self.power_per_mass / np.maximum(speed, 0.1)))

    def needed_gap(
        self, speed: Array, leader_speed: Array, heat: Array, wait_s: float, gain: Array | float = 1.0
    ) -> Array:
        """Smallest gap (m) from which full braking begun after `wait_s` keeps d_safety (docs, eq. 4), with
        brakes that give `gain` of what is promised."""
        reach = wait_s + self.response_s
        rise = self.acceleration_at(speed)
        peak = speed + rise * reach
        hot = heat + self.stop_heat * 0.5 * peak**2
        braking = self.braking_when(hot, gain)
        travelled = speed * reach + 0.5 * rise * reach**2 + peak**2 / (2 * braking)
        sampling = 0.5 * peak * self.dt + 0.5 * braking * self.dt**2
        left = leader_speed**2 / (2 * self.leader_braking)
        return self.d_safety + np.maximum(travelled + sampling - left, 0.0)
