"""Classical car-following controllers behind the policy contract."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from deeptruck_cacc.controllers.approach import approach
from deeptruck_cacc.controllers.law import LEAST_SPEED, Law, Perception, Seen
from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.controllers.policy import Observation
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface


def acc(seen: Seen) -> Array:
    """PATH-type ACC: Milanes and Shladover (2014), Transp. Res. C 48, gains 0.23 1/s^2 and 0.07 1/s.

    40 m beyond the gap it requests 9 m/s^2; far behind, `Baseline` limits this.
    """
    return 0.23 * seen.gap_error + 0.07 * (seen.leader_speed - seen.speed)


def cacc(seen: Seen) -> Array:
    """PATH-type CACC: gap error and its rate (0.45, 0.25), with feed-forward of the leader's acceleration.

    Gains as Milanes and Shladover (2014) print them for the speed-step form, used as an acceleration law.
    Limited far behind, as `acc` is.
    """
    return 0.45 * seen.gap_error + 0.25 * (seen.leader_speed - seen.speed) + seen.leader_acceleration


def idm(seen: Seen) -> Array:
    """Intelligent driver model, Treiber, Hennecke and Helbing (2000): a 1.0, b 1.5 m/s2, s0 0 m, v0 40 m/s.

    Its equilibrium gap exceeds v Tg by the factor 1 / sqrt(1 - (v/v0)^4), which is a property of the model.
    """
    closing = seen.speed - seen.leader_speed
    wanted = seen.target_gap + np.maximum(0.0, seen.speed * closing / (2 * np.sqrt(1.5)))
    return 1.0 - (seen.speed / 40.0) ** 4 - (wanted / np.maximum(seen.gap, 1.0)) ** 2


def pi(seen: Seen) -> Array:
    """PI control of the gap with feed-forward of speed error and leader acceleration."""
    error = np.clip(seen.gap_error, -10.0, 10.0)
    speed_error = seen.leader_speed - seen.speed
    return 0.12 * error + 0.5 * speed_error + 0.02 * seen.integral + 0.7 * seen.leader_acceleration


# How a law may close in. At its gap and the leader's speed it may still ask for CREEP / CLOSING_S = 1 m/s^2,
# so that cacc follows a leader that speeds up. How hard acc and idm brake after drop-outs of 6 s hardly
# depends on them: by 0.6 m/s^2 at most with CREEP from 0 to 1 m/s and CLOSING_S from 0.5 to 2 s.
CREEP = 1.0  # m/s above the leader's speed
CLOSING_S = 1.0  # s, time constant towards the speed that is allowed
# Behind a leader that stands the truck comes to rest and is held by the brake alone: a law on the gap would
# creep up to it by engine and brake in turn. The constants are ours.
LEADER_STANDS_M_S = 0.5  # ten times the usual radar's noise of speed
STOPS_M_S, STOPS_SHORT_M = (
    2.0,
    8.0,
)  # own speed and distance to the wanted gap, below which it does
TO_REST_M_S2 = (0.3, 0.8)  # deceleration with which it comes to rest
AT_REST_M_S = 0.2  # own speed below which the brake holds
HOLDS_M_S2 = 0.6  # beyond what the slope asks for
LEAST_TIME_GAP_S = 0.5  # as which less counts: `approach` divides by it, and at standstill it is 0

LAWS: dict[str, Law] = {"acc": acc, "cacc": cacc, "idm": idm, "pi": pi}


@dataclass
class Baseline:
    """A following law with a pedal map, and a slow correction for acceleration that the truck did not reach.

    Far behind, `approach` limits the closing speed of every law to one from which it can decelerate in time,
    whatever the engine can do.
    """

    law: Law
    pedals: PedalMap
    interface: TruckInterface
    dt: float = 0.1
    comfort: tuple[float, float] = (-3.5, 1.5)  # m/s^2; the shield, not the law, brakes harder
    approach: float = 0.3  # m/s^2
    correction_per_s: float = 0.3
    _past: tuple[Array, Array, Array] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        self._perceive = Perception(self.dt)

    def reset(self) -> None:
        """Forget the past."""
        self._perceive.reset()
        self._past = None

    def act(self, observation: Observation) -> tuple[Array, Array]:
        """(engine_command, brake_command) in the interface's units, each (batch,)."""
        seen, grade = self._perceive(observation)
        if self._past is None or len(self._past[0]) != len(grade):
            self._past = np.zeros(len(grade)), np.zeros(len(grade)), np.zeros(len(grade))
        correction, wanted, at_end = self._past
        # The acceleration requested one slow constant ago is what the slow ego rate should show now. What a
        # pedal at its end (1: engine, -1: brake) does not give is no error of the map, nor what a truck that
        # is held at rest does not.
        off = wanted - seen.acceleration
        off = np.where((off * at_end > 0) | (seen.speed < LEAST_SPEED), 0.0, off)
        correction = np.clip(correction + self.correction_per_s * self.dt * off, -1.0, 1.0)
        now = np.clip(np.minimum(self.law(seen), self._closing_in(seen)), *self.comfort)
        wanted = wanted + self.dt / self._perceive.slow_s * (now - wanted)
        stops = self._stops(seen)
        now = np.where(stops, self._to_rest(seen), now)
        engine, brake = self.pedals.commands(now + correction, seen.speed, grade)
        scale = self.pedals.scale
        held = self.pedals.commands(np.full(len(grade), -HOLDS_M_S2), np.zeros(len(grade)), -np.abs(grade))[1]
        engine = np.where(stops, scale.engine_low, engine)
        brake = np.where(stops & (seen.speed < AT_REST_M_S), np.maximum(brake, held), brake)
        at_end = np.where(engine >= scale.engine_high, 1.0, np.where(brake >= scale.brake_high, -1.0, 0.0))
        self._past = correction, wanted, at_end
        return engine, brake if self.interface.brake_unit else np.zeros_like(brake)

    @staticmethod
    def _stops(seen: Seen) -> NDArray[np.bool_]:
        """Whether the truck comes to rest behind a standing leader, or is held there, (batch,)."""
        slow = (seen.leader_speed < LEADER_STANDS_M_S) & (seen.speed < STOPS_M_S)
        return np.asarray(slow & (seen.gap_error < STOPS_SHORT_M))

    @staticmethod
    def _to_rest(seen: Seen) -> Array:
        """Acceleration with which it rests at its gap, m/s^2."""
        needed = seen.speed**2 / (2 * np.maximum(seen.gap_error, 0.1))
        return np.asarray(-np.clip(needed, *TO_REST_M_S2))

    def _closing_in(self, seen: Seen) -> Array:
        """Upper limit of the acceleration: that towards the speed with which `approach` ends at the desired
        gap."""
        time_gap = np.maximum(seen.time_gap, LEAST_TIME_GAP_S)
        far = np.maximum(seen.gap - time_gap * seen.leader_speed, 0.0)
        above = np.maximum(approach(far, time_gap, self.approach)[0], CREEP)
        return np.asarray((seen.leader_speed + above - seen.speed) / CLOSING_S)


def baseline(
    name: str, interface: TruckInterface, pedals: PedalMap | None = None, dt: float = 0.1
) -> Baseline:
    """A baseline by name, over a calibrated pedal map or the nominal one.

    Raises InputError for an unknown name.
    """
    if name not in LAWS:
        raise InputError(f"there is no baseline '{name}'; known: {', '.join(LAWS)}; or use planner:SIM")
    return Baseline(LAWS[name], pedals or PedalMap.nominal(interface), interface, dt)
