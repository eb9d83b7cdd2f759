"""Gear choice, gear changes, clutch and torque converter."""

from __future__ import annotations

from typing import Any

from deeptruck_model.trucks.compiled import part
from deeptruck_model.trucks.engine import clip, full_load, lag
from deeptruck_model.trucks.state import LOCKED, OPEN, SLIPPING

PEDAL_LAG = 0.3  # s; keeps a kick of the pedal from being a kick-down
OVERRUN_CAPACITY = 0.3  # of the stall capacity, when the wheels drive the engine through the converter
ON = 0.02  # share of torque above which the driver wants to move
SOFTLY = 250.0  # N m, the most a closing clutch drags the engine up with; more would jerk the truck
LAUNCH_RESERVE = 2.0  # pull over resistance that a launch gear must have


@part
def input_speed(s: Any, p: Any, gear: float) -> float:
    """Speed of the gearbox input (turbine) in a gear, rad/s."""
    return p.ratios[int(gear) - 1] * p.final_drive * s.speed / p.wheel_radius


@part
def _pull(p: Any, gear: float, engine_speed: float) -> float:
    """Force at the road at full load, N."""
    return (
        full_load(p, engine_speed)
        * p.ratios[int(gear) - 1]
        * p.final_drive
        * p.driveline_efficiency
        / p.wheel_radius
    )


@part
def launch_gear(s: Any, p: Any) -> float:
    """The start gear, or a lower one where the slope or load asks for it."""
    gear = p.start_gear
    while gear > 1.0 and _pull(p, gear, p.launch_speed) < LAUNCH_RESERVE * s.load:
        gear -= 1.0
    return gear


@part
def gear_for_speed(s: Any, p: Any, engine_speed: float) -> float:
    """Highest gear that keeps the engine above engine_speed, and never below the launch gear."""
    gear = launch_gear(s, p)
    while gear < p.gears and input_speed(s, p, gear + 1.0) >= engine_speed:
        gear += 1.0
    return gear


@part
def _carries(s: Any, p: Any, gear: float, down: float) -> bool:
    """Whether a gear would still pull the load, and not be left again, after the speed the change costs."""
    lost = max(s.load, 0.0) / p.mass * p.shift_time if p.converter == 0.0 else 0.0
    speed = input_speed(s, p, gear) * max(1.0 - lost / max(s.speed, 0.1), 0.0)
    return speed > down and _pull(p, gear, speed) > s.load


@part
def _next_gear(s: Any, p: Any) -> float:
    """The gear the hysteresis asks for; the present one where it asks for nothing."""
    up = p.upshift_low + (p.upshift_high - p.upshift_low) * s.pedal
    down = p.downshift_low + (p.downshift_high - p.downshift_low) * s.pedal
    speed = input_speed(s, p, s.gear)
    over = speed > p.governed_speed
    if s.since_shift < p.time_in_gear and not over and speed > p.declutch_speed:
        return s.gear
    if speed > up and s.gear < p.gears and (over or _carries(s, p, s.gear + 1.0, down)):
        return s.gear + 1.0
    if speed >= down:
        return s.gear
    gear, lowest = s.gear, min(p.start_gear, s.gear)
    if _pull(p, lowest, speed) < s.load:
        lowest = 1.0
    while gear > lowest and input_speed(s, p, gear) < down:
        gear -= 1.0
    return gear


@part
def _asked(s: Any, p: Any) -> float:
    """The recorded gear, where the truck follows it; 0 where it chooses. It is never NaN."""
    return min(float(int(s.asked_gear + 0.5)), p.gears) if s.asked_gear > 0.5 else 0.0


@part
def _finish_change(s: Any, p: Any) -> None:
    s.shift_timer = 0.0
    s.gear = s.target_gear
    s.since_shift = 0.0
    s.clutch = SLIPPING if p.converter == 0.0 else OPEN


@part
def _start_change(s: Any, p: Any, gear: float) -> None:
    s.target_gear = gear
    s.shift_timer = p.shift_time
    if p.shift_time == 0.0:
        _finish_change(s, p)


@part
def _change_by_clutch(s: Any, p: Any) -> float:
    """Torque ramps out, the clutch opens and the engine meets the next gear. Returns the gear meshed."""
    elapsed = p.shift_time - s.shift_timer
    turning = input_speed(s, p, s.gear) > p.declutch_speed
    if elapsed < p.shift_ramp and s.clutch == LOCKED and turning:
        s.torque_factor = 1.0 - elapsed / p.shift_ramp
        return s.gear
    s.torque_factor = 0.0
    s.clutch = OPEN
    s.synchronising = 1.0
    return s.target_gear


@part
def _left_behind(s: Any, p: Any) -> bool:
    """Whether a gear turns faster than the engine can: its clutch slips and would never close."""
    return s.clutch == SLIPPING and input_speed(s, p, s.gear) > p.governed_speed


@part
def _begin_in(s: Any, p: Any, gear: float) -> None:
    """A run begins in the recorded gear: the gear that fits the speed was a guess."""
    s.gear = s.target_gear = gear
    if s.clutch == LOCKED:
        s.engine_speed = max(input_speed(s, p, gear), p.idle_speed)
        s.clutch = LOCKED if input_speed(s, p, gear) >= p.declutch_speed else OPEN


@part
def choose_gear(s: Any, p: Any, h: float) -> float:
    """Advance the gearbox by h, set ratio and torque factor; returns the engine speed a change wants."""
    s.pedal = lag(s.pedal, abs(s.demand), PEDAL_LAG, h)
    s.since_shift += h
    s.synchronising = 0.0
    asked = _asked(s, p)
    if asked > 0.0 and s.time == 0.0:
        _begin_in(s, p, asked)
    if s.shift_timer > 0.0:
        if asked > 0.0:
            s.target_gear = asked
        s.shift_timer -= h
        if s.shift_timer < 1e-9:
            _finish_change(s, p)
    elif s.clutch == LOCKED or (p.converter > 0.0 and s.clutch == OPEN) or _left_behind(s, p):
        gear = asked if asked > 0.0 else _next_gear(s, p)
        if gear != s.gear:
            _start_change(s, p, gear)
    elif p.converter == 0.0 and (s.clutch == OPEN or input_speed(s, p, s.gear) < p.declutch_speed):
        s.gear = asked if asked > 0.0 else gear_for_speed(s, p, p.engage_speed)
        s.target_gear = s.gear
    s.shifting = 1.0 if s.shift_timer > 0.0 else 0.0
    return _mesh(s, p)


@part
def _mesh(s: Any, p: Any) -> float:
    ramp = 1.0 if p.shift_ramp == 0.0 else min(s.since_shift / p.shift_ramp, 1.0)
    s.torque_factor = ramp
    ratio = p.ratios[int(s.gear) - 1]
    if s.shifting > 0.0 and p.converter > 0.0:
        s.clutch = OPEN
        s.torque_factor = p.shift_torque
        done = 1.0 - s.shift_timer / p.shift_time
        ratio += done * (p.ratios[int(s.target_gear) - 1] - ratio)
    elif s.shifting > 0.0:
        ratio = p.ratios[int(_change_by_clutch(s, p)) - 1]
    elif p.converter > 0.0:
        s.torque_factor = p.shift_torque + (1.0 - p.shift_torque) * ramp
    s.ratio = ratio * p.final_drive
    return s.ratio * s.speed / p.wheel_radius


@part
def _move_clutch(s: Any, p: Any, speed: float, braked: bool) -> None:
    """Open, slip or keep the clutch of an automated gearbox. A torque of which the brakes take more is what
    idling needs, and no demand to move."""
    wants = s.demand > ON and not braked
    if s.clutch == LOCKED and speed < p.declutch_speed:
        s.clutch = SLIPPING if wants else OPEN
    elif s.clutch == OPEN and (wants or speed > p.engage_speed):
        s.clutch = SLIPPING
    elif s.clutch == SLIPPING and not wants and speed < p.declutch_speed:
        s.clutch = OPEN


@part
def _move_lockup(s: Any, p: Any, speed: float) -> None:
    if s.clutch != OPEN and speed < p.lockup_release_speed:
        s.clutch = OPEN
    elif s.clutch == OPEN and s.gear >= p.lockup_gear and speed > p.lockup_speed and s.since_shift > 0.3:
        s.clutch = SLIPPING


@part
def _slip_torque(s: Any, p: Any, speed: float) -> float:
    """Torque of a slipping clutch: hands over the engine torque and steers the engine to its target speed."""
    target = speed
    if p.converter == 0.0 and s.demand > 0.0:
        target = max(speed, p.idle_speed + (p.launch_speed - p.idle_speed) * s.demand)
    torque = s.engine_torque + p.clutch_gain * (s.engine_speed - target)
    if s.engine_speed >= speed:
        return clip(torque, 0.0, p.clutch_capacity)
    return clip(torque, -SOFTLY, 0.0)


@part
def _convert(s: Any, p: Any, speed: float) -> None:
    """Hydrodynamic converter: pump torque by speed ratio, multiplied below the coupling point."""
    w = max(s.engine_speed, 1.0)
    ratio = speed / w
    soft = 1.0 - p.coupling_ratio
    if ratio <= 1.0:
        s.clutch_torque = p.stall_capacity * w * w * min((1.0 - ratio) / soft, 1.0)
    else:
        s.clutch_torque = (
            -p.stall_capacity * speed * speed * min((1.0 - 1.0 / ratio) / soft, OVERRUN_CAPACITY)
        )
    gain = 1.0 + (p.stall_torque_ratio - 1.0) * clip(1.0 - ratio / p.coupling_ratio, 0.0, 1.0)
    s.input_torque = gain * s.clutch_torque


@part
def couple(s: Any, p: Any, speed: float, braked: bool) -> None:
    """Set clutch mode and the torques on both of its sides, with the gearbox input at `speed`."""
    if s.shifting == 0.0:
        if p.converter > 0.0:
            _move_lockup(s, p, speed)
        else:
            _move_clutch(s, p, speed, braked)
    if s.clutch == LOCKED:
        s.clutch_torque = s.input_torque = s.engine_torque
    elif s.clutch == SLIPPING:
        s.clutch_torque = s.input_torque = _slip_torque(s, p, speed)
    elif p.converter > 0.0:
        _convert(s, p, speed)
    else:
        s.clutch_torque = s.input_torque = 0.0
