"""Tracks what may be in the lane ahead: a short list of objects, made from readings of one object at a time.

The radar reports range and speed of what it takes for the vehicle ahead. What that is changes: a vehicle cuts
in, the leader leaves the lane and uncovers a standing one, a bridge is taken for a vehicle for two readings.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from deeptruck_cacc.controllers.policy import Observation
from deeptruck_cacc.safety.assumptions import EMERGENCY, GOES_ON_S
from deeptruck_core.arrays import Array, Indices, Mask

SLOTS = 3  # the vehicle that is followed, one that hides it or is behind it, and one more reading


class Objects(NamedTuple):
    """Objects ahead, each (SLOTS, batch); the first one is followed. A gap of NaN is no object."""

    gap: Array  # m to its near edge, carried on by the speeds and corrected by the range
    speed: Array  # m/s, as last measured
    rate: Array  # m/s^2, at which that changes, over `accelerate_s`
    seen_s: Array  # s for which readings agreed with it, less those in which something else was measured
    unseen_s: Array  # s since its last reading
    range: Array  # m, its last reading carried on by the speeds
    opened: Array  # m by which its range has grown beyond the speeds; never negative
    by_range: Array  # m/s, its speed by the range alone, over `range_s`,
    by_radar: Array  # m/s, and as the radar reports it, over the same time
    beyond_s: Array  # s for which its range has been beyond its near edge
    beyond: Array  # m by which its last reading left the speeds

    @classmethod
    def none(cls, batch: int) -> Objects:
        """No object."""
        unknown, zero = np.full((SLOTS, batch), np.nan), np.zeros((SLOTS, batch))
        return cls(unknown, unknown, zero, zero, zero, unknown, zero, unknown, unknown, zero, zero)

    def brakes_on(self, goes_on_s: float) -> Mask:
        """Where one that slowed down is taken to go on doing so, unseen for up to `goes_on_s`."""
        return (self.unseen_s < goes_on_s) | (self.rate < -EMERGENCY)

    def speed_now(self, goes_on_s: float = GOES_ON_S) -> Array:
        """Its speed, m/s: one that slowed down goes on doing so for `goes_on_s` while it is not measured."""
        slows_s = np.where(self.brakes_on(goes_on_s), self.unseen_s, goes_on_s)
        return np.maximum(self.speed + np.minimum(self.rate, 0.0) * slows_s, 0.0)

    @property
    def faster_m_s(self) -> Array:
        """By how much the range grows faster than the speeds say, m/s."""
        return self.by_range - self.by_radar

    def where(self, flags: Mask, other: Objects) -> Objects:
        """These where `flags` (SLOTS, batch), else the others."""
        return Objects(*(np.where(flags, mine, its) for mine, its in zip(self, other, strict=True)))

    def take(self, slots: Indices) -> Objects:
        """In another order: those of `slots` (SLOTS, batch)."""
        return Objects(*(np.take_along_axis(column, slots, axis=0) for column in self))


class Past(NamedTuple):
    """What readings were like, each (2, batch): of the range (m) and the leader's speed (m/s)."""

    last: Array  # NaN for none
    change: Array  # of the last from the one before
    noise: Array  # mean second difference
    seen_s: Array  # s, over which it is the mean
    same_s: Array  # s, for which readings have repeated themselves exactly
    fresh_s: Array  # s, for which they had not before

    @classmethod
    def nothing(cls, batch: int) -> Past:
        """Before the first reading."""
        nowhere, zero = np.full((2, batch), np.nan), np.zeros((2, batch))
        return cls(nowhere, nowhere, zero, zero, zero, zero)


@dataclass
class Tracker:
    """Keeps the list of objects. Without a reading an object keeps its speed, or slows down as it did.

    A reading belongs to the object that it fits best, else it is a new one, which is confirmed by the next
    reading that continues it and vanishes if that does not come. Whatever is confirmed is for the shield to
    bound. The first of the list is what the policy follows: an object that is nearer takes its place after
    `nearer_s`, one that is farther after `farther_s` (the leader has left, which a change of lane of ours or
    a miss of the radar looks like before).

    Range and speeds must agree. Their difference is summed over the time in which an object is followed,
    misses included. What is proportional to the truck's own speed is a wrong wheel radius, learned as
    `own_speed_factor` in the first `learn_s` and slowly from then on; what else accumulates to `opened_m` is
    a range that drifts or stands still, or a speed that is wrong, and the reading is not accepted. A range
    that decreases faster than the speeds say is accepted, and the object is taken to be as slow as that.

    A range that jumps by less than `jump_m` is another point of reflection of the same vehicle: the nearest
    one of the last `edge_s` counts. Readings of a noisy radar whose range or speed repeats itself exactly
    while the truck moves are frozen and not accepted.

    After each call `objects` is the list; `readings` gap and speed of what was measured and accepted, NaN for
    the others; `counts` which of them the shield must bound; `came_from` the place of each in the list
    before, -1 for a new one; each (SLOTS, batch). `unseen_s` is the time since a confirmed one was measured,
    inf before; `contradicted_s` that for which range and speeds contradict each other or the radar
    is `frozen`; each (batch,).
    """

    dt: float
    nearer_s: float = 0.2
    farther_s: float = 2.5
    passed_s: float = 0.35  # for which other readings may come in the place of its own, at least
    jump_m: float = 5.0  # farther from an object than this a reading is of another one
    jump_speed: float = 2.0  # m/s, likewise: 20 m/s^2 from one reading to the next
    manoeuvre: float = 2.0  # m/s^2, by which an object that is not measured may leave its motion
    same_m: float = 0.8  # by how much the second reading of a new object may miss the first one's motion
    apart_m: float = 2.0  # less than so far from what is followed another object is the same one
    correct_s: float = 2.0  # time constant with which the range corrects a gap
    edge_s: float = 3.0  # for which the nearest point of reflection counts
    learn_s: float = 8.0  # over which a wrong wheel radius is learned at first,
    relearn_s: float = 300.0  # and later on
    most_factor: float = 0.04  # more than worn tyres explain
    learn_speed: float = 5.0  # m/s, above which it is learned
    opened_m: float = 2.0
    leak: float = 0.03  # m/s, slower than which a drift is not detected; more for a radar with noise
    accelerate_s: float = 0.5
    braking: float = 0.4  # m/s^2, slower than which an object's speed is taken to change by noise alone
    range_s: float = 0.7
    noise_m: float = 0.01  # mean second difference from which a range is noisy; that of 0.1 m (1 sd) is 0.2
    noise_speed: float = 0.005  # m/s, likewise of the leader's speed
    noise_s: float = 10.0  # over which it is taken
    fresh_s: float = 4.0  # in which a noisy signal repeated no value,
    frozen_s: float = 0.8  # so that one that repeats itself for so long is frozen
    moving: float = 1.0  # m/s, of the truck: standing behind a standing vehicle readings may repeat
    forget_s: float = 4.0  # after so long without a reading objects are forgotten
    objects: Objects = field(default_factory=lambda: Objects.none(0))
    readings: tuple[Array, Array] = field(default_factory=lambda: (np.zeros((SLOTS, 0)),) * 2)
    counts: Mask = field(default_factory=lambda: np.zeros((SLOTS, 0), bool))
    came_from: Indices = field(default_factory=lambda: np.zeros((SLOTS, 0), np.intp))
    unseen_s: Array = field(default_factory=lambda: np.zeros(0))
    contradicted_s: Array = field(default_factory=lambda: np.zeros(0))
    frozen: Mask = field(default_factory=lambda: np.zeros(0, bool))
    own_speed_factor: Array = field(default_factory=lambda: np.zeros(0))  # share by which it is too high
    _speed: Array = field(default_factory=lambda: np.zeros(0), repr=False)  # m/s, of the truck, one step ago
    _learned_s: Array = field(default_factory=lambda: np.zeros(0), repr=False)
    _drifts: Mask = field(default_factory=lambda: np.zeros(0, bool), repr=False)
    _measured: Indices = field(default_factory=lambda: np.zeros(0, np.intp), repr=False)  # the last one
    _past: Past = field(default_factory=lambda: Past.nothing(0), repr=False)

    def reset(self) -> None:
        """Forget everything."""
        self._begin(0)

    def forget(self) -> None:
        """Forget all objects; the wheel radius stays what it is."""
        factor, learned = self.own_speed_factor, self._learned_s
        self._begin(len(factor))
        self.own_speed_factor, self._learned_s = factor, learned

    def _begin(self, batch: int) -> None:
        zero, never = np.zeros(batch), np.zeros(batch, bool)
        self._speed = np.full(batch, np.nan)
        self.objects, self._past = Objects.none(batch), Past.nothing(batch)
        self.unseen_s, self.contradicted_s, self._drifts = np.full(batch, np.inf), zero, never
        self.own_speed_factor, self._learned_s, self._measured = zero, zero, np.zeros(batch, np.intp)

    def __call__(self, observation: Observation) -> dict[str, Array]:
        """The observation with gap and leader speed of what is followed; NaN before the first reading."""
        names = ("gap", "leader_speed", "speed")
        columns = (np.atleast_1d(np.asarray(observation[n], float)) for n in names)
        gap, leader, speed = np.broadcast_arrays(*columns)
        if self.objects.gap.shape[1] != len(speed):
            self._begin(len(speed))
        received = np.isfinite(gap + leader)
        self.frozen = self._is_frozen(gap, leader, speed)
        old = self._carried_on(speed)
        forgotten = received & (old.unseen_s > self.forget_s) & _slots(0)
        old = Objects.none(len(speed)).where(forgotten, old)
        slot, new = self._belongs(old, gap, leader, received)
        here = received & (_numbers == slot)
        after, beyond = self._updated(old, gap, leader, speed, here, new)
        self._learn(beyond, speed, _at(old.unseen_s, slot), received & ~new)
        after = self._aged(after, here, received)
        drifts = (_at(after.opened, slot) > self._opened_m) | self.frozen
        self._drifts = np.where(received, drifts, self._drifts)
        accepted = here & self._confirmed(after) & ~self._drifts
        self.objects, order = self._in_order(after, slot, accepted.any(axis=0))
        accepted = np.take_along_axis(accepted, np.maximum(order, 0), axis=0)
        self._measured = np.argmax(order == np.where(received, slot, self._measured), axis=0)
        self.came_from = np.where(new & (_numbers == self._measured), -1, order)
        self._report(gap, leader, accepted, received)
        pairs = zip(self.readings, (self.objects.gap, self.objects.speed_now()), strict=True)
        likely = (np.where(np.isnan(seen[0]), kept[0], seen[0]) for seen, kept in pairs)
        return {**observation, **dict(zip(names, (*likely, speed), strict=True))}

    def needed_braking(self, least_m: float, goes_on_s: float = GOES_ON_S) -> Array:
        """Constant deceleration, m/s^2 (batch,), with which the truck stays `least_m` behind every object
        that counts: one that brakes goes on to a standstill, another, and one that was not measured for
        `goes_on_s`, keeps its speed."""
        now, own, speed = self.objects, self._speed, self.objects.speed_now(goes_on_s)
        room, braking = np.maximum(now.gap - least_m, 0.1), np.maximum(-now.rate, self.braking)
        stops = own**2 / 2 / (room + speed**2 / 2 / braking)
        follows = np.maximum(own - speed, 0.0) ** 2 / 2 / room
        needs = np.where(now.brakes_on(goes_on_s) & (-now.rate > self.braking), stops, follows)
        return np.asarray(np.max(np.where(self.counts & np.isfinite(needs), needs, 0.0), axis=0))

    @property
    def _noise_m(self) -> Array:
        """Mean second difference of the range, m (batch,); the usual one until it is known."""
        noise = self._past.noise[0]
        return np.where(self._past.seen_s[0] < 1.0, np.maximum(noise, 0.2), noise)

    @property
    def _step_m(self) -> Array:
        """By how much a range may leave the speeds from one reading to the next, m (batch,): 0.8 m with the
        usual noise of 0.1 m (1 sd)."""
        return 0.4 + 2.0 * self._noise_m

    @property
    def _opened_m(self) -> Array:
        """By how much in all it may, m (batch,)."""
        return np.maximum(self.opened_m, 2.5 * self._step_m)

    @property
    def _range_error(self) -> Array:
        """Of a speed from ranges, by noise, m/s (batch,): 0.4 m/s with the usual noise."""
        return 0.1 + 1.5 * np.maximum(self._noise_m, 0.05)

    def _carried_on(self, speed: Array) -> Objects:
        """All objects one step later, at constant speeds."""
        was, before = self.objects, np.where(np.isfinite(self._speed), self._speed, speed)
        self._speed = speed
        own = 0.5 * (before + speed) * (1.0 - self.own_speed_factor)
        gap, by_speed = was.gap + (was.speed_now() - own) * self.dt, was.range + (was.speed - own) * self.dt
        return was._replace(gap=gap, range=by_speed, unseen_s=was.unseen_s + self.dt)

    def _belongs(self, old: Objects, gap: Array, leader: Array, received: Mask) -> tuple[Indices, Mask]:
        """The place in the list of what was measured, and whether it is a new object, each (batch,)."""
        missed_s = old.unseen_s - self.dt
        young = (old.seen_s < self.dt - 1e-9) & ~_slots(0)
        reach = np.where(young, self.same_m, self.jump_m + 0.5 * self.manoeuvre * missed_s**2)
        fits = np.abs(gap - old.gap) <= reach
        doubtful = old.opened > self._opened_m  # its speed is kept as it was before
        fits &= doubtful | (np.abs(leader - old.speed_now()) <= self.jump_speed + self.manoeuvre * missed_s)
        off = np.abs(gap - old.gap) - _slots(0)  # the first one is preferred by 1 m
        known = np.argmin(np.where(fits, off, np.inf), axis=0)
        free = np.argmin(np.where(np.isnan(old.gap), -1.0, old.seen_s + 1e3 * _slots(0)), axis=0)
        new = received & ~fits.any(axis=0)
        return np.where(new, free, known), new

    def _updated(
        self, old: Objects, gap: Array, leader: Array, speed: Array, here: Mask, new: Mask
    ) -> tuple[Objects, Array]:
        """The list with the reading taken into the object that it belongs to, and by how much (m, (batch,))
        its range grew beyond the speeds since its last reading."""
        elapsed, step = old.unseen_s, self._step_m
        # Since its last reading its speed is taken to have changed evenly.
        beyond = gap - old.range - 0.5 * (leader - old.speed) * elapsed
        # A single jump is another point of reflection; what comes nearer twice as fast does come nearer.
        jump = np.where(old.beyond < -step, np.maximum(beyond, old.beyond), 0.0)
        within = np.where(beyond < -step, jump, np.minimum(beyond, step))
        same = np.abs(beyond) <= step  # else another point of reflection
        opened = np.maximum(
            old.opened + same * np.nan_to_num(beyond) - (self.leak + 0.1 * self._noise_m) * elapsed, 0.0
        )
        share = np.minimum(elapsed / self.range_s, 1.0)
        mean = 0.5 * (old.speed + leader)  # the range says `within` a second more
        by_range = old.by_range + share * (mean + within / np.maximum(elapsed, self.dt) - old.by_range)
        by_radar = old.by_radar + share * (mean - old.by_radar)
        share = np.minimum(elapsed / self.accelerate_s, 1.0)
        rate = old.rate + share * ((leader - old.speed) / np.maximum(elapsed, self.dt) - old.rate)
        off = gap - old.gap
        farther = off > step
        beyond_s = np.where(farther, old.beyond_s + elapsed, 0.0)
        share = np.where(off < -step, 0.5, np.where(farther, 0.0, elapsed / self.correct_s))
        share = np.where((elapsed > 3.5 * self.dt) | (beyond_s > self.edge_s), 1.0, np.minimum(share, 1.0))
        doubtful, zero = opened > self._opened_m, np.zeros_like(elapsed)
        share = np.where(doubtful, 0.0, share)
        seen_s = np.minimum(old.seen_s + np.minimum(elapsed, self.passed_s), 2 * self.farther_s)
        known = Objects(
            gap=old.gap + share * off,
            speed=np.where(doubtful, old.speed, leader),
            rate=np.where(doubtful, old.rate, rate),
            seen_s=seen_s,
            unseen_s=zero,
            range=gap + zero,
            opened=opened,
            by_range=by_range,
            by_radar=by_radar,
            beyond_s=np.where(share == 1.0, 0.0, beyond_s),
            beyond=beyond,
        )
        there, its_speed = gap + zero, leader + zero
        first = Objects(there, its_speed, zero, zero, zero, there, zero, its_speed, its_speed, zero, zero)
        after = first.where(here & new, known.where(here, old))
        return after, np.where(here & ~new, beyond, 0.0).sum(axis=0)

    def _learn(self, beyond: Array, speed: Array, elapsed: Array, counts: Mask) -> None:
        """Take what the range grew beyond the speeds as the effect of a wrong wheel radius."""
        counts = counts & (speed > self.learn_speed) & (np.abs(beyond) < self._step_m)
        # Else it may be a drift.
        counts &= self.objects.opened.max(axis=0) < 0.4 * self._opened_m
        counts &= ~(self.objects.faster_m_s < -3.0 * self._range_error).any(axis=0)
        elapsed = np.where(counts, elapsed, 0.0)
        self._learned_s = self._learned_s + elapsed
        over = np.where(self._learned_s < self.learn_s, self._learned_s, self.relearn_s)
        more = np.where(counts, beyond, 0.0) / np.maximum(over * speed, self.dt)
        self.own_speed_factor = np.clip(self.own_speed_factor + more, -self.most_factor, self.most_factor)

    def _aged(self, after: Objects, here: Mask, received: Mask) -> Objects:
        """The list after a reading elsewhere: an object that the radar looks through is soon gone."""
        gone = np.where(received & ~here, self._looked_through(after), after.unseen_s > self.forget_s)
        return Objects.none(len(received)).where(gone & ~_slots(0), after)

    def _looked_through(self, now: Objects) -> Mask:
        """Objects in whose place the radar has read others for half as long as it had seen them."""
        return now.unseen_s > np.clip(0.5 * now.seen_s, self.passed_s, self.farther_s) + 1e-9

    def _confirmed(self, now: Objects) -> Mask:
        """Objects that were read for a step; nearer than the one that is followed, which has just
        driven there, for two steps."""
        least = np.where(now.gap < now.gap[0] - self.apart_m, 2.0, 1.0) * self.dt
        return np.isfinite(now.gap) & (now.seen_s > least - self.dt / 2) | _slots(0)

    def _in_order(self, after: Objects, slot: Indices, accepted: Mask) -> tuple[Objects, Indices]:
        """The list with what is to be followed first, and where each of it was before, -1 for nowhere."""
        first, mine = after.gap[0], _at(after.gap, slot)
        nearer, none = mine < first, np.isnan(first)
        seen = np.where(
            nearer, _at(after.seen_s, slot) > self.nearer_s - 1e-9, self._looked_through(after)[0]
        )
        swaps = (slot > 0) & accepted & (none | seen)
        swaps &= none | (np.abs(mine - first) > self.apart_m)
        order = np.broadcast_to(_numbers, after.gap.shape)
        before = swaps & (_numbers == slot)
        order = np.where(before, 0, np.where(swaps & _slots(0), slot, order))
        left = before & ~nearer  # the vehicle that was followed has left the lane
        moved = after.take(order)
        moved = moved._replace(seen_s=np.where(before, 2 * self.farther_s, moved.seen_s))
        return Objects.none(len(slot)).where(left, moved), np.where(left, -1, order)

    def _report(self, gap: Array, leader: Array, accepted: Mask, received: Mask) -> None:
        """What shield and policy get of the reading, and what is not accepted."""
        now = self.objects
        edge = np.where(gap - now.gap > self._step_m, now.gap, gap)
        closing = now.faster_m_s < -self._range_error
        speed = np.where(closing, np.clip(now.by_range + 0.5 * self._range_error, 0.0, leader), leader)
        self.readings = np.where(accepted, edge, np.nan), np.where(accepted, speed, np.nan)
        self.counts = (self._confirmed(now) & (now.gap <= _at(now.gap, self._measured))) | _slots(0)
        self.unseen_s = np.where(accepted.any(axis=0), 0.0, self.unseen_s + self.dt)
        contradicts = received & (_at(now.faster_m_s, self._measured) < -3.0 * self._range_error)
        more = np.where(received, np.where(self._drifts, self.dt, self.dt / 3.0), 0.0)
        doubted = np.where(self._drifts | contradicts, self.contradicted_s + more, 0.0)
        self.contradicted_s = np.where(received, doubted, self.contradicted_s)

    def _is_frozen(self, gap: Array, leader: Array, speed: Array) -> Mask:
        """Whether a range or speed that was noisy and never repeated itself has done so for `frozen_s`."""
        past, reading = self._past, np.stack([gap, leader])
        received = np.isfinite(gap + leader)
        same = received & (reading == past.last)
        change = reading - past.last
        rough = np.where(same, np.nan, np.abs(change - past.change))
        rough = np.minimum(
            rough, np.array([[1.0], [0.1]])
        )  # a jump is no noise, nor that a leader begins to brake
        seen_s = np.minimum(past.seen_s + self.dt * np.isfinite(rough), self.noise_s)
        noise = past.noise + self.dt / np.maximum(seen_s, self.dt) * np.nan_to_num(rough - past.noise)
        same_s = np.where(same, past.same_s + self.dt, np.where(received, 0.0, past.same_s))
        over = received & ~same & (past.same_s > 0.0)
        fresh_s = np.where(over, 0.0, past.fresh_s + np.where(received & ~same, self.dt, 0.0))
        self._past = Past(reading, change, noise, seen_s, same_s, fresh_s)
        noisy = (fresh_s > self.fresh_s) & (noise > np.array([[self.noise_m], [self.noise_speed]]))
        frozen = (noisy & (same_s > self.frozen_s - 1e-9)).any(axis=0)
        return np.asarray(frozen & (speed > self.moving))


_numbers = np.arange(SLOTS)[:, None]


def _slots(*which: int) -> Mask:
    """Mask of these places in the list, (SLOTS, 1)."""
    return np.isin(_numbers, which)


def _at(column: Array, slot: Indices) -> Array:
    """The entry of each truck's place in the list, (batch,)."""
    return np.take_along_axis(column, slot[None], axis=0)[0]
