"""Possible findings that are no mechanisms: parameter errors, and faults between sensors."""

from __future__ import annotations

from dataclasses import dataclass

from deeptruck_model.mismatch.mechanisms.record import Family


@dataclass(frozen=True)
class Parameter:
    """A simulator parameter: its name in words, unit, and the manoeuvre that separates it from others."""

    name: str
    family: Family
    says: str
    manoeuvre: str
    unit: str = "1"
    mistaken_for: str = ""  # as of a mechanism


@dataclass(frozen=True)
class SensorError:
    """A fault visible between sensors alone: its equation, and the signals that must be recorded."""

    name: str
    family: Family
    equation: str
    needs: str


PARAMETER_ERRORS = {
    p.name: p
    for p in (
        Parameter(
            "mass", "load", "mass", "accelerate with the same torque at a low and a high speed", unit="kg"
        ),
        Parameter(
            "drag_area",
            "air_tyres_road",
            "drag area",
            "coast down from high speed on a flat road, both ways",
            unit="m^2",
        ),
        Parameter(
            "rolling_resistance",
            "air_tyres_road",
            "rolling resistance",
            "coast down at low speed on a flat road, both ways",
        ),
        Parameter(
            "torque_gain",
            "engine_driveline",
            "engine torque for a given command",
            "pull with steps of torque at one speed",
        ),
        Parameter(
            "brake_gain",
            "brakes",
            "brake force for a given command",
            "brake with steps of command from one speed",
            mistaken_for="brake",
        ),
    )
}
SENSOR_ERRORS = {
    s.name: s
    for s in (
        SensorError("acceleration_bias", "sensors", "accelerometer(t) = dv/dt + b", "acceleration, speed"),
        SensorError(
            "speed_scale", "sensors", "speed = k * true speed", "speed, and acceleration or engine_speed"
        ),
    )
}
