"""The shield passes commands on while the truck could still stop behind all objects; otherwise it brakes.

Derived in docs/cacc_shield.md.

Pure: it imports numpy, what is promised and the brakes, and knows neither policy nor simulator.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from deeptruck_cacc.safety.assumptions import GOES_ON_S, Assumptions
from deeptruck_cacc.safety.brakes import Brakes
from deeptruck_core.arrays import Array, Mask
from deeptruck_core.constants import ROUNDED_GRAVITY


class Ahead(NamedTuple):
    """Bounds of each object ahead, (objects, batch)."""

    gap: Array  # m, the lowest
    speed: Array  # m/s, the lowest
    slow: Array  # m/s, its speed when measured, through a filter of `track_s`
    slowing: Array  # m/s^2, its braking when measured, by that filter
    braking: Array  # m/s^2, the hardest that it brakes while it is not measured
    unseen_s: Array  # s, since it was; inf for never
    near: Array  # 1 where it has been nearer than the limit ever since it appeared, else 0

    @classmethod
    def never(cls, objects: int, batch: int) -> Ahead:
        """Nothing measured yet."""
        nothing = np.zeros((objects, batch))
        never = np.full((objects, batch), np.inf)
        return cls(nothing, nothing, nothing, nothing, nothing, never, nothing + 1.0)


class Truck(NamedTuple):
    """Bounds of the truck, and what was asked of it, each (batch,)."""

    speed: Array  # m/s, the highest
    heat: Array  # J/kg, the highest
    eased: Array  # share of the engine command that was taken back
    pressed: Array  # share of the brake command that may still be in the brakes
    slack: Array  # m to the limit, through a filter of `soft_s`; NaN for none yet
    yielded: Array  # m/s^2, the braking that `gentle` requested last
    yields: Mask  # whether it requested the brakes for it
    short: Array  # m/s^2, by which the truck has braked less than that, by slope, load or brakes
    left: Array  # share of the engine command that it left

    @classmethod
    def unknown(cls, batch: int) -> Truck:
        """Before the first measurement, with cold brakes."""
        nothing = np.zeros(batch)
        unknown = np.full(batch, np.nan)
        return cls(
            np.full(batch, 40.0),
            nothing,
            nothing,
            nothing,
            unknown,
            nothing,
            nothing > 0.0,
            nothing,
            nothing + 1,
        )


@dataclass
class Shield:
    """Filters commands to the truck: `see` what was measured, then `limit` the commands.

    `acted` and `braking` (batch,) describe the last call, `room_m` (batch,) the distance to the limit behind
    the nearest to it of all objects; behind one at 0 m before anything was measured.
    """

    assumed: Assumptions
    engine_low: float
    brake_high: float
    acted: Mask = field(default_factory=lambda: np.zeros(0, bool))
    braking: Mask = field(default_factory=lambda: np.zeros(0, bool))
    room_m: Array = field(default_factory=lambda: np.zeros(0))
    _ahead: Ahead | None = field(default=None, repr=False)
    _truck: Truck = field(default_factory=lambda: Truck.unknown(0), repr=False)
    _counts: Mask = field(default_factory=lambda: np.zeros((0, 0), bool), repr=False)
    # heat, J/kg, and the share in the brakes as they are without the last command
    _spared: tuple[Array, Array] = field(default_factory=lambda: (np.zeros(0), np.zeros(0)), repr=False)

    def __post_init__(self) -> None:
        self.brakes = Brakes(self.assumed)

    def reset(self) -> None:
        """Reset the state, with cold brakes that give what is promised."""
        self._ahead, self._truck = None, Truck.unknown(0)
        self.brakes.reset()

    def forget(self) -> None:
        """Reset objects and speed but keep what is known of the brakes; the last command was not obeyed."""
        if self._ahead is not None:
            heat, pressed = self._spared
            self._ahead = None
            self._truck = Truck.unknown(len(heat))._replace(heat=heat, pressed=pressed)
            self.brakes.spare()

    def spare(self) -> None:
        """Note that the last command was not obeyed, and so heated no brakes."""
        if self._ahead is not None:
            heat, pressed = self._spared
            self._truck = self._truck._replace(heat=heat, pressed=pressed)
            self.brakes.spare()

    def filter(
        self,
        gap: Array,
        leader_speed: Array,
        speed: Array,
        engine: Array,
        brake: Array,
        grade: Array | float = np.nan,
    ) -> tuple[Array, Array]:
        """Commands to send behind one object, each (batch,): `see` and `limit`."""
        self.see(gap, leader_speed, speed, grade)
        return self.limit(engine, brake, grade)

    def see(
        self,
        gap: Array,
        leader_speed: Array,
        speed: Array,
        grade: Array | float = np.nan,
        counts: Mask | None = None,
        came_from: NDArray[np.intp] | None = None,
    ) -> None:
        """Take what was measured. Gap and leader speed are (batch,) of one object or (objects, batch), NaN
        for 'not measured'; `counts` marks objects that must be stopped behind, `came_from` says at which
        place each was before, -1 for a new one."""
        gap, leader_speed = (np.atleast_2d(np.asarray(x, float)) for x in (gap, leader_speed))
        speed = np.asarray(speed, float)
        if self._ahead is None or self._ahead.gap.shape != gap.shape:
            self._ahead = Ahead.never(*gap.shape)
            if len(self._truck.speed) != len(speed):
                self._truck = Truck.unknown(len(speed))
        if came_from is not None:
            known = Ahead(*(np.take_along_axis(x, np.maximum(came_from, 0), axis=0) for x in self._ahead))
            never = Ahead.never(*gap.shape)
            self._ahead = Ahead(*(np.where(came_from < 0, no, x) for no, x in zip(never, known, strict=True)))
        self._counts = np.ones(gap.shape, bool) if counts is None else counts
        self.brakes.see(speed, np.asarray(grade, float), self._truck.heat)
        self._move(gap, leader_speed, speed)

    def limit(self, engine: Array, brake: Array, grade: Array | float = np.nan) -> tuple[Array, Array]:
        """Commands to send, each (batch,); NaN in a command is 'no command'. It brakes if nothing was ever
        measured."""
        p, truck = self.assumed, self._truck
        slack, unseen, appeared = self._slack()
        missing = ~(np.isfinite(engine) & np.isfinite(brake))
        past = np.where(np.isfinite(truck.slack), truck.slack, slack)
        smooth = past + min(p.dt / p.soft_s, 1.0) * (slack - past)
        near = 1.0 - np.clip(np.maximum(smooth, slack) / p.soft_m, 0.0, 1.0)
        near = np.where(slack < 0, 1.0, near)
        limit = near**2 * self.brake_high
        mild = p.mild_brake * self.brake_high
        asked = np.where(missing, mild, brake)  # no command: slow down gently
        easing = unseen & (slack < p.ease_m)
        limit = np.maximum(limit, np.where(easing, np.minimum(2.0 - 2.0 * slack / p.ease_m, 1.0) * mild, 0.0))
        limit = np.maximum(limit, appeared * self.brake_high)
        sent_brake = np.clip(np.maximum(asked, limit), 0.0, self.brake_high)
        # not a cut: a policy that follows at the limit would get its engine on and off
        eased = np.clip(truck.eased + np.where(easing, p.dt, -p.dt) / p.ease_s, 0.0, 1.0)
        eased = np.maximum(np.where(appeared > 0, 1.0, near), eased)
        left = 1.0 - eased
        throttled = self.engine_low + left * (np.maximum(engine, self.engine_low) - self.engine_low)
        sent_engine = np.where(left < 1.0, throttled, engine)
        sent_engine = np.where(missing, self.engine_low, sent_engine)
        self.braking = (slack < 0) | (appeared > 0)
        self.acted = missing | (sent_brake > asked) | (sent_engine != engine)
        left_over = truck.pressed * np.exp(-p.dt / p.release_s)
        share = sent_brake / self.brake_high
        self.brakes.sent(share)
        downhill = np.where(np.isfinite(grade), p.grade_error - grade, p.steepest)
        pressed = np.maximum(np.where(share > 0, share + p.descent_share * downhill, 0.0), left_over)
        self._spared = p.heat_after(truck.heat, left_over, truck.speed), left_over
        heat = p.heat_after(truck.heat, pressed, truck.speed)
        self._truck = truck._replace(heat=heat, eased=eased, pressed=pressed, slack=smooth)
        return sent_engine, sent_brake

    def steady_gap(self, speed: Array) -> Array:
        """Least gap (m, (batch,)) for following a leader without intervention of the shield, while the truck
        is at most `closing` faster."""
        p = self.assumed
        heat, gain = np.zeros(len(speed)), np.ones(len(speed))
        if len(self._truck.heat) == len(speed):
            heat, gain = self._truck.heat, self.brakes.gain_of(len(speed))
        slow, fast = np.maximum(speed - p.speed_error, 0.0), speed + p.speed_error + p.closing
        return p.needed_gap(fast, slow, heat, p.dt, gain) + p.gap_error + 2 * p.soft_m

    def gentle(self, engine: Array, brake: Array, grade: Array | float = np.nan) -> tuple[Array, Array]:
        """Commands with which the room before the limit shrinks in `yield_s` or slower, so that the shield
        need not brake; each (batch,). Call it after `see`.

        For any policy. It asks brakes and slope alone, as if there were no drag, for `yielding` at most, and
        for what the truck has braked less than that. While no object is measured it goes on asking for what
        it did: released meanwhile, the brakes would have to compensate later. A policy's own braking changes
        by `jerk` at most, and may be harder than `yielding` only as far as stopping behind an object that
        brakes on as it does needs it.
        """
        p, truck, ahead = self.assumed, self._truck, self._ahead
        if ahead is None:
            return engine, brake
        gain = self.brakes.gain_of(len(truck.speed))
        needed = p.needed_gap(truck.speed, ahead.speed, truck.heat, p.dt, gain)
        for_speed = p.needed_gap(truck.speed + 0.5, ahead.speed, truck.heat, p.dt, gain) - needed
        # a leader that brakes harder is left to the limit
        slowing = np.clip(np.where(ahead.unseen_s > 0.0, ahead.braking, ahead.slowing), 0.0, p.firm)
        room = ahead.gap - needed - p.soft_m
        shrinks = truck.speed - ahead.speed - 2 * p.speed_error + ahead.speed / p.leader_braking * slowing
        pull = (shrinks - room / p.yield_s) * 0.5 / np.maximum(for_speed, 0.1)
        seen = self._counts & (ahead.unseen_s < GOES_ON_S)
        pull = np.max(np.where(seen, pull, -np.inf), axis=0)
        kept = np.minimum(truck.yielded, p.yielding)
        asked = np.clip(np.where(seen.any(axis=0), pull, kept), 0.0, p.firm)
        less = p.mild_braking * p.dt / p.ease_s
        asked = np.clip(asked, truck.yielded - less, truck.yielded + p.jerk * p.dt)
        # A brake is no trim: for less the engine alone is taken back, which never drives against it.
        climb = np.nan_to_num(np.asarray(grade, float))
        of_brakes = asked + truck.short - p.slope_pull * climb
        presses = asked + truck.short - ROUNDED_GRAVITY * climb > p.pressed_above
        yields = (asked > 0.0) & np.where(truck.yields, of_brakes > p.released_below, presses)
        least = np.where(yields, p.share_of(of_brakes), 0.0) * self.brake_high
        left = np.where(yields, 0.0, 1.0 - np.clip(asked / p.mild_braking, 0.0, 1.0))
        change = 0.5 * p.dt / p.ease_s  # no jolt
        left = np.clip(left, truck.left - change, truck.left + change)
        self._truck = truck._replace(yielded=asked, yields=yields, left=left)
        most = self._share_for(self._braking_to_stop().max(axis=0))
        brake = self.brakes.slewed(brake / self.brake_high, most) * self.brake_high
        return self.engine_low + left * (engine - self.engine_low), np.maximum(brake, least)

    def _braking_to_stop(self) -> Array:
        """Deceleration (m/s^2, (objects, batch)) with which the truck stops behind each object that counts,
        as it goes on braking."""
        p, ahead, speed = self.assumed, self._ahead, self._truck.speed
        assert ahead is not None
        way = ahead.gap - p.d_safety - speed * p.response_s
        way = way + ahead.speed**2 / (2 * np.maximum(ahead.braking, 0.1))
        pull = speed**2 / (2 * np.maximum(way, 0.5))
        return np.asarray(np.where(self._counts & np.isfinite(ahead.unseen_s), pull, 0.0))

    def _share_for(self, needed: Array) -> Array:
        """Share of the brake command where a deceleration (m/s^2) is needed: somewhat more
        than that, and `yielding` at least."""
        p, gain = self.assumed, self.brakes.gain_of(len(self._truck.speed))
        return np.asarray(p.bite + np.maximum(p.yielding, p.harder * needed) / (p.brake_gain * gain))

    def _slack(self) -> tuple[Array, Mask, Array]:
        """Distance (m, (batch,)) to the limit behind the object that is nearest to it, and whether that one
        is not measured; and the share of the brake command for objects that appeared nearer than the limit,
        which are braked for by what they need."""
        p, truck, ahead = self.assumed, self._truck, self._ahead
        assert ahead is not None, "see comes first"
        gain = self.brakes.gain_of(len(truck.speed))
        slack = ahead.gap - p.needed_gap(truck.speed, ahead.speed, truck.heat, p.dt, gain)
        known = self._counts & np.isfinite(ahead.unseen_s)
        self._ahead = ahead._replace(near=np.where(slack < 0, ahead.near, 0.0))
        near = known & (self._ahead.near > 0)
        needs = self._share_for(self._braking_to_stop())
        appeared = np.max(np.where(near, needs, 0.0), axis=0)
        # The first one before its first measurement has a gap of 0.
        self.room_m = _at_least(slack, known, slack)
        slack = np.where(near, p.ease_m, slack)
        return _at_least(slack, known, slack), _at_least(slack, known, ahead.unseen_s) > 0, appeared

    def _move(self, gap: Array, leader_speed: Array, speed: Array) -> None:
        """Bounds from this step's measurements and the last bounds.

        An object that is not detected continues with its last motion, braking for `GOES_ON_S` or, in an
        emergency, to a standstill.
        """
        p, old, truck = self.assumed, self._ahead, self._truck
        assert old is not None
        received, never = np.isfinite(leader_speed), np.isinf(old.unseen_s)
        known = np.maximum(np.where(received, leader_speed - p.speed_error, 0.0), 0.0)
        unseen_s = np.where(never, 0.0, old.unseen_s)
        lost = np.where(never, 0.0, old.slow - known)
        braking = (lost + np.where(never, 0.0, 2 * p.speed_error)) / (p.track_s + unseen_s)
        goes_on = (unseen_s < GOES_ON_S - p.dt / 2) | (old.braking > p.emergency)
        braking = np.where(received, braking, np.where(goes_on, old.braking, 0.0))
        braking = np.clip(braking, 0.0, p.leader_braking)
        share = np.where(never, 1.0, np.minimum((p.dt + unseen_s) / p.track_s, 1.0))
        leader = np.where(received, known, np.maximum(old.speed - braking * p.dt, 0.0))
        faster = truck.speed + p.acceleration_at(truck.speed) * p.dt
        self._ahead = Ahead(
            np.where(np.isfinite(gap), gap - p.gap_error, old.gap + (leader - truck.speed) * p.dt),
            leader,
            np.where(received, old.slow + share * (known - old.slow), old.slow),
            np.where(received, lost / (p.track_s + unseen_s), old.slowing),
            braking,
            np.where(received, 0.0, old.unseen_s + p.dt),
            old.near,
        )
        fastest = np.maximum(np.where(np.isfinite(speed), speed + p.speed_error, faster), 0.0)
        off = np.where(truck.yields, truck.yielded - (truck.speed - fastest) / p.dt, -truck.short)
        short = np.clip(truck.short + p.dt / p.learns_s * off, 0.0, p.most_short)
        self._truck = truck._replace(speed=fastest, short=np.where(np.isfinite(speed), short, truck.short))


def _at_least(slack: Array, known: Mask, of: Array) -> Array:
    """What the known object with the least slack has, (batch,); of the first one where none is known."""
    first = np.argmin(np.where(known, slack, np.inf), axis=0)[None]
    return np.asarray(np.take_along_axis(of, first, axis=0)[0])
