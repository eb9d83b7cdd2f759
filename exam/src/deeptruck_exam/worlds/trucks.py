"""Random trucks: the reference pool with random body, engine, gearing, brakes and load."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_model import trucks
from deeptruck_model.trucks import PhysicsTruck

TUNABLE = ("mass", "drag_area", "rolling_resistance", "torque_gain", "brake_gain")


def draw(name: str, values: Mapping[str, Any], rng: np.random.Generator) -> dict[str, float]:
    """Overrides that make a random truck of the kind `name`; `values` is `trucks` of worlds.yaml."""
    factors = {part: rng.uniform(*among) for part, among in values["factors"].items()}
    factors["mass"] = rng.uniform(*values["mass"][name])
    out = {part: float(f"{reference(name)[part] * factor:.5g}") for part, factor in factors.items()}
    warm, height = rng.uniform(*values["ambient_c"]), rng.uniform(*values["height_m"])
    out["ambient_temperature"] = float(np.round(warm, 1))
    density = 1.225 * np.exp(-height / 8400.0) * 288.0 / (273.0 + warm)
    out["air_density"] = float(f"{density:.4g}")
    out["brake_controller_mass"] = out["mass"]
    return out


@cache
def reference(name: str) -> Mapping[str, float]:
    return trucks.load(name).parameters()


def make(name: str, values: Mapping[str, float], *, grade: bool = True) -> PhysicsTruck:
    """The truck with these parameters, with or without the grade among its inputs."""
    truck = trucks.load(name).with_parameters(values)
    if grade:
        return truck.with_grade_input()
    blind = replace(truck.specification, interface=replace(truck.interface, grade=False))
    return PhysicsTruck(blind)


def overrides(values: Mapping[str, float], grade: bool) -> dict[str, Any]:
    """Content of the simulator's overrides file."""
    return {**{n: float(v) for n, v in values.items()}, "interface": {"grade": grade}}


def namespace(truck: PhysicsTruck) -> SimpleNamespace:
    """Parameters, and peak_torque (N m), peak_power (W) and full_command (interface units)."""
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
    """Friction and accessory torque that a driver knows from coasting, N m."""
    w = np.maximum(engine_speed, 40.0)
    return np.asarray(
        t.friction_constant + t.friction_linear * w + t.friction_quadratic * w * w + t.accessory_power / w
    )
