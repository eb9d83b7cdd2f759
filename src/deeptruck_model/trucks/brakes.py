"""Air brakes: pedal, pressure or deceleration command, circuits with lag, heat and fade."""

from __future__ import annotations

from typing import Any

from deeptruck_model.trucks.compiled import part
from deeptruck_model.trucks.engine import clip, lag

CONTROLLER_SPAN = 4.0  # m/s2, the most the deceleration controller adds or takes


@part
def brake_capacity(p: Any) -> float:
    """Brake force at full pressure, cold, N."""
    torque = p.front_wheels * p.front_brake_torque + p.rear_wheels * p.rear_brake_torque
    return torque / p.wheel_radius


@part
def _pressure_for_deceleration(s: Any, p: Any, request: float, h: float) -> float:
    """Electronic brake system: feed-forward by a reckoned mass, and the integral of what is lacking.

    Without an integral the request is what the brakes add, whatever slope, air and load do.
    """
    if request <= p.brake_gate:
        without_brakes = min(s.acceleration, 0.0)
        s.brake_controller = without_brakes if p.brake_controller_gain > 0.0 else 0.0
        return 0.0
    if s.speed > 0.0:
        s.brake_controller += p.brake_controller_gain * (request + s.acceleration) * h
    s.brake_controller = clip(s.brake_controller, -CONTROLLER_SPAN, CONTROLLER_SPAN)
    mass = p.brake_controller_mass if p.brake_controller_gain > 0.0 else p.mass
    share = mass * (request + s.brake_controller) / max(brake_capacity(p), 1.0)
    return clip(p.brake_pushout + (1.0 - p.brake_pushout) * share, 0.0, 1.0)


@part
def _fill(pressure: float, wanted: float, apply_lag: float, release_lag: float, h: float) -> float:
    return lag(pressure, wanted, apply_lag if wanted > pressure else release_lag, h)


@part
def _braking(p: Any, pressure: float) -> float:
    return max(pressure - p.brake_pushout, 0.0) / (1.0 - p.brake_pushout)


@part
def fade(s: Any, p: Any) -> float:
    """Share of the cold brake torque that is left."""
    return clip(1.0 - p.brake_fade * max(s.brake_temperature - p.fade_temperature, 0.0), p.fade_floor, 1.0)


@part
def brake(s: Any, p: Any, command: float, h: float) -> float:
    """Advance both circuits by h; returns the force the brakes can give, N."""
    request = max(command, 0.0) * p.brake_scale
    wanted = min(request, 1.0)
    if p.by_deceleration > 0.0:
        wanted = _pressure_for_deceleration(s, p, request, h)
    s.front_pressure = _fill(s.front_pressure, wanted, p.brake_lag, p.brake_release_lag, h)
    s.rear_pressure = _fill(s.rear_pressure, wanted, p.brake_lag_rear, p.brake_release_lag, h)
    front = p.front_wheels * p.front_brake_torque * _braking(p, s.front_pressure)
    rear = p.rear_wheels * p.rear_brake_torque * _braking(p, s.rear_pressure)
    return p.brake_gain * fade(s, p) * (front + rear) / p.wheel_radius


@part
def heat(s: Any, p: Any, power: float, h: float) -> None:
    """Advance the brake temperature by h with the friction power, W."""
    cooling = p.brake_cooling + p.brake_cooling_speed * abs(s.speed)
    flow = power - cooling * (s.brake_temperature - p.ambient_temperature)
    s.brake_temperature += flow * h / p.brake_heat_capacity
