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


@dataclass
class Tracker:
    """Accepts readings that fit the track. Without a reading the leader is assumed to keep its speed.

    Range and speeds must agree: if the range deviates by more than `drift_m` from the integrated relative
    speed, the range or a speed is frozen or has the wrong sign. Such readings are not accepted; if the range
    decreases faster than the speeds say, the vehicle is assumed to be as near as the range says and as slow
    as its rate implies.

    A reading elsewhere starts a second track. It replaces the first one after readings have agreed with it
    for `nearer_s` if it is nearer (a cut-in, not a single false reading), for `farther_s` if not (a cut-out,
    not a lane change). The replaced track is accepted again at once for twice `farther_s`.

    After each call `radar` holds gap and leader speed as measured, NaN if not accepted; `unseen_s` the time
    since the last accepted reading, inf before the first; and `contradicted_s` the time for which readings
    have come whose range and speeds contradict each other; each (batch,).
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
    forget_s: float = 4.0  # after so long without a believed reading the next one begins a new track
    radar: tuple[Array, Array] = field(default_factory=lambda: (np.zeros(0), np.zeros(0)))
    unseen_s: Array = field(default_factory=lambda: np.zeros(0))
    contradicted_s: Array = field(default_factory=lambda: np.zeros(0))
    _tracks: tuple[Track, Track] | None = field(default=None, repr=False)
    _lost_s: Array = field(default_factory=lambda: np.zeros(0), repr=False)  # without any reading
    _drifts: Flags = field(default_factory=lambda: np.zeros(0, bool), repr=False)

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
        self._drifts = (fits & ~back & (np.abs(off) > self.drift_m)) | (self._drifts & ~received)
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
        self._tracks = first, second
        self._lost_s = np.where(fits | believed, 0.0, self._lost_s + np.where(received, 0.0, self.dt))
        self.unseen_s = np.where(believed, 0.0, self.unseen_s + self.dt)
        closing = self._drifts & received & (off < 0)
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
            self.contradicted_s = np.zeros(len(speed))
        first, second = (t._replace(gap=t.gap + (t.speed - speed) * self.dt) for t in self._tracks)
        return first, second

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
