"""Maps between the signals and a policy network: features of order one as input, scaled actions as output.

Features are computed by numpy in a controller and by torch in training, by the same lines.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from deeptruck_cacc.controllers.approach import approach
from deeptruck_cacc.controllers.radar_filter import RadarFilter, library
from deeptruck_core.arrays import Array
from deeptruck_core.constants import ROUNDED_GRAVITY
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface

OBSERVED = ("leader_speed", "speed", "gap", "target_time_gap", "grade")  # keys of an observation

# Invertible map of the paper's five signals: differences first, because the errors are what must go to zero.
_MATRIX = np.array(
    [
        [1.0, -1.0, 0.0, 0.0, 0.0],  # speed error, m/s
        [0.0, 1 / 7.0, 0.0, 0.0, 0.0],  # speed about 15 m/s
        [0.0, 0.0, 0.5, -0.5, 0.0],  # gap error, in 2 m
        [0.0, 0.0, 0.0, 1 / 30.0, 0.0],  # target gap about 50 m
        [0.0, 0.0, 0.0, 0.0, 1 / 0.03],  # grade, in 3 %
    ]
)
_OFFSET = np.array([0.0, -15 / 7.0, 0.0, -50 / 30.0, 0.0])

# Units of the other features, near one in following; the matrix has those of the paper's signals.
INTEGRAL_UNIT = 5.0  # m s
ACCELERATION_UNIT = 0.5  # m/s^2
GAP_UNIT = 2.0  # m
TIME_GAP_UNIT = 0.3  # s
POWER_UNIT = 8.0  # W/kg
LEAST_SPEED = 1.0  # m/s, as which less counts in a time gap, which nothing defines at standstill
TIME_GAPS = (1.0, 6.0)  # s, within which the wanted one is taken to lie
WANTED = (-2.0, 1.0)  # m/s^2, within which the acceleration lies that takes errors away
SPEED_HASTE = 2.0  # speed errors go in closing_s over this


def require(observation: Mapping[str, Any]) -> None:
    """Raises InputError for an observation that lacks a signal; the grade may be absent."""
    missing = [name for name in OBSERVED[:4] if name not in observation]
    if missing:
        raise InputError(f"observation lacks {', '.join(missing)}; a policy needs {', '.join(OBSERVED)}")


def observed(observation: Mapping[str, Any]) -> Array:
    """An observation's signals in the order of OBSERVED, (batch, 5).

    Entries may be scalars or (batch,); grade may be absent or NaN (a truck without the sensor) and counts
    as 0.
    """
    require(observation)
    observed = [np.asarray(observation[name], float) for name in OBSERVED[:4]]
    grade = np.nan_to_num(np.asarray(observation.get("grade", 0.0), float))
    return np.stack([np.atleast_1d(x) for x in np.broadcast_arrays(*observed, grade)], axis=-1)


def paper_signals(observation: Mapping[str, Any]) -> Array:
    """The paper's observation [v_leader, v_ego, gap, v_ego * Tg, grade], (batch, 5), as `observed`."""
    out = observed(observation)
    out[:, 3] *= out[:, 1]
    return out


POWER = (
    "ideal_acceleration",
    "ideal_speed_error",
    "ideal_gap_error",
    "time_gap_error",
    "wanted_acceleration",
    "wanted_power",
    "power",
    "engine_action",
    "brake_action",
)
# The ideal follower and the haste with which it is followed; speed errors go in half of closing_s. With less
# than 0.8 s brakes that have a dead zone tremble. With late commands the remembered one pulses least.
SUITED = {"closing_s": 1.6, "closing_share": 0.0, "approach": 1.0, "integral_rate": 1 / 6}
REMEMBERED = {"closing_s": 2.0, "closing_share": 0.1}


@dataclass(frozen=True)
class FeatureMap:
    """x = matrix @ signals + offset, and, with `memory`, three slow features of the past.

    Memory (batch, 3) is [integral of the clipped gap error (m s), slow leader speed, slow ego speed]; NaN in
    the slow speeds means 'not started'. The features are the scaled integral and the rates of change of the
    two speeds, which the paper's memoryless policy cannot know: they remove the steady-state error and detect
    a braking leader.

    With `power`, seven further features give the power needed to follow the ideal follower (see _power). With
    `approach`, the ideal follower has the speed of `approach` for the gap. Otherwise its speed is a state, v'
    = (v_leader - v) / Tg, started at the leader's speed: the only solution that keeps the time gap without a
    transient that decays with Tg. Memory (batch, 6) and features end with the slow actions: together with the
    resulting power they show load and wind. Gap errors beyond `knee_m` then count less in the integral, so
    that closing a gap does not wind it up.

    With `radar`, which needs `power`, all features use the filtered gap and leader speed. Memory (batch, 9)
    ends with the filter's track.

    Signals and memory are numpy arrays, or torch tensors if `matrix` and `offset` are.
    """

    matrix: Any
    offset: Any
    memory: bool = True
    dt: float = 0.1
    integral_clip_m: float = 2.0
    integral_limit: float = 30.0
    slow_s: float = 0.5
    power: bool = False
    knee_m: float = 1.0
    closing_s: float = 0.8  # errors from the ideal follower are wanted gone with this time constant
    closing_share: float = 0.1  # and this much of the time gap: near a long one, haste in speed costs more
    approach: float = 0.0  # m/s^2; policies of before it have none
    integral_rate: float = 0.0  # 1/s at which what lasts of the gap error is wanted gone
    radar: RadarFilter | None = None

    @classmethod
    def default(
        cls, *, memory: bool = True, dt: float = 0.1, power: bool = False, late: bool = False
    ) -> FeatureMap:
        """The map described at the top of this module. `power` needs memory and includes the radar filter.

        `late` is for commands that arrive up to 0.2 s late: the ideal follower's speed is then a state, and
        its errors decay more slowly, which avoids pulsing of the brake.
        """
        power = power and memory
        radar = RadarFilter.steady(dt) if power else None
        following = REMEMBERED if late else SUITED
        return cls(_MATRIX.copy(), _OFFSET.copy(), memory, dt, power=power, radar=radar, **following)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the features, in column order."""
        paper = ("speed_error", "speed", "gap_error", "target_gap", "grade")
        slow = ("gap_error_integral", "leader_acceleration", "acceleration") if self.memory else ()
        return (*paper, *slow, *(POWER if self.power else ()))

    @property
    def remembered(self) -> int:
        """Number of memory columns."""
        return 9 if self.radar else 6 if self.power else 3 if self.memory else 0

    def start(self, batch: int) -> Array:
        """Memory before the first observation, (batch, remembered)."""
        still = [0.0, np.nan, np.nan, np.nan, 0.0, 0.0, np.nan, np.nan, np.nan]
        return np.tile(still[: self.remembered], (batch, 1))

    def __call__(self, signals: Any, memory: Any) -> tuple[Any, Any]:
        """Features (batch, n) and the next memory, from signals (batch, 5) and memory."""
        xp, track = library(signals), memory[:, 6:]
        if self.radar:
            signals, track = self.radar(signals, track)
        features = signals @ self.matrix.T + self.offset
        if not self.memory:
            return features, memory
        speeds = signals[:, :2]
        slow = xp.where(xp.isnan(memory[:, 1:3]), speeds, memory[:, 1:3])
        error = signals[:, 2] - signals[:, 3]
        if self.power:
            error = error / (1 + (error / self.knee_m) ** 2)
        error = xp.clip(error, -self.integral_clip_m, self.integral_clip_m)
        integral = xp.clip(memory[:, 0] + self.dt * error, -self.integral_limit, self.integral_limit)
        rates = (speeds - slow) / self.slow_s
        parts = [features, integral[:, None] / INTEGRAL_UNIT, rates / ACCELERATION_UNIT]
        kept = [integral[:, None], slow + self.dt * rates]
        if self.power:
            ideal, pull, far = self._ideal(signals, memory[:, 3])
            parts += [self._power(signals, rates[:, 1], integral, ideal, pull, far), memory[:, 4:6]]
            kept += [(ideal + self.dt * pull)[:, None], memory[:, 4:6], track]
        return xp.concatenate(parts, 1), xp.concatenate(kept, 1)

    def remember(self, memory: Any, action: Any) -> Any:
        """Memory after an action (batch, 2), which updates the slow actions."""
        if not self.power:
            return memory
        xp, slow = library(memory), memory[:, 4:6]
        slow = slow + self.dt / self.slow_s * (xp.clip(action, -1.0, 1.0) - slow)
        return xp.concatenate([memory[:, :4], slow, memory[:, 6:]], 1)

    @staticmethod
    def _time_gap(signals: Any) -> Any:
        """Desired time gap (batch,), s, estimated as well as possible near standstill."""
        xp = library(signals)
        return xp.clip(signals[:, 3] / xp.clip(signals[:, 1], LEAST_SPEED, None), *TIME_GAPS)

    def _ideal(self, signals: Any, before: Any) -> tuple[Any, Any, Any]:
        """The ideal follower's speed, its acceleration and its excess gap, each (batch,).

        The excess gap is zero for the speed that suits the gap.
        """
        xp, (leader, speed, gap) = library(signals), signals.T[:3]
        time_gap = self._time_gap(signals)
        if self.approach:
            above, slope = approach(gap - time_gap * leader, time_gap, self.approach)
            return leader + above, slope * (leader - speed), xp.zeros_like(gap)
        ideal = xp.where(xp.isnan(before), leader, before)
        return ideal, (leader - ideal) / time_gap, gap - time_gap * ideal

    def _power(self, signals: Any, rate: Any, integral: Any, ideal: Any, pull: Any, far: Any) -> Any:
        """Features of the required power, (batch, 7), from signals, the truck's slow acceleration, the
        integral of the gap error and the results of _ideal, each (batch,).

        The ideal acceleration (in 0.5 m/s^2), speed error (m/s) and gap error (in 2 m); the time-gap error
        (s), with a fine resolution near zero; the acceleration that also removes the errors; and power (in 8
        W/kg), required and delivered, since an engine command is nearly a power.
        """
        xp, (_, speed, gap, target, grade) = library(signals), signals.T
        time_gap = self._time_gap(signals)
        behind, lasting = ideal - speed, self.integral_rate * integral / time_gap
        closing = self.closing_s + self.closing_share * time_gap
        wanted = xp.clip(pull + (SPEED_HASTE * (behind + lasting) + far / closing) / closing, *WANTED)
        late = xp.tanh((gap - target) / xp.clip(speed, LEAST_SPEED, None) / TIME_GAP_UNIT)
        powers = [(x + ROUNDED_GRAVITY * grade) * speed / POWER_UNIT for x in (wanted, rate)]
        accelerations = pull / ACCELERATION_UNIT, wanted / ACCELERATION_UNIT
        return xp.stack([accelerations[0], behind, far / GAP_UNIT, late, accelerations[1], *powers], 1)

    def to_dict(self) -> dict[str, Any]:
        """Content for policy.json."""
        return {**asdict(self), "matrix": self.matrix.tolist(), "offset": self.offset.tolist()}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> FeatureMap:
        """Inverse of to_dict."""
        arrays = {name: np.array(data[name]) for name in ("matrix", "offset")}
        radar = data.get("radar")  # policies of before it have none
        return cls(**{**data, **arrays, "radar": radar and RadarFilter.from_dict(radar)})


# Reach of a heavy truck's commands, for simulators that do not state their own `command_range`.
_ENGINE_REACH = {
    "N m": (0.0, 2000.0),
    "percent": (0.0, 100.0),
    "g/s": (0.0, 18.0),
    "cm^3/s": (0.0, 21.0),
}
_BRAKE_REACH = {"percent": 100.0, "m/s^2": 6.0, "bar": 8.0, None: 0.0}


@dataclass(frozen=True)
class ActionScale:
    """Maps actions in [-1, 1] to commands in the interface's units: the engine's range, and the brake for
    positive values.

    If `exclusive`, the common part of engine and brake is subtracted from both, so that never both act.
    """

    engine_low: float
    engine_high: float
    brake_high: float
    exclusive: bool = False

    @classmethod
    def of(cls, simulator: Any) -> ActionScale:
        """Range of a simulator (or a bare TruckInterface): its `command_range`, if it has one."""
        interface: TruckInterface = getattr(simulator, "interface", simulator)
        low, high = _ENGINE_REACH[interface.engine_unit]
        stated = getattr(simulator, "command_range", {})
        low, high = stated.get("engine_command", (low, high))
        brake = stated.get("brake_command", (0.0, _BRAKE_REACH[interface.brake_unit]))[1]
        return cls(float(max(low, 0.0)), float(high), float(brake))

    @property
    def possible(self) -> bool:
        """Whether the ranges are possible for a truck."""
        ends = (self.engine_low, self.engine_high, self.brake_high)
        return all(map(math.isfinite, ends)) and self.engine_low < self.engine_high and self.brake_high >= 0

    def commands(self, action: Array) -> Array:
        """Commands (batch, 2) from actions (batch, 2), which are clipped to [-1, 1]."""
        action = np.clip(action, -1.0, 1.0)
        engine, brake = (action[:, 0] + 1) / 2, np.maximum(action[:, 1], 0.0)
        if self.exclusive:
            engine, brake = np.maximum(engine - brake, 0.0), np.maximum(brake - engine, 0.0)
        reach = self.engine_high - self.engine_low
        return np.column_stack([self.engine_low + engine * reach, brake * self.brake_high])

    @property
    def limits(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Lowest and highest (engine, brake)."""
        return (self.engine_low, 0.0), (self.engine_high, self.brake_high)

    def within(self, commands: Array) -> Array:
        """Commands (batch, 2) limited to their ranges."""
        return np.clip(commands, *self.limits)

    def actions(self, commands: Array) -> Array:
        """Actions (batch, 2) that give the commands; a released brake is 0."""
        engine = 2 * (commands[:, 0] - self.engine_low) / (self.engine_high - self.engine_low) - 1
        return np.column_stack([engine, commands[:, 1] / max(self.brake_high, 1e-12)])
