"""One truck through one substep: forces at the road, motion, standstill, and the energy account."""

from __future__ import annotations

from math import copysign, sqrt
from typing import Any

from deeptruck_model.trucks.brakes import brake, heat
from deeptruck_model.trucks.compiled import part
from deeptruck_model.trucks.engine import by_pedal, clip, demand, friction, full_load, run_engine
from deeptruck_model.trucks.gearbox import choose_gear, couple
from deeptruck_model.trucks.state import LOCKED, SLIPPING

LOAD_LAG = 0.5  # s, of the gearbox's reckoned resistance
LOCK_SLIP = 0.2  # rad/s below which a slipping clutch locks


@part
def _efficiency(p: Any, torque: float) -> float:
    return p.driveline_efficiency if torque >= 0.0 else 1.0 / p.driveline_efficiency


@part
def find_forces(s: Any, p: Any, engine: float, brake_command: float, grade: float, h: float) -> float:
    """Powertrain, brakes and road load at this instant; fills the forces and returns the fuel rate, cm3/s.

    brake_force and rolling_force are here what can act; `move` reduces them where less holds the truck.
    """
    drag, full = friction(p, s.engine_speed), full_load(p, s.engine_speed)
    if p.by_pedal > 0.0:
        engine = by_pedal(p, engine, max(full + drag, 1.0))
    s.demand = demand(p, engine, max(full + drag, 1.0))
    speed = choose_gear(s, p, h)
    fuel = run_engine(s, p, engine, max(speed, p.idle_speed), drag, full, h)
    cosine = 1.0 / sqrt(1.0 + grade * grade)
    weight = p.mass * p.gravity
    grip = p.tyre_friction * weight * cosine
    s.brake_force = min(brake(s, p, brake_command, h), grip)
    demanded = s.demand * max(full + drag, 1.0) * s.ratio / p.wheel_radius
    couple(s, p, speed, s.brake_force > demanded)
    pull = s.input_torque * s.ratio * _efficiency(p, s.input_torque) / p.wheel_radius
    s.traction_force = clip(pull, -grip * p.drive_axle_share, grip * p.drive_axle_share)
    s.drag_force = 0.5 * p.air_density * p.drag_area * s.speed * abs(s.speed)
    s.rolling_force = (p.rolling_resistance + p.rolling_resistance_speed * abs(s.speed)) * weight * cosine
    s.grade_force = weight * grade * cosine
    s.mass = p.mass
    s.effective_mass = p.mass + p.wheel_inertia / (p.wheel_radius * p.wheel_radius)
    if s.clutch == LOCKED:
        s.effective_mass += p.engine_inertia * (s.ratio / p.wheel_radius) ** 2
    return fuel


@part
def _next_speed(s: Any, p: Any, drive: float, h: float) -> float:
    """Speed after h. Brakes and rolling resistance oppose motion and hold at rest, without overshoot."""
    friction = s.brake_force + s.rolling_force
    v = s.speed
    if v == 0.0:
        if abs(drive) <= friction or (drive < 0.0 and p.hill_hold > 0.0):
            return 0.0
        return (drive - copysign(friction, drive)) * h / s.effective_mass
    after = v + (drive - copysign(friction, v)) * h / s.effective_mass
    return 0.0 if after * v < 0.0 else after


@part
def _share_friction(s: Any, resisting: float) -> None:
    """Give brakes and rolling resistance the force that really acted (signed)."""
    able = s.brake_force + s.rolling_force
    share = clip(resisting / able, -1.0, 1.0) if able > 0.0 else 0.0
    s.brake_force *= share
    s.rolling_force *= share


@part
def _account(s: Any, p: Any, before: float, engine_before: float, ratio_speed: float, h: float) -> None:
    """Add the work of every force over the substep."""
    way = 0.5 * (before + s.speed) * h
    turn = 0.5 * (engine_before + s.engine_speed) * h
    input_turn = ratio_speed * way
    s.engine_work += s.engine_torque * turn
    s.external_work += s.external_force * way
    s.slip_loss += s.clutch_torque * turn - s.input_torque * input_turn
    s.driveline_loss += s.input_torque * input_turn - s.traction_force * way
    s.brake_work += s.brake_force * way
    s.drag_work += s.drag_force * way
    s.rolling_work += s.rolling_force * way
    s.grade_work += s.grade_force * way
    s.distance += way
    s.elevation += s.grade_force * way / (p.mass * p.gravity)
    heat(s, p, abs(s.brake_force * way / h), h)


@part
def _lock_where_slip_ends(s: Any, p: Any, slip_before: float, ratio_speed: float) -> None:
    """A slipping clutch whose sides meet locks, keeping the momentum; the slip's energy is lost."""
    slip = s.engine_speed - ratio_speed * s.speed
    if s.clutch != SLIPPING or s.speed <= 0.0 or (slip_before * slip > 0.0 and abs(slip) > LOCK_SLIP):
        return
    engine, vehicle = p.engine_inertia, s.effective_mass
    together = vehicle + engine * ratio_speed * ratio_speed
    s.slip_loss += 0.5 * engine * vehicle / together * slip * slip
    s.speed += engine * ratio_speed * slip / together
    s.engine_speed = ratio_speed * s.speed
    s.clutch = LOCKED


@part
def move(s: Any, p: Any, external: float, h: float) -> None:
    """Integrate the motion over h with the forces found, and a force from outside (N, forward positive)."""
    before, engine_before = s.speed, s.engine_speed
    ratio_speed = s.ratio / p.wheel_radius
    slip_before = engine_before - ratio_speed * before
    s.external_force = external
    drive = s.traction_force + external - s.drag_force - s.grade_force
    s.speed = _next_speed(s, p, drive, h)
    pull = s.effective_mass * (s.speed - before) / h
    _share_friction(s, drive - pull)
    if s.clutch == LOCKED:
        s.engine_speed = ratio_speed * s.speed
    else:
        s.engine_speed += (s.engine_torque - s.clutch_torque) * h / p.engine_inertia
    _account(s, p, before, engine_before, ratio_speed, h)
    if s.speed == 0.0 and before == 0.0:
        s.load = s.grade_force + p.rolling_resistance * p.mass * p.gravity  # tilt sensor
    elif s.shifting == 0.0 and s.brake_force == 0.0:
        s.load += (s.traction_force - pull - s.load) * h / (LOAD_LAG + h)
    _lock_where_slip_ends(s, p, slip_before, ratio_speed)
    s.acceleration = (s.speed - before) / h
    s.time += h
