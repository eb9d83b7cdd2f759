"""The guard that the controller node runs: policy, tracker for missing radar readings, hand-over to a
baseline, shield.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_cacc.controllers.approach import cruise
from deeptruck_cacc.controllers.baselines import baseline
from deeptruck_cacc.controllers.loading import load_policy
from deeptruck_cacc.controllers.policy import TYPICAL, MlpPolicy, Observation, Policy
from deeptruck_cacc.controllers.scaling import OBSERVED, ActionScale, require
from deeptruck_cacc.safety.assumptions import Assumptions
from deeptruck_cacc.safety.shield import Shield
from deeptruck_cacc.safety.track import Tracker
from deeptruck_cacc.safety.truck_limits import STEEPEST, known, measure
from deeptruck_core.arrays import Array, Mask
from deeptruck_core.signals import CHANNELS, TruckInterface
from deeptruck_model import simulators


def _array(value: Any) -> Array:
    """An array whose entries are finite or NaN; infinite ones are treated as not measured."""
    out = np.atleast_1d(np.asarray(value, float))
    return np.where(np.isfinite(out), out, np.nan)


@dataclass
class LastSeen:
    """Replaces signals of the truck that are not finite by their last value.

    Settings and slope may be kept indefinitely, the speed for `hold_s`. A speed that changed faster than any
    truck can is treated as missing.
    """

    dt: float
    hold_s: float = 1.0
    jump_speed: float = 1.0  # m/s, from one reading to the next
    fastest: float = 12.0  # m/s^2, by which a speed changes
    speed: Array = field(default_factory=lambda: np.zeros(0))  # as received, else NaN
    silent: Mask = field(default_factory=lambda: np.zeros(0, bool))  # speed: for longer, or never received
    _last: dict[str, Array] = field(default_factory=dict, repr=False)
    _waited: Array = field(default_factory=lambda: np.zeros(0), repr=False)

    def reset(self) -> None:
        """Forget the past."""
        self._last, self._waited = {}, np.zeros(0)

    def __call__(self, observation: Mapping[str, Array]) -> dict[str, Array]:
        """The observation, each (batch,), with gaps filled; NaN only for signals that were never received."""
        batch = len(observation["speed"])
        if len(self._waited) != batch:
            self._last, self._waited = {}, np.full(batch, np.inf)
        speed = observation["speed"]
        most = self.jump_speed + self.fastest * np.minimum(self._waited + self.dt, self.hold_s)
        received = np.isfinite(speed) & ~(np.abs(speed - self._last.get("speed", speed)) > most)
        self.speed = np.where(received, speed, np.nan)
        observation = {**observation, "speed": self.speed}
        self._waited = np.where(received, 0.0, self._waited + self.dt)
        self.silent = self._waited > self.hold_s
        own = {n: observation[n] for n in ("speed", "target_time_gap", "grade") if n in observation}
        self._last = {n: np.where(np.isnan(x), self._last.get(n, x), x) for n, x in own.items()}
        return {**observation, **self._last}


@dataclass
class Guard:
    """A policy made fit for a truck. Same contract as Policy; `acted` marks where the shield overrode.

    `fallback_drives` (batch,) marks where the fallback drove: outside the policy's coverage (until 3 s inside
    again), or where its commands were not finite.

    Policy and fallback get finite numbers only, so that their memory holds no NaN. If the speed is missing
    for over a second, or a signal was never received, their commands are not used: the shield brakes gently.
    """

    policy: Policy
    fallback: Policy
    shield: Shield | None
    coverage: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    standstill_m: float = 6.0
    set_speed: float = math.inf  # m/s, faster than which nobody is followed
    acted: Mask = field(default_factory=lambda: np.zeros(0, bool))
    fallback_drives: Mask = field(default_factory=lambda: np.zeros(0, bool))
    _tracker: Tracker = field(init=False, repr=False)
    _last_seen: LastSeen = field(init=False, repr=False)
    _away: Array | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        self._tracker, self._last_seen = Tracker(self.policy.dt), LastSeen(self.policy.dt)

    @property
    def unseen_s(self) -> Array:
        """Time since the last accepted radar reading, s (batch,); inf if there was none."""
        return self._tracker.unseen_s

    @property
    def contradicted_s(self) -> Array:
        """Time for which the radar's range and the speeds have contradicted each other, s (batch,)."""
        return self._tracker.contradicted_s

    @property
    def own_speed_factor(self) -> Array:
        """Share by which the truck's own speed is too high (worn tyres), (batch,), as learned so far."""
        return self._tracker.own_speed_factor

    @property
    def room_m(self) -> Array:
        """Distance to the shield's limit, m (batch,): positive where braking may wait; NaN without a shield
        or before the first reading."""
        room = np.full(len(self.unseen_s), np.nan) if self.shield is None else self.shield.room_m
        return np.where(np.isfinite(room), room, np.nan)

    @property
    def needed_braking(self) -> Array:
        """Constant deceleration, m/s^2 (batch,), with which the truck stops short of every object, each
        going on as it was last seen to; 0 without a shield."""
        if self.shield is None:
            return np.zeros(len(self.unseen_s))
        return self._tracker.needed_braking(self.shield.assumed.d_safety)

    @property
    def possible_braking(self) -> Array:
        """The same, m/s^2 (batch,), had an object that is no longer seen braked on to a standstill."""
        if self.shield is None:
            return np.zeros(len(self.unseen_s))
        return self._tracker.needed_braking(self.shield.assumed.d_safety, math.inf)

    @property
    def brake_gain(self) -> Array:
        """Share of the promised deceleration that the brakes give, (batch,), as learned so far."""
        batch = len(self.unseen_s)
        return np.ones(batch) if self.shield is None else self.shield.brakes.gain_of(batch)

    @property
    def brakes_failed(self) -> Mask:
        """Where the brakes give so little of it that nobody may rely on them, (batch,)."""
        batch = len(self.unseen_s)
        return np.zeros(batch, bool) if self.shield is None else self.shield.brakes.failed

    @property
    def radar_is_frozen(self) -> Mask:
        """Where a noisy radar has repeated a reading for so long that it is frozen, (batch,)."""
        return self._tracker.frozen

    @property
    def speed_is_silent(self) -> Mask:
        """Where the truck's own speed has been missing for over a second."""
        return self._last_seen.silent

    @property
    def interface(self) -> TruckInterface:
        """The interface of the policy."""
        return self.policy.interface

    @property
    def dt(self) -> float:
        """The time step of the policy."""
        return self.policy.dt

    def reset(self) -> None:
        """Reset the state, with cold brakes."""
        self._forget()
        self._tracker.reset()
        if self.shield is not None:
            self.shield.reset()

    def forget(self) -> None:
        """Reset the state but keep the brake temperature; the last command was not obeyed."""
        self._forget()
        if self.shield is not None:
            self.shield.forget()

    def spare(self) -> None:
        """Note that the last command was not obeyed, and so heated no brakes."""
        if self.shield is not None:
            self.shield.spare()

    def _forget(self) -> None:
        for part in (self.policy, self.fallback, self._last_seen):
            part.reset()
        self._tracker.forget()
        self._away = None

    def act(self, observation: Observation) -> tuple[Array, Array]:
        """(engine_command, brake_command) in the interface's units, each (batch,).

        Raises InputError for an observation that lacks a signal.
        """
        raw = self._arrays(observation)
        seen, unknown = self._filled(raw)
        # A truck without a grade sensor has no slope, whatever stands in its place for the policy.
        grade = raw["grade"] if "grade" in raw and self.interface.grade else np.full(len(unknown), np.nan)
        if self.shield is not None:
            track = self._tracker
            speed = np.maximum(self._last_seen.speed, self._last_seen.speed * (1.0 - track.own_speed_factor))
            self.shield.see(*track.readings, speed, grade, track.counts, track.came_from)
        # Near standstill a time gap is no distance: the truck then aims for `standstill_m`.
        # Nor does it aim for a gap at which the shield would act: the two would drive against each other.
        least = np.full(len(unknown), self.standstill_m)
        if self.shield is not None:
            least = np.maximum(least, self.shield.steady_gap(seen["speed"]))
        seen["target_time_gap"] = np.maximum(seen["target_time_gap"], least / np.maximum(seen["speed"], 0.5))
        seen |= cruise(seen, self.set_speed)
        own = np.array(self.policy.act(seen))
        other = np.array(self.fallback.act(seen))
        self.fallback_drives = self._outside(seen) | ~np.isfinite(own).all(axis=0)
        engine, brake = np.where(unknown, np.nan, np.where(self.fallback_drives, other, own))
        if self.shield is None:
            self.acted = np.zeros(len(engine), bool)
            return engine, brake
        engine, brake = self.shield.gentle(engine, brake, grade)
        engine, brake = self.shield.limit(engine, brake, grade)
        self.acted = self.shield.acted
        return engine, brake

    @staticmethod
    def _arrays(observation: Observation) -> dict[str, Array]:
        """Each signal (batch,), NaN if outside the range of the channel; gaps are positive."""
        require(observation)
        given = {n: _array(observation[n]) for n in OBSERVED if n in observation}
        for name in given.keys() & CHANNELS.keys():
            low, high = CHANNELS[name].low, CHANNELS[name].high
            given[name] = np.where((given[name] < low) | (given[name] > high), np.nan, given[name])
        for name in ("gap", "target_time_gap"):
            given[name] = np.where(given[name] > 0, given[name], np.nan)
        return dict(zip(given, np.broadcast_arrays(*given.values()), strict=True))

    def _filled(self, raw: Mapping[str, Array]) -> tuple[dict[str, Array], Mask]:
        """The signals with all NaN replaced, and where too few are known to drive."""
        seen = self._tracker(self._last_seen(raw))
        unknown = self._last_seen.silent.copy()
        for name in OBSERVED[:4]:
            never = np.isnan(seen[name])
            unknown |= never
            seen[name] = np.where(never, TYPICAL[name], seen[name])
        return seen, unknown

    def _outside(self, seen: Mapping[str, Any]) -> Mask:
        """Where a signal is, or was in the last 3 s, outside the coverage by more than a fifth of its
        span."""
        batch = len(seen["gap"])
        if self._away is None or len(self._away) != batch:
            self._away = np.zeros(batch)
        out = np.zeros(batch, bool)
        for name, (low, high) in self.coverage.items():
            value = np.asarray(seen.get(name, 0.0), float)
            margin = 0.2 * (high - low) + 1e-3
            out |= (value < low - margin) | (value > high + margin)
        self._away = np.where(out, 3.0, np.maximum(self._away - self.dt, 0.0))
        return np.asarray(self._away > 0)


def guard(
    policy: Policy,
    assumed: Assumptions | None = None,
    *,
    shield: bool = True,
    brake_limit: float = math.inf,
    brake_rate: float = math.inf,
) -> Guard:
    """A policy with tracker, hand-over and, unless `shield` is False, shield.

    The assumptions are the given ones, else those stored for a truck of this name, else the cautious default.
    Of a brake command no more than `brake_limit`, in its unit, reaches the brakes, rising by `brake_rate` a
    second: a ramp is a delay by half of it.
    """
    learned = policy if isinstance(policy, MlpPolicy) else None
    scale = learned.scale if learned else ActionScale.of(policy)
    assumed = assumed or known(policy.interface) or Assumptions()
    limit = min(brake_limit, scale.brake_high)
    response_s = assumed.response_s + 0.5 * limit / brake_rate
    assumed = replace(assumed, dt=policy.dt, limit_share=limit / scale.brake_high, response_s=response_s)
    stands = shield and policy.interface.brake_unit is not None
    return Guard(
        policy,
        baseline("acc", policy.interface, dt=policy.dt),
        Shield(assumed, scale.engine_low, scale.brake_high) if stands else None,
        learned.coverage if learned else {},
    )


def load_controller(
    path: str | Path,
    interface: TruckInterface | None = None,
    *,
    shield: bool = True,
    limits_of: str = "",
    limits_grade: float = STEEPEST,
    brake_limit: float = math.inf,
    brake_rate: float = math.inf,
) -> Guard:
    """The controller for a node: load_policy with a guard, whose assumptions are measured on the simulator
    `limits_of` if there is one, on descents to `limits_grade`, and hold for a bridge that lets pass
    `brake_limit` and `brake_rate`.

    Raises InputError if that cannot be loaded or does not brake.
    """
    assumed = measure(simulators.load(limits_of), worst_grade=limits_grade) if limits_of and shield else None
    policy = load_policy(path, interface)
    return guard(policy, assumed, shield=shield, brake_limit=brake_limit, brake_rate=brake_rate)
