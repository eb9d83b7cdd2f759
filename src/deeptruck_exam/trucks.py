"""Trucks of other origin: the reference pool with body, engine, gearing and brakes drawn anew."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from deeptruck_exam.hidden import Array
from deeptruck_model import trucks
from deeptruck_model.trucks import PhysicsTruck

SPREAD = {  # factor ranges about the reference truck
    "mass": (0.75, 1.45),
    "drag_area": (0.8, 1.25),
    "rolling_resistance": (0.75, 1.35),
    "air_density": (0.92, 1.06),
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
TUNABLE = ("mass", "drag_area", "rolling_resistance", "torque_gain", "brake_gain")


def draw_parameters(name: str, rng: np.random.Generator) -> dict[str, float]:
    """Overrides that make a random truck of the kind `name`, rounded to five figures."""
    reference = trucks.load(name).parameters()
    values = {n: float(f"{reference[n] * rng.uniform(*f):.5g}") for n, f in SPREAD.items()}
    values["ambient_temperature"] = float(np.round(rng.uniform(-5.0, 30.0), 1))
    values["brake_controller_mass"] = values["mass"]
    return values


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
