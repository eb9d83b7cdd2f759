"""Trucks of other origin: the reference pool with body, engine, gearing, brakes and load drawn anew."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np

from deeptruck_exam.effects.law import Array
from deeptruck_model import trucks
from deeptruck_model.trucks import PhysicsTruck

TUNABLE = ("mass", "drag_area", "rolling_resistance", "torque_gain", "brake_gain")
SPREAD = {  # factor ranges about the reference truck
    "drag_area": (0.8, 1.25),
    "rolling_resistance": (0.75, 1.35),
    "wheel_radius": (0.94, 1.06),
    "wheel_inertia": (0.8, 1.3),
    "engine_inertia": (0.8, 1.3),
    "full_load_gain": (0.85, 1.15),
    "friction_constant": (0.8, 1.3),
    "friction_quadratic": (0.8, 1.3),
    "accessory_power": (0.6, 1.8),
    "boost_lag": (0.6, 1.4),
    "engine_brake_torque": (0.8, 1.2),
    "indicated_efficiency": (0.94, 1.04),
    "driveline_efficiency": (0.98, 1.02),
    "final_drive": (0.9, 1.12),
    "shift_time": (0.7, 1.3),
    "front_brake_torque": (0.85, 1.2),
    "rear_brake_torque": (0.85, 1.2),
    "brake_lag": (0.8, 1.4),
    "brake_lag_rear": (0.8, 1.4),
    "brake_heat_capacity": (0.85, 1.2),
}
WITH_SIZE = {  # what a truck bought for heavy work has more of: share of the range that its size decides
    **dict.fromkeys(("full_load_gain", "engine_inertia", "engine_brake_torque"), 0.6),
    **dict.fromkeys(("front_brake_torque", "rear_brake_torque", "brake_heat_capacity"), 0.7),
    **dict.fromkeys(("friction_constant", "wheel_inertia"), 0.5),
    "drag_area": 0.4,
}
WITH_AGE = {  # what rises (or falls) as a truck grows old
    **dict.fromkeys(("friction_constant", "friction_quadratic", "boost_lag", "shift_time"), 0.7),
    **dict.fromkeys(("brake_lag", "brake_lag_rear", "rolling_resistance"), 0.6),
    **dict.fromkeys(("driveline_efficiency", "indicated_efficiency"), -0.8),
    "drag_area": 0.4,
}
CATALOGUE = {  # lines of a catalogue: bodies, labels of tyres, ratings, axles, treads, brakes
    "drag_area": (0.86, 0.92, 1.0, 1.06, 1.2),
    "rolling_resistance": (0.78, 0.88, 1.0, 1.13, 1.28),
    "full_load_gain": (0.88, 0.95, 1.0, 1.07, 1.14),
    "final_drive": (0.92, 0.96, 1.0, 1.05, 1.11),
    "wheel_radius": (0.96, 0.984, 1.0, 1.012, 1.04),
    "brake_heat_capacity": (0.9, 1.0, 1.14),
}
SHIFT_SPEEDS = ("upshift_low", "upshift_high", "downshift_low", "downshift_high")
# factors of a truck specified for a vocation: mass, drag, rolling resistance, full load, axle, shift speeds
VOCATIONS = {
    "freightliner": (
        (0.95, 0.9, 1.0, 1.0, 1.0, 1.0), (1.5, 1.25, 1.1, 1.05, 1.1, 1.05), (1.9, 1.35, 1.2, 0.9, 1.2, 1.1)
    ),
    "trucksim": (
        (0.65, 0.8, 0.95, 0.85, 0.95, 1.0), (1.25, 1.1, 0.85, 1.1, 0.85, 0.93),
        (1.7, 1.2, 1.25, 1.2, 1.15, 1.05),
    ),
    "volvo": (
        (0.5, 1.1, 1.05, 0.9, 1.0, 1.0), (1.1, 0.85, 0.85, 1.0, 0.8, 0.93), (1.45, 1.15, 1.15, 1.15, 1.2, 1.0)
    ),
}  # fmt: skip
EMPTY_TO_FULL = {"freightliner": (0.8, 1.9), "trucksim": (0.58, 1.8), "volvo": (0.47, 1.5)}


@dataclass(frozen=True)
class Fleet:
    """How the trucks of a world are drawn. `shape` of the symmetric beta law within SPREAD (1: uniform);
    `tied` shares of a part's range that one number of the truck decides; `lines` that are chosen from;
    `loads` mass over the reference: (lowest, highest) or the loads there are; `load_shape` of its law."""

    shape: float = 1.0
    tied: Mapping[str, float] = field(default_factory=dict)
    lines: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    vocations: bool = False
    loads: Mapping[str, tuple[float, ...]] = field(default_factory=lambda: EMPTY_TO_FULL)
    load_shape: float = 1.0
    highest_m: float = 0.0  # home, above the sea

    def draw(self, name: str, rng: np.random.Generator) -> dict[str, float]:
        """Overrides that make a random truck of the kind `name`, rounded to five figures."""
        reference = _reference(name)
        factors = self._parts(rng)
        factors["mass"] = self._load(name, rng)
        if self.vocations:
            factors |= _vocation(name, rng)
        values = {part: float(f"{reference[part] * factor:.5g}") for part, factor in factors.items()}
        warm, height = rng.uniform(-10.0, 33.0), rng.uniform(0.0, self.highest_m)
        values["ambient_temperature"] = float(np.round(warm, 1))
        density = 1.225 * np.exp(-height / 8400.0) * 288.0 / (273.0 + warm)
        values["air_density"] = float(f"{density:.4g}")
        values["brake_controller_mass"] = values["mass"]
        return values

    def _parts(self, rng: np.random.Generator) -> dict[str, float]:
        common, factors = rng.random(), {}
        for part, (low, high) in SPREAD.items():
            tie = self.tied.get(part, 0.0)
            led = common if tie > 0.0 else 1.0 - common
            where = abs(tie) * led + (1.0 - abs(tie)) * rng.beta(self.shape, self.shape)
            factors[part] = low + (high - low) * where
        for part, lines in self.lines.items():
            factors[part] = float(rng.choice(lines)) * rng.normal(1.0, 0.01)
        return factors

    def _load(self, name: str, rng: np.random.Generator) -> float:
        loads = self.loads[name]
        if len(loads) > 2:
            return float(rng.choice(loads)) * rng.uniform(0.98, 1.02)
        return float(loads[0] + (loads[1] - loads[0]) * rng.beta(self.load_shape, self.load_shape))


@cache
def _reference(name: str) -> Mapping[str, float]:
    return trucks.load(name).parameters()


def _vocation(name: str, rng: np.random.Generator) -> dict[str, float]:
    """Factors of parts that were specified together: body, engine rating and axle."""
    parts = ("mass", "drag_area", "rolling_resistance", "full_load_gain", "final_drive")
    chosen = np.array(VOCATIONS[name][rng.integers(3)]) * rng.uniform(0.95, 1.05, 6)
    shifts = float(np.clip(chosen[5], 0.9, 1.1))
    return {**dict(zip(parts, chosen[:5].tolist(), strict=True)), **dict.fromkeys(SHIFT_SPEEDS, shifts)}


def make(name: str, values: Mapping[str, float], *, grade: bool = True) -> PhysicsTruck:
    """The truck with these parameters, with or without the grade among its inputs."""
    truck = trucks.load(name).with_parameters(values)
    if grade:
        return truck.with_grade_input()
    blind = replace(truck.specification, interface=replace(truck.interface, grade=False))
    return PhysicsTruck(blind)


def overrides(values: Mapping[str, float], grade: bool) -> dict[str, Any]:
    """What the overrides file of the simulator holds."""
    return {**{n: float(v) for n, v in values.items()}, "interface": {"grade": grade}}


def namespace(truck: PhysicsTruck) -> SimpleNamespace:
    """Parameters, with peak_torque (N m), peak_power (W) and full_command (interface units) beside them."""
    values = truck.parameters()
    speeds, torques = (np.asarray(a) for a in truck.specification.full_load)
    peak = float(values["full_load_gain"] * torques.max())
    friction = values["friction_constant"] + 160.0 * values["friction_linear"]
    scale = values["reference_torque"] / 100.0 if truck.interface.engine_unit == "percent" else 1.0
    return SimpleNamespace(
        **values,
        peak_torque=peak,
        peak_power=float(values["full_load_gain"] * (speeds * torques).max()),
        full_command=(peak + friction) / scale,
        command_scale=scale,
        by_deceleration=truck.interface.brake_unit == "m/s^2",
        brake_capacity=brake_capacity(values),
    )


def brake_capacity(values: Mapping[str, float]) -> float:
    """Brake force at full pressure, N."""
    torque = (
        values["front_wheels"] * values["front_brake_torque"]
        + values["rear_wheels"] * values["rear_brake_torque"]
    )
    return float(torque / values["wheel_radius"])


def motoring(t: SimpleNamespace, engine_speed: Array) -> Array:
    """Friction and accessory torque a driver knows from coasting, N m."""
    w = np.maximum(engine_speed, 40.0)
    return np.asarray(
        t.friction_constant + t.friction_linear * w + t.friction_quadratic * w * w + t.accessory_power / w
    )
