"""Tracks the vehicle ahead: which radar readings are accepted, and what is used without one."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from deeptruck_cacc.controllers.policy import Observation

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


class Track(NamedTuple):
    """State of a vehicle ahead, each (batch,)."""

    gap: Array  # m, carried on by the speeds and corrected by the range
    speed: Array  # m/s
    credit_s: Array  # s, for how long readings have agreed with it

    def where(self, flags: Flags, other: Track) -> Track:
        """This track where `flags`, else the other."""
        return Track(*(np.where(flags, mine, its) for mine, its in zip(self, other, strict=True)))


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
    """Accepts readings that fit the track. Without a reading the leader is assumed to keep its speed.

    Range and speeds must agree: if the range deviates by more than `drift_m` from the integrated relative
    speed, the range or a speed is frozen or has the wrong sign. Such readings are not accepted; if the range
    decreases faster than the speeds say, the vehicle is assumed to be as near as the range says and as slow
    as its rate implies. A range that grows faster than the speeds and `bias` say, by `opened_m` in all, is
    not accepted either, however slowly it drifts.

    Nor are readings of a noisy radar whose range or speed repeats itself exactly while the truck moves: it is
    frozen.

    A reading elsewhere starts a second track. It replaces the first one after readings have agreed with it
    for `nearer_s` if it is nearer (a cut-in, not a single false reading), for `farther_s` if not (a cut-out,
    not a lane change). The replaced track is accepted again at once for twice `farther_s`.

    After each call `radar` holds gap and leader speed as measured, NaN if not accepted; `unseen_s` the time
    since the last accepted reading, inf before the first; and `contradicted_s` the time for which readings
    have come whose range and speeds contradict each other or that are `frozen`; each (batch,).
    """

    dt: float
    nearer_s: float = 0.2
    farther_s: float = 2.5
    jump_m: float = 5.0  # farther from a track than this a reading is of another vehicle
    jump_speed: float = 2.0  # m/s, likewise: 20 m/s^2 from one reading to the next
    same_m: float = 1.5  # likewise, of the second track, which must tell one story from its begin
    manoeuvre: float = 2.0  # m/s^2, by which a leader that is not seen may leave its track
    drift_m: float = 2.0
    drift_s: float = 2.0  # time constant with which the range corrects the track
    bias: float = 0.2  # m/s, which the errors of both speeds may add up to: twice `Promise.speed_error`
    opened_m: float = 1.0  # of noisier radars than 0.1 m (1 sd) 0.5 m and three times their mean difference
    noise_m: float = 0.01  # mean second difference from which a range is noisy; that of 0.1 m (1 sd) is 0.2
    noise_speed: float = 0.005  # m/s, likewise of the leader's speed
    noise_s: float = 10.0  # over which it is taken
    fresh_s: float = 4.0  # in which a noisy signal repeated no value,
    frozen_s: float = 0.8  # so that one that repeats itself for so long is frozen
    moving: float = 1.0  # m/s, of the truck: standing behind a standing vehicle readings may repeat
    forget_s: float = 4.0  # after so long without a believed reading the next one begins a new track
    radar: tuple[Array, Array] = field(default_factory=lambda: (np.zeros(0), np.zeros(0)))
    unseen_s: Array = field(default_factory=lambda: np.zeros(0))
    contradicted_s: Array = field(default_factory=lambda: np.zeros(0))
    frozen: Flags = field(default_factory=lambda: np.zeros(0, bool))
    _tracks: tuple[Track, Track] | None = field(default=None, repr=False)
    _lost_s: Array = field(default_factory=lambda: np.zeros(0), repr=False)  # without any reading
    _drifts: Flags = field(default_factory=lambda: np.zeros(0, bool), repr=False)
    _opened: Array = field(default_factory=lambda: np.zeros(0), repr=False)  # m, beyond speeds and `bias`
    _range: Array = field(default_factory=lambda: np.zeros(0), repr=False)  # m, of this track just before
    _past: Past = field(default_factory=lambda: Past.nothing(0), repr=False)

    def reset(self) -> None:
        """Forget the past."""
        self._tracks = None

    def __call__(self, observation: Observation) -> dict[str, Array]:
        """The observation with accepted gap and leader speed; NaN only before the first accepted reading."""
        names = ("gap", "leader_speed", "speed")
        columns = (np.atleast_1d(np.asarray(observation[n], float)) for n in names)
        gap, leader, speed = np.broadcast_arrays(*columns)
        reading = Track(gap, leader, np.zeros(len(gap)))
        first, second = self._carried_on(speed)
        received = np.isfinite(gap + leader)
        new = received & (self.unseen_s > self.forget_s)
        off = gap - first.gap
        far = np.abs(off) > self.jump_m + 0.5 * self.manoeuvre * self._lost_s**2
        far |= np.abs(leader - first.speed) > self.jump_speed + self.manoeuvre * self._lost_s
        fits = received & ~new & (~far | self._drifts)
        back = fits & (self._lost_s > 0)  # what was reckoned meanwhile shows no drift
        self.frozen = self._is_frozen(gap, leader, speed)
        beyond = gap - self._range - (leader - speed + self.bias) * self.dt
        counts = fits & np.isfinite(beyond)
        self._opened = np.where(counts, np.maximum(self._opened + beyond, 0.0), self._opened)
        opened_m = np.maximum(self.opened_m, 0.5 + 3.0 * self._past.noise[0])
        drifts = (np.abs(off) > self.drift_m) | (self._opened > opened_m) | self.frozen
        self._drifts = (fits & ~back & drifts) | (self._drifts & ~received)
        believed = new | (fits & ~self._drifts)
        share = np.where(back, 1.0, self.dt / self.drift_s)
        corrected = Track(np.where(new, gap, first.gap + share * off), leader, first.credit_s)
        first = corrected.where(believed, first)
        second = self._second(reading, received & ~fits & ~new, fits, second)
        needed = np.where(second.gap < first.gap, self.nearer_s, self.farther_s)
        swap = received & ~fits & ~new & (second.credit_s > needed - 1e-9)
        swap &= np.abs(second.gap - first.gap) > self.drift_m
        before = first._replace(credit_s=np.full(len(gap), 2 * self.farther_s))
        first, second = reading.where(swap, first), before.where(swap, second)
        believed |= swap
        self._opened = np.where(swap | new, 0.0, self._opened)
        self._range = np.where(fits | swap | new, gap, np.nan)
        self._tracks = first, second
        self._lost_s = np.where(fits | believed, 0.0, self._lost_s + np.where(received, 0.0, self.dt))
        self.unseen_s = np.where(believed, 0.0, self.unseen_s + self.dt)
        closing = self._drifts & received & ~self.frozen & (off < 0)
        doubted = self.contradicted_s + np.where(received, self.dt, 0.0)
        self.contradicted_s = np.where(self._drifts & ~closing, doubted, 0.0)
        slow = np.maximum(np.minimum(leader, first.speed) + off / self.drift_s, 0.0)
        radar = np.where(believed | closing, gap, np.nan), np.where(closing, slow, leader)
        self.radar = radar[0], np.where(believed | closing, radar[1], np.nan)
        likely = (np.where(np.isnan(seen), kept, seen) for seen, kept in zip(self.radar, first, strict=False))
        return {**observation, **dict(zip(names, (*likely, speed), strict=True))}

    def _carried_on(self, speed: Array) -> tuple[Track, Track]:
        """Both tracks one step later, at constant speeds."""
        if self._tracks is None or len(self._tracks[0].gap) != len(speed):
            nowhere = np.full(len(speed), np.nan)
            self._tracks = Track(nowhere, nowhere, nowhere), Track(nowhere, nowhere, np.zeros(len(speed)))
            self._lost_s, self._drifts = np.zeros(len(speed)), np.zeros(len(speed), bool)
            self.unseen_s = np.full(len(speed), np.inf)
            self.contradicted_s, self._opened = np.zeros(len(speed)), np.zeros(len(speed))
            self._range = nowhere
            self._past = Past.nothing(len(speed))
        first, second = (t._replace(gap=t.gap + (t.speed - speed) * self.dt) for t in self._tracks)
        return first, second

    def _is_frozen(self, gap: Array, leader: Array, speed: Array) -> Flags:
        """Whether a range or speed that was noisy and never repeated itself has done so for `frozen_s`."""
        past, reading = self._past, np.stack([gap, leader])
        received = np.isfinite(gap + leader)
        same = received & (reading == past.last)
        change = reading - past.last
        rough = np.where(same, np.nan, np.abs(change - past.change))
        seen_s = np.minimum(past.seen_s + self.dt * np.isfinite(rough), self.noise_s)
        noise = past.noise + self.dt / np.maximum(seen_s, self.dt) * np.nan_to_num(rough - past.noise)
        same_s = np.where(same, past.same_s + self.dt, np.where(received, 0.0, past.same_s))
        over = received & ~same & (past.same_s > 0.0)
        fresh_s = np.where(over, 0.0, past.fresh_s + np.where(received & ~same, self.dt, 0.0))
        self._past = Past(reading, change, noise, seen_s, same_s, fresh_s)
        noisy = (fresh_s > self.fresh_s) & (noise > np.array([[self.noise_m], [self.noise_speed]]))
        frozen = (noisy & (same_s > self.frozen_s - 1e-9)).any(axis=0)
        return np.asarray(frozen & (speed > self.moving))

    def _second(self, reading: Track, elsewhere: Flags, fits: Flags, second: Track) -> Track:
        """The second track: a reading `elsewhere` agrees with it or replaces it; one that `fits` the first
        track reduces its count."""
        reach = np.where(second.credit_s > self.farther_s, self.jump_m, self.same_m)  # was it ever the first?
        agrees = np.abs(reading.gap - second.gap) <= reach
        agrees &= np.abs(reading.speed - second.speed) <= self.jump_speed
        followed = Track(second.gap, reading.speed, second.credit_s + self.dt)
        left = second.credit_s - self.dt
        gone = left < -1e-9  # a ghost that comes back begins anew
        less = Track(np.where(gone, np.nan, second.gap), second.speed, np.maximum(left, 0.0))
        return followed.where(elsewhere & agrees, reading.where(elsewhere, less.where(fits, second)))
