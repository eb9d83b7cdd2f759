"""The diesel engine: full-load curve, boost lag, motoring friction, governors, engine brake, fuel.

Commands are indicated (combustion) torque, as SAE J1939-71 defines its torque percentages: friction is
subtracted inside, so 0 is motoring with the fuel cut, and a negative command asks for the engine brake.
"""

from __future__ import annotations

from typing import Any

from deeptruck_model.trucks.compiled import part
from deeptruck_model.trucks.parameters import PEDAL, TABLE

IDLE_GAIN = 20.0  # N m for each rad/s below idle
SYNC_TIME = 0.12  # s in which the engine reaches the next gear's speed


@part
def clip(x: float, low: float, high: float) -> float:
    return min(max(x, low), high)


@part
def lag(x: float, target: float, time_constant: float, h: float) -> float:
    """First-order lag by the implicit rule: stable for every step, and no lag at time constant 0."""
    return x + (target - x) * h / (time_constant + h)


@part
def full_load(p: Any, engine_speed: float) -> float:
    """Largest flywheel torque with full boost, N m."""
    place = clip(engine_speed / p.table_step, 0.0, TABLE - 1.0)
    i = min(int(place), TABLE - 2)
    low = p.full_load[i]
    return p.full_load_gain * (low + (place - i) * (p.full_load[i + 1] - low))


@part
def friction(p: Any, engine_speed: float) -> float:
    """Motoring friction and accessories, N m."""
    w = max(engine_speed, 40.0)
    motoring = p.friction_constant + p.friction_linear * w + p.friction_quadratic * w * w
    return p.engine_friction * motoring + p.accessory_power / w


@part
def fuel_rate(p: Any, engine_speed: float, indicated: float, most: float) -> float:
    """Fuel flow, cm3/s: combustion power over an efficiency that falls from best speed and full load."""
    off_speed = (engine_speed - p.best_speed) / p.best_speed
    off_load = 1.0 - indicated / most
    loss = p.efficiency_speed_loss * off_speed * off_speed + p.efficiency_load_loss * off_load * off_load
    efficiency = p.indicated_efficiency * max(1.0 - loss, 0.3)
    return p.fuel_gain * indicated * engine_speed / (efficiency * p.fuel_energy)


@part
def by_pedal(p: Any, command: float, most: float) -> float:
    """The command, in its own unit, for the share of `most` that a pedal of `command` percent asks for."""
    place = clip(command / (100.0 / (PEDAL - 1)), 0.0, PEDAL - 1.0)
    i = min(int(place), PEDAL - 2)
    share = p.pedal[i] + (place - i) * (p.pedal[i + 1] - p.pedal[i])
    return share * most / p.command_scale if command > 0.0 else command


@part
def demand(p: Any, command: float, most: float) -> float:
    """Command as a share of full-load (positive) or engine-brake (negative) torque, -1..1."""
    torque = command * p.command_scale
    if torque >= 0.0:
        return min(torque / most, 1.0)
    return max(torque / max(p.engine_brake_torque, 1.0), -1.0)


@part
def _wanted(
    s: Any, p: Any, command: float, drag: float, most: float, sync_speed: float
) -> tuple[float, float]:
    """Indicated and retarding torque requested by driver, governors and gearbox."""
    w = s.engine_speed
    if s.synchronising > 0.0:
        sync = drag + p.engine_inertia * (sync_speed - w) / SYNC_TIME
        return clip(sync, 0.0, most), max(-sync, 0.0)
    torque = command * p.command_scale * s.torque_factor
    over = (p.high_idle_speed - w) / (p.high_idle_speed - p.governed_speed)
    idle = clip(drag + IDLE_GAIN * (p.idle_speed - w), 0.0, most)
    return max(clip(torque, 0.0, most * clip(over, 0.0, 1.0)), idle), max(-torque, 0.0)


@part
def run_engine(
    s: Any, p: Any, command: float, sync_speed: float, drag: float, full: float, h: float
) -> float:
    """Advance boost, combustion and engine brake by h; set engine_torque and return the fuel rate, cm3/s."""
    w = s.engine_speed
    most = max(full + drag, 1.0)
    wanted, retard = _wanted(s, p, command, drag, most, sync_speed)
    aspirated = min(p.aspirated_fraction * full + drag, most)
    span = max(most - aspirated, 1e-6)
    s.boost = lag(
        s.boost, clip((wanted - aspirated) / span, 0.0, 1.0), p.boost_lag * p.boost_speed / max(w, 40.0), h
    )
    s.indicated_torque = lag(s.indicated_torque, min(wanted, aspirated + s.boost * span), p.fuelling_lag, h)
    brake_share = clip((w - p.engine_brake_speed) / (p.governed_speed - p.engine_brake_speed), 0.0, 1.0)
    s.retarder_torque = lag(
        s.retarder_torque, min(retard, p.engine_brake_torque * brake_share), p.engine_brake_lag, h
    )
    s.engine_torque = p.torque_gain * s.indicated_torque - drag - s.retarder_torque
    return fuel_rate(p, w, s.indicated_torque, most)
