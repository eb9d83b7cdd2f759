"""Classical car-following controllers behind the policy contract."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from deeptruck_cacc.controllers.law import Law, Perception, Seen
from deeptruck_cacc.controllers.mpc import mpc
from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.controllers.policy import Observation
from deeptruck_model.errors import InputError
from deeptruck_model.signals import TruckInterface

Array = NDArray[np.float64]


def acc(seen: Seen) -> Array:
    """PATH-type ACC: Milanes and Shladover (2014), Transp. Res. C 48, gains 0.23 1/s^2 and 0.07 1/s."""
    return 0.23 * seen.gap_error + 0.07 * (seen.leader_speed - seen.speed)


def cacc(seen: Seen) -> Array:
    """PATH-type CACC: gap error and its rate (0.45, 0.25), the leader's acceleration fed forward.

    Gains as Milanes and Shladover (2014) print them for the speed-step form, read as an acceleration law.
    """
    return 0.45 * seen.gap_error + 0.25 * (seen.leader_speed - seen.speed) + seen.leader_acceleration


def idm(seen: Seen) -> Array:
    """Intelligent driver model, Treiber, Hennecke and Helbing (2000): a 1.0, b 1.5 m/s2, s0 0 m, v0 40 m/s.

    Its equilibrium gap is wider than v Tg by 1 / sqrt(1 - (v/v0)^4); that is the model, not a tuning error.
    """
    closing = seen.speed - seen.leader_speed
    wanted = seen.target_gap + np.maximum(0.0, seen.speed * closing / (2 * np.sqrt(1.5)))
    return 1.0 - (seen.speed / 40.0) ** 4 - (wanted / np.maximum(seen.gap, 1.0)) ** 2


def pi(seen: Seen) -> Array:
    """PI on the gap with speed error and leader acceleration fed forward."""
    error = np.clip(seen.gap_error, -10.0, 10.0)
    speed_error = seen.leader_speed - seen.speed
    return 0.12 * error + 0.5 * speed_error + 0.02 * seen.integral + 0.7 * seen.leader_acceleration


LAWS: dict[str, Law] = {"acc": acc, "cacc": cacc, "idm": idm, "pi": pi, "mpc": mpc}


@dataclass
class Baseline:
    """A law of following over a pedal map, with a slow correction of the acceleration it did not get."""

    law: Law
    pedals: PedalMap
    interface: TruckInterface
    dt: float = 0.1
    comfort: tuple[float, float] = (-3.5, 1.5)  # m/s^2; the shield, not the law, brakes harder
    correction_per_s: float = 0.3
    _past: tuple[Array, Array] | None = field(default=None, repr=False)

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
            self._past = np.zeros(len(grade)), np.zeros(len(grade))
        correction, wanted = self._past
        # The acceleration requested one slow constant ago is what the slow ego rate should show now.
        off = wanted - seen.acceleration
        correction = np.clip(correction + self.correction_per_s * self.dt * off, -1.0, 1.0)
        now = np.clip(self.law(seen), *self.comfort)
        wanted = wanted + self.dt / self._perceive.slow_s * (now - wanted)
        self._past = correction, wanted
        engine, brake = self.pedals.commands(now + correction, seen.speed, grade)
        return engine, brake if self.interface.brake_unit else np.zeros_like(brake)


def baseline(
    name: str, interface: TruckInterface, pedals: PedalMap | None = None, dt: float = 0.1
) -> Baseline:
    """A baseline by name, over a calibrated pedal map or the nominal one.

    Raises InputError for an unknown name.
    """
    if name not in LAWS:
        raise InputError(f"there is no baseline '{name}'; known: {', '.join(LAWS)}")
    return Baseline(LAWS[name], pedals or PedalMap.nominal(interface), interface, dt)
