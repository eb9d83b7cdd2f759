"""The internal state that best goes with an observed response: settled engine, gear by speed, level road."""

from __future__ import annotations

from math import isnan
from typing import Any

from deeptruck_model.trucks.brakes import brake_capacity
from deeptruck_model.trucks.compiled import part
from deeptruck_model.trucks.engine import clip, friction, full_load
from deeptruck_model.trucks.gearbox import gear_for_speed, input_speed
from deeptruck_model.trucks.state import LOCKED, OPEN


@part
def _settle_engine(s: Any, p: Any, force: float) -> float:
    """Engine and boost that give the force at the road; returns what it falls short of (negative: brake)."""
    ratio = p.ratios[int(s.gear) - 1] * p.final_drive
    drag = friction(p, s.engine_speed)
    full = full_load(p, s.engine_speed)
    wanted = drag
    if s.clutch == LOCKED:
        wanted = force * p.wheel_radius / (ratio * p.driveline_efficiency * max(p.torque_gain, 1e-3)) + drag
    s.indicated_torque = clip(wanted, 0.0, full + drag)
    aspirated = p.aspirated_fraction * full + drag
    s.boost = max((s.indicated_torque - aspirated) / max(full + drag - aspirated, 1e-6), 0.0)
    s.engine_torque = s.indicated_torque - drag
    s.demand = s.pedal = s.indicated_torque / max(full + drag, 1.0)
    return min(force + drag * ratio / (p.wheel_radius * p.driveline_efficiency), 0.0)


@part
def settle(s: Any, p: Any, acceleration: float, speed: float) -> None:
    """Fill a zeroed state from acceleration and speed."""
    s.speed, s.acceleration, s.since_shift, s.mass = speed, acceleration, 1e3, p.mass
    s.brake_temperature = p.ambient_temperature
    s.gear = s.target_gear = gear_for_speed(s, p, p.engage_speed)
    s.ratio = p.ratios[int(s.gear) - 1] * p.final_drive
    turning = input_speed(s, p, s.gear)
    held = turning >= p.lockup_speed and s.gear >= p.lockup_gear
    if p.converter == 0.0:
        held = turning >= p.declutch_speed
    s.clutch = LOCKED if held else OPEN
    s.engine_speed = turning if held else max(turning, p.idle_speed)
    drag_force = 0.5 * p.air_density * p.drag_area * speed * speed
    s.load = drag_force + (p.rolling_resistance + p.rolling_resistance_speed * speed) * p.mass * p.gravity
    s.effective_mass = p.mass + p.wheel_inertia / (p.wheel_radius * p.wheel_radius)
    if held:
        s.effective_mass += p.engine_inertia * (s.ratio / p.wheel_radius) ** 2
    short = _settle_engine(s, p, s.effective_mass * acceleration + s.load)
    if short < 0.0 and speed > 0.0:
        share = min(-short / max(brake_capacity(p), 1.0), 1.0)
        s.front_pressure = s.rear_pressure = p.brake_pushout + (1.0 - p.brake_pushout) * share
        s.brake_controller = min(0.0, -s.load / p.mass) if p.brake_controller_gain > 0.0 else 0.0


@part
def replace_speed(s: Any, p: Any, acceleration: float, speed: float) -> None:
    """Put a recorded response in place of the simulated one; a locked engine turns with it.

    Where it is NaN, the simulated one stays.
    """
    if not isnan(acceleration):
        s.acceleration = acceleration
    if isnan(speed):
        return
    s.speed = speed
    if s.clutch == LOCKED:
        s.engine_speed = s.ratio / p.wheel_radius * speed
