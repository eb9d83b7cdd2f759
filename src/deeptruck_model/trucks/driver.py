"""A human-like driver: PI on speed with feed-forward, one foot for two pedals, for any interface."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.arrays import Array
from deeptruck_model.trucks.brakes import brake_capacity
from deeptruck_model.trucks.compiled import entry, part
from deeptruck_model.trucks.engine import clip, friction, lag
from deeptruck_model.trucks.kernel import advance
from deeptruck_model.trucks.state import LOCKED
from deeptruck_model.trucks.truck import PhysicsTruck

PROPORTIONAL = 0.45  # 1/s
INTEGRAL = 0.05  # 1/s2
INTEGRAL_SPAN = 0.6  # m/s2
PEDAL_LAG = 0.25  # s
HARDEST_START, HARDEST_STOP = 1.2, 2.5  # m/s2, how fast the driver moves the own reference
FOOT_BAND = 0.06  # m/s2 below what coasting gives, before the foot goes to the brake
HOLD_DECELERATION = 1.0  # m/s2 worth of brake while standing
STOPPED = 0.3  # m/s
FIRMER = 0.02  # 1/s, growth of a braking episode's level, so that a creeping truck stops too

FOLLOW, COAST, BRAKE, DWELL = 0.0, 1.0, 2.0, 3.0
EPISODE = np.dtype(
    [
        (name, "f8") for name in ("start", "kind", "seconds", "level")
    ]  # sample, COAST or BRAKE, s, share of braking
)
DRIVER = np.dtype(
    [
        (name, "f8")
        for name in (
            "reference",
            "integral",
            "on_brake",
            "engine",
            "brake",
            "mode",
            "left",  # s left of a coast or of standing
            "level",
            "next_episode",
            "uses_engine_brake",
        )
    ]
)
LOGGED = (
    "acceleration",
    "speed",
    "fuel_rate",
    "engine_command",
    "brake_command",
    "grade",
    "gear",
    "engine_speed",
    "engine_torque",
    "elevation",
)


@part
def _brake_command(p: Any, deceleration: float, force: float) -> float:
    """Pedal for a wanted brake force (N), or the deceleration itself where the interface takes that."""
    if p.by_deceleration > 0.0:
        return max(deceleration, 0.0)
    share = p.brake_pushout + (1.0 - p.brake_pushout) * force / max(brake_capacity(p), 1.0)
    return clip(share, 0.0, 1.0) / p.brake_scale


@part
def _press(d: Any, p: Any, engine: float, brake: float, dt: float) -> None:
    """Move the pedals towards the wanted commands with a first-order lag; small remainders become zero."""
    most = p.reference_torque / p.command_scale
    d.engine = lag(d.engine, clip(engine, -most, most), PEDAL_LAG, dt)
    d.brake = lag(d.brake, brake, PEDAL_LAG, dt)
    if engine == 0.0 and abs(d.engine) < 0.005 * most:
        d.engine = 0.0
    if brake == 0.0 and d.brake < 0.005 / p.brake_scale:
        d.brake = 0.0


@part
def _follow(d: Any, s: Any, p: Any, target: float, grade: float, dt: float) -> None:
    """Engine or brake for the reference speed, with the foot's own hysteresis."""
    before = d.reference
    d.reference += clip(target - before, -HARDEST_STOP * dt, HARDEST_START * dt)
    error = d.reference - s.speed
    wanted = (d.reference - before) / dt + PROPORTIONAL * error + d.integral
    if s.speed < STOPPED and d.reference < STOPPED:
        weight = p.mass * (HOLD_DECELERATION + p.gravity * abs(grade))
        d.integral = 0.0
        _press(d, p, 0.0, _brake_command(p, HOLD_DECELERATION, weight), dt)
        return
    load = p.mass * p.gravity * (p.rolling_resistance + grade) / sqrt(1.0 + grade * grade)
    force = s.effective_mass * wanted + load + 0.5 * p.air_density * p.drag_area * s.speed * s.speed
    force_per_torque = s.ratio / p.wheel_radius
    drag = friction(p, s.engine_speed)
    coast = -drag * force_per_torque / p.driveline_efficiency if s.clutch == LOCKED else 0.0
    short = coast - force
    if d.on_brake > 0.0:
        d.on_brake = 1.0 if short > 0.0 else 0.0
    elif short > FOOT_BAND * p.mass:
        d.on_brake = 1.0
    if d.on_brake > 0.0:
        _slow(d, p, -wanted, short, force_per_torque, dt)
    else:
        torque = force / (force_per_torque * p.driveline_efficiency) + drag
        _press(d, p, max(torque, 0.0) / p.command_scale, 0.0, dt)
    if s.shifting == 0.0 and abs(error) < 2.0:
        d.integral = clip(d.integral + INTEGRAL * error * dt, -INTEGRAL_SPAN, INTEGRAL_SPAN)


@part
def _slow(d: Any, p: Any, deceleration: float, short: float, force_per_torque: float, dt: float) -> None:
    """Engine brake first where the driver has it on, service brake for the rest."""
    retard = (
        min(short / force_per_torque * p.driveline_efficiency, p.engine_brake_torque) * d.uses_engine_brake
    )
    rest = short - retard * force_per_torque / p.driveline_efficiency
    deep = rest > FOOT_BAND * p.mass or d.uses_engine_brake == 0.0
    _press(d, p, -retard / p.command_scale, _brake_command(p, deceleration, rest) if deep else 0.0, dt)


@part
def _begin(d: Any, episodes: Any, k: int) -> None:
    i = int(d.next_episode)
    if d.mode == FOLLOW and i < len(episodes) and k >= episodes[i].start:
        d.mode, d.left, d.level = episodes[i].kind, episodes[i].seconds, episodes[i].level
        d.next_episode += 1.0


@part
def decide(d: Any, s: Any, p: Any, target: float, grade: float, dt: float) -> None:
    """Set the pedals d.engine and d.brake for one control step."""
    if d.mode == FOLLOW:
        _follow(d, s, p, target, grade, dt)
        return
    d.integral = d.on_brake = 0.0
    d.reference = s.speed
    deepest = 3.0 if p.by_deceleration > 0.0 else 0.6 / p.brake_scale
    _press(d, p, 0.0, d.level * deepest if d.mode != COAST else 0.0, dt)
    if d.mode == BRAKE:
        d.level += FIRMER * dt
        d.mode = DWELL if s.speed == 0.0 else BRAKE
        return
    d.left -= dt
    if d.left <= 0.0 or (d.mode == COAST and s.speed == 0.0):
        d.mode = FOLLOW


@part
def grade_at(road: Any, spacing: float, distance: float) -> float:
    place = clip(distance / spacing, 0.0, len(road) - 1.001)
    i = int(place)
    return road[i] + (place - i) * (road[i + 1] - road[i])


@part
def _log(row: Any, s: Any, d: Any, grade: float, acceleration: float) -> None:
    row[0], row[1], row[2] = acceleration, s.speed, s.fuel_rate
    row[3], row[4], row[5] = d.engine, d.brake, grade
    row[6], row[7], row[8] = s.gear, s.engine_speed, s.engine_torque
    row[9] = s.elevation


@entry
def _drive(
    states: Any,
    parameters: Any,
    drivers: Any,
    targets: Any,
    engine_brake: Any,
    episodes: Any,
    road: Any,
    spacing: float,
    substeps: int,
    h: float,
    log: Any,
) -> None:
    """One truck along targets (T,) m/s and road (slope at every `spacing` m); fills log (T, len(LOGGED))."""
    s, p, d = states[0], parameters[0], drivers[0]
    acceleration = s.acceleration
    for k in range(len(targets)):
        grade = grade_at(road, spacing, s.distance)
        d.uses_engine_brake = engine_brake[k]
        _begin(d, episodes, k)
        decide(d, s, p, targets[k], grade, substeps * h)
        _log(log[k], s, d, grade, acceleration)
        acceleration = advance(s, p, d.engine, d.brake, grade, substeps, h)


@entry
def _think(
    states: Any,
    parameters: Any,
    drivers: Any,
    target: float,
    engine_brake: float,
    episodes: Any,
    road: Any,
    spacing: float,
    k: int,
    dt: float,
    acceleration: float,
    row: Any,
) -> float:
    """The driver's half of `drive` for a truck with forces of others; returns the grade."""
    s, p, d = states[0], parameters[0], drivers[0]
    grade = grade_at(road, spacing, s.distance)
    d.uses_engine_brake = engine_brake
    _begin(d, episodes, k)
    decide(d, s, p, target, grade, dt)
    _log(row, s, d, grade, acceleration)
    return grade


def drive_along(
    truck: PhysicsTruck,
    targets: Array,
    engine_brake: Array,
    episodes: NDArray[Any],
    road: Array,
    spacing: float,
) -> Array:
    """Drive one truck along target speeds (T,) m/s, with the slope of the road at every `spacing` m.

    engine_brake (T,) is 1 where the driver uses it; episodes is an EPISODE array in order of start. Returns
    the LOGGED signals (T, len(LOGGED)); row k holds y(k), u(k) and w(k).
    """
    log = np.empty((len(targets), len(LOGGED)))
    state = truck.reset(np.array([[0.0, targets[0]]]))
    driver = np.zeros(1, DRIVER)
    driver["reference"] = targets[0]
    if not state.forces and not state.filters:
        _drive(
            state.records, truck.record, driver, targets, engine_brake, episodes, road, spacing,
            truck.substeps, truck.substep, log,
        )  # fmt: skip
        return log
    y = np.array([[state.records["acceleration"][0], targets[0], 0.0]])
    u, slope = np.empty((1, 2)), np.empty(1)
    for k, target in enumerate(targets):
        slope[0] = _think(
            state.records, truck.record, driver, target, engine_brake[k], episodes, road, spacing,
            k, truck.dt, y[0, 0], log[k],
        )  # fmt: skip
        u[0, 0], u[0, 1] = driver["engine"][0], driver["brake"][0]
        truck.advance(state, u, slope, y)
    return log
