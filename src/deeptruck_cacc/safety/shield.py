"""The shield passes commands on while the truck could still stop in time; otherwise it brakes.

Derived in docs/cacc_shield.md.

Pure: it imports numpy and the tables below, and knows neither policy nor simulator.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Promise:
    """What is assumed of the leader, the truck and the radar; under it the gap never falls below `d_safety`.

    Once the brake is fully commanded at speed v, the truck's speed stays below
    v + a(v) * min(t, response_s) - braking(heat) * (t - response_s), on the steepest road meant.
    """

    d_safety: float = 2.0  # m
    leader_braking: float = 6.0  # m/s^2, the hardest the leader brakes
    unseen_jerk: float = 0.5  # m/s^3, by which a leader that is not seen may brake harder than it was seen to
    track_s: float = 0.5  # s, time constant with which its braking is taken from its speed
    braking: float = 4.2  # m/s^2, the least the truck brakes when cold
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
    yielding: float = 1.5  # m/s^2, the hardest braking that this asks for
    bridged_s: float = 3.0  # s, for which a steady leader may vanish without more than `mild_braking`,
    bridged_time_gap: float = 2.8  # s, from this time gap on (5 to 29 m/s)

    def braking_when(self, heat: Array) -> Array:
        """Least deceleration (m/s^2) with `heat` J/kg in the brakes, at most the leader's."""
        lost = self.fade_per_heat * np.maximum(heat - self.fade_from, 0.0)
        share = np.maximum(1.0 - lost, self.least_braking_share)
        return np.asarray(np.minimum(self.braking * share, self.leader_braking))

    def heat_after(self, heat: Array, pressed: Array, speed: Array) -> Array:
        """Most heat (J/kg) one step later, with a share `pressed` of the brake command in the brakes."""
        gained = np.minimum(self.brake_gain * np.maximum(pressed - self.bite, 0.0), self.strongest_braking)
        lost = self.cooling_at_rest + self.cooling_by_speed * speed
        return np.asarray(heat + self.dt * (gained * speed - lost * heat))

    def acceleration_at(self, speed: Array) -> Array:
        """Largest acceleration of the truck at a speed, m/s^2."""
        return np.asarray(np.minimum(self.max_acceleration, self.power_per_mass / np.maximum(speed, 0.1)))

    def needed_gap(self, speed: Array, leader_speed: Array, heat: Array, wait_s: float) -> Array:
        """Smallest gap (m) from which full braking begun after `wait_s` keeps d_safety (docs, eq. 4)."""
        reach = wait_s + self.response_s
        rise = self.acceleration_at(speed)
        peak = speed + rise * reach
        braking = self.braking_when(heat + self.stop_heat * 0.5 * peak**2)
        travelled = speed * reach + 0.5 * rise * reach**2 + peak**2 / (2 * braking)
        sampling = 0.5 * peak * self.dt + 0.5 * braking * self.dt**2
        left = leader_speed**2 / (2 * self.leader_braking)
        return self.d_safety + np.maximum(travelled + sampling - left, 0.0)


class Bounds(NamedTuple):
    """Bounds of the states that are possible given the measurements, each (batch,)."""

    gap: Array  # m, the lowest
    leader: Array  # m/s, the lowest of the leader's speed
    speed: Array  # m/s, the highest of the truck's
    heat: Array  # J/kg, the highest
    slow_leader: Array  # m/s, the leader's speed when seen, through a filter of `track_s`
    leader_braking: Array  # m/s^2, the hardest that the leader brakes while it is not seen
    unseen_s: Array  # s, since it was
    eased: Array  # share of the engine command that was taken back
    pressed: Array  # share of the brake command that may still be in the brakes
    slack: Array  # m to the limit, through a filter of `soft_s`; NaN for none yet
    yielded: Array  # m/s^2, the braking that `gentle` requested last

    @classmethod
    def unknown(cls, batch: int) -> Bounds:
        """Bounds before the first measurement."""
        nothing = np.zeros(batch)
        never = np.full(batch, np.inf)
        unknown = np.full(batch, np.nan)
        fast = np.full(batch, 40.0)
        return cls(
            nothing, nothing, fast, nothing, nothing, nothing, never, nothing, nothing, unknown, nothing
        )


@dataclass
class Shield:
    """Filters commands to the truck. `acted` and `braking` (batch,) describe the last call."""

    promise: Promise
    engine_low: float
    brake_high: float
    acted: Flags = field(default_factory=lambda: np.zeros(0, bool))
    braking: Flags = field(default_factory=lambda: np.zeros(0, bool))
    _seen: Bounds | None = field(default=None, repr=False)
    # heat, J/kg, and the share in the brakes as they are without the last command
    _spared: tuple[Array, Array] = field(default_factory=lambda: (np.zeros(0), np.zeros(0)), repr=False)

    def reset(self) -> None:
        """Reset the state, with cold brakes."""
        self._seen = None

    def forget(self) -> None:
        """Reset leader and speed but keep the brake temperature; the last command was not obeyed."""
        if self._seen is not None:
            heat, pressed = self._spared
            self._seen = Bounds.unknown(len(heat))._replace(heat=heat, pressed=pressed)

    def spare(self) -> None:
        """Note that the last command was not obeyed, and so heated no brakes."""
        if self._seen is not None:
            heat, pressed = self._spared
            self._seen = self._seen._replace(heat=heat, pressed=pressed)

    def filter(
        self,
        gap: Array,
        leader_speed: Array,
        speed: Array,
        engine: Array,
        brake: Array,
        grade: Array | float = np.nan,
    ) -> tuple[Array, Array]:
        """Commands to send, each (batch,). NaN in gap, speeds or grade is 'not measured', in a command
        'no command'.

        It brakes if nothing was ever measured.
        """
        p = self.promise
        seen = self._bounds(gap, leader_speed, speed)
        slack = seen.gap - p.needed_gap(seen.speed, seen.leader, seen.heat, p.dt)
        missing = ~(np.isfinite(engine) & np.isfinite(brake))
        past = np.where(np.isfinite(seen.slack), seen.slack, slack)
        smooth = past + min(p.dt / p.soft_s, 1.0) * (slack - past)
        near = 1.0 - np.clip(np.maximum(smooth, slack) / p.soft_m, 0.0, 1.0)
        near = np.where(slack < 0, 1.0, near)
        limit = near**2 * self.brake_high
        mild = p.mild_brake * self.brake_high
        asked = np.where(missing, mild, brake)  # no command: slow down gently
        easing = (seen.unseen_s > 0) & (slack < p.ease_m)
        limit = np.maximum(limit, np.where(easing, np.minimum(2.0 - 2.0 * slack / p.ease_m, 1.0) * mild, 0.0))
        sent_brake = np.clip(np.maximum(asked, limit), 0.0, self.brake_high)
        # not a cut: a policy that follows at the limit would get its engine on and off
        eased = np.maximum(near, np.clip(seen.eased + np.where(easing, p.dt, -p.dt) / p.ease_s, 0.0, 1.0))
        left = 1.0 - eased
        throttled = self.engine_low + left * (np.maximum(engine, self.engine_low) - self.engine_low)
        sent_engine = np.where(left < 1.0, throttled, engine)
        sent_engine = np.where(missing, self.engine_low, sent_engine)
        self.braking = slack < 0
        self.acted = missing | (sent_brake > asked) | (sent_engine != engine)
        left_over = seen.pressed * np.exp(-p.dt / p.release_s)
        share = sent_brake / self.brake_high
        downhill = np.where(np.isfinite(grade), p.grade_error - grade, p.steepest)
        pressed = np.maximum(np.where(share > 0, share + p.descent_share * downhill, 0.0), left_over)
        self._spared = p.heat_after(seen.heat, left_over, seen.speed), left_over
        heat = p.heat_after(seen.heat, pressed, seen.speed)
        self._seen = seen._replace(heat=heat, eased=eased, pressed=pressed, slack=smooth)
        return sent_engine, sent_brake

    def steady_gap(self, speed: Array) -> Array:
        """Least gap (m, (batch,)) for following a leader without intervention of the shield, while the truck
        is at most `closing` faster."""
        p = self.promise
        heat = np.zeros(len(speed)) if self._seen is None else self._seen.heat
        slow, fast = np.maximum(speed - p.speed_error, 0.0), speed + p.speed_error + p.closing
        return p.needed_gap(fast, slow, heat, p.dt) + p.gap_error + 2 * p.soft_m

    def gentle(
        self, gap: Array, leader_speed: Array, speed: Array, engine: Array, brake: Array
    ) -> tuple[Array, Array]:
        """Commands with which the room before the limit shrinks in `yield_s` or slower, so that the shield
        need not brake; each (batch,).

        For any policy. It asks the brakes alone, as if there were no drag, for `yielding` at most. While the
        leader is not seen it goes on asking for what it did: released meanwhile, the brakes would have to
        compensate later.
        """
        p, old = self.promise, self._seen
        if old is None or len(old.gap) != len(gap):
            return engine, brake
        fast, slow = speed + p.speed_error, np.maximum(leader_speed - p.speed_error, 0.0)
        needed = p.needed_gap(fast, slow, old.heat, p.dt)
        for_speed = p.needed_gap(fast + 0.5, slow, old.heat, p.dt) - needed  # m for 0.5 m/s more
        # a leader that brakes harder is left to the limit, and another leader is no braking
        slowing = np.clip((slow - old.slow_leader) / p.track_s, -p.yielding, 0.0)
        room = gap - p.gap_error - needed - p.soft_m
        shrinks = speed - leader_speed - slow / p.leader_braking * slowing
        pull = (room / p.yield_s - shrinks) * 0.5 / np.maximum(for_speed, 0.1)
        asked = np.clip(np.where(np.isfinite(pull), -pull, old.yielded), 0.0, p.yielding)
        self._seen = old._replace(yielded=asked)
        share = p.bite + asked / p.brake_gain  # at low speed there is no drag
        least = np.where(asked > 0, share, 0.0) * self.brake_high
        left = 1.0 - np.clip(asked / p.mild_braking, 0.0, 1.0)
        return self.engine_low + left * (engine - self.engine_low), np.maximum(brake, least)

    def _bounds(self, gap: Array, leader_speed: Array, speed: Array) -> Bounds:
        """Bounds from this step's measurements and the last bounds.

        A leader that is not detected continues with its last motion, braking harder by `unseen_jerk`.
        """
        p = self.promise
        gap, leader_speed, speed = (np.asarray(x, float) for x in (gap, leader_speed, speed))
        if self._seen is None or len(self._seen.gap) != len(gap):
            self._seen = Bounds.unknown(len(gap))
        old = self._seen
        received, never = np.isfinite(leader_speed), np.isinf(old.unseen_s)
        known = np.maximum(np.where(received, leader_speed - p.speed_error, 0.0), 0.0)
        lost = np.where(never, 0.0, old.slow_leader - known + 2 * p.speed_error)
        over = p.track_s + np.where(never, 0.0, old.unseen_s)
        braking = np.where(received, lost / over, old.leader_braking + p.unseen_jerk * p.dt)
        braking = np.clip(braking, 0.0, p.leader_braking)
        share = np.where(never, 1.0, np.minimum(p.dt / p.track_s, 1.0))
        leader = np.where(received, known, np.maximum(old.leader - braking * p.dt, 0.0))
        reckoned = old.gap + (leader - old.speed) * p.dt
        faster = old.speed + p.acceleration_at(old.speed) * p.dt
        return Bounds(
            np.where(np.isfinite(gap), gap - p.gap_error, reckoned),
            leader,
            np.maximum(np.where(np.isfinite(speed), speed + p.speed_error, faster), 0.0),
            old.heat,
            np.where(received, old.slow_leader + share * (known - old.slow_leader), old.slow_leader),
            braking,
            np.where(received, 0.0, old.unseen_s + p.dt),
            old.eased,
            old.pressed,
            old.slack,
            old.yielded,
        )
