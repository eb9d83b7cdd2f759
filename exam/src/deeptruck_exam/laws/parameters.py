"""Wrong simulator parameters, and effects that differ from drive to drive; neither are laws."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_exam.laws.catalogue import SIGN, Effect, Planted, register
from deeptruck_exam.laws.law import GRAVITY, Law, Setting, Sizes, State, moving
from deeptruck_model.trucks import View

WRONG = {  # (least, most) change over the true value; drives in which it shows; names that say the same
    "mass": ((0.15, 0.40), "suburban hills", "payload_change"),
    "drag_area": ((0.25, 0.60), "highway hills", "rolling_resistance_speed headwind"),
    "rolling_resistance": ((0.35, 0.80), "highway suburban", "grade_bias"),
    "torque_gain": ((0.10, 0.22), "hills highway", "driveline_loss"),
    "brake_gain": ((0.20, 0.45), "suburban descent", ""),
}


def _wrong(name: str, setting: Setting, p: Sizes) -> Planted:
    factor = 1.0 + np.sign(p.sign) * p.share
    return Planted(parameters={name: getattr(setting.truck, name) * factor})


for _name, (_share, _drives, _accepts) in WRONG.items():
    register(
        Effect(
            f"wrong_{_name}",
            _name,
            "parameter_error",
            "The simulator's own parameter is off; no physics is missing",
            {"share": _share, "sign": SIGN},
            partial(_wrong, _name),
            tuple(_drives.split()),
            accepts=tuple(_accepts.split()),
        )
    )


class EachDrive(Law):
    """One number drawn for every drive, held-out ones included: `of_drive` (batch,)."""

    def prepare(self) -> None:
        self.of_drive = self.rng(60).normal(0.0, 1.0, self.setting.batch)


class LoadOfTheDrive(EachDrive):
    """Another mass in each drive. Source: Newton's second law."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        extra = p.size * np.clip(self.of_drive, -1.5, 2.0) * view.mass
        rolling = self.truck.rolling_resistance * GRAVITY
        return -extra * (view.acceleration + GRAVITY * view.grade + rolling) * moving(view)


class WindOfTheDrive(EachDrive):
    """A steady head or tail wind in each drive. Source: drag with the square of the airspeed."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        air = np.maximum(view.speed + p.size * np.clip(self.of_drive, -2.0, 2.0), 0.0)
        factor = (air / np.maximum(view.speed, 1.0)) ** 2
        return -(factor - 1.0) * view.drag_force * np.clip(view.speed / 2.0, 0.0, 1.0)


class TemperatureOfTheDrive(EachDrive):
    """Colder or warmer tyres and air in each drive. size: K, one standard deviation.
    Source: ISO 28580, correction to 25 degC by 0.6 to 1 % per K, by class of tyre; air density with absolute
    temperature."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        kelvin = p.size * self.of_drive
        colder = np.exp(-0.008 * kelvin) - 1.0
        denser = 288.0 / np.maximum(288.0 + kelvin, 230.0) - 1.0
        return -(colder * view.rolling_force + denser * view.drag_force) * moving(view)


EACH_DRIVE = {  # sizes; names that say what differs
    LoadOfTheDrive: ((0.12, 0.25), "payload_change", "mass"),
    WindOfTheDrive: ((3.0, 7.0), "headwind", "drag_area"),
    TemperatureOfTheDrive: ((18.0, 35.0), "rolling_resistance_warmup", "rolling_resistance drag_area"),
}


def _of_each_drive(part: type[EachDrive], setting: Setting, p: Sizes) -> Planted:
    return Planted(forces=(part(setting, p),))


def each_drive() -> list[Effect]:
    """Effects that may differ from drive to drive. They are separate from the registered laws."""
    return [
        Effect(
            part.__name__,
            name,
            "missing_physics",
            " ".join((part.__doc__ or "").partition("Source:")[2].split()),
            {"size": size},
            partial(_of_each_drive, part),
            accepts=tuple(accepts.split()),
        )
        for part, (size, name, accepts) in EACH_DRIVE.items()
    ]
