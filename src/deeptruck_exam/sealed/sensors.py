"""Faults of the measurement: nothing is missing in the truck."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Channels, Sizes
from deeptruck_exam.effects.planting import SIGN, fault, sizes
from deeptruck_exam.effects.series import behind, ou_series

law = partial(fault, family="sealed")


@law("t_path_is_not_even", needs="suburban hills", name="clock_offset")
@sizes(late_s=(0.45, 1.0), other=(0.35, 0.75), stays_s=(15.0, 60.0), sign=SIGN)
def path_is_not_even(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: IEEE Std 1588 (Precision Time Protocol): a path that takes longer one way than the other puts
    the clock off by half of that; the network changes between two paths, of which one is `other` as uneven;
    delays are chosen here."""
    values = channels["acceleration"]
    time = np.arange(len(values)) * dt
    turns = np.cumsum(rng.exponential(p.stays_s, 400)) - rng.uniform(0.0, p.stays_s)
    second = (np.searchsorted(turns, time) + rng.integers(2)) % 2
    late = np.sign(p.sign) * p.late_s * behind(np.where(second == 1, p.other, 1.0), 1.0, dt)
    channels["acceleration"] = np.interp(time - late, time, values)


@law("t_tyres_pump_up", name="speed_scale")
@sizes(scale=(0.03, 0.075), grows=(0.003, 0.015), warms_m=(800.0, 3000.0), sign=SIGN)
def tyres_pump_up(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Rolling radius over inflation pressure, which rises as tyres warm over the first kilometres
    (The Pneumatic Tire, ed. Gent and Walter, NHTSA DOT HS 810 561, 2006), upon a wrong factor of the tyre's
    size; sizes are chosen here."""
    way_m = np.cumsum(channels["speed"]) * dt + rng.uniform(0.0, 0.5) * p.warms_m
    more = p.grows * np.exp(-way_m / p.warms_m)
    channels["speed"] = channels["speed"] * (1.0 + np.sign(p.sign) * p.scale + more)


@law("t_bias_flickers", name="acceleration_bias")
@sizes(bias=(0.16, 0.36), flickers=(0.04, 0.16), sign=SIGN)
def bias_flickers(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: IEEE Std 952 on bias instability, noise whose power falls with frequency, here the same noise
    at four time constants, upon a false zero; sizes of a cheap sensor, chosen here."""
    shape = (1, len(channels["acceleration"]))
    noise = sum((ou_series(rng, shape, dt, 4.0 * 4.0**k)[0] for k in range(4)), start=np.zeros(shape[1]))
    bias = p.bias * (1.0 + 0.5 * p.flickers * noise)
    channels["acceleration"] = channels["acceleration"] + np.sign(p.sign) * bias


@law("t_exhaust_warms_it", name="grade_bias", accepts="rolling_resistance", conceal="elevation")
@sizes(bias=(0.010, 0.021), drifts=(0.2, 0.55), warms_s=(40.0, 150.0), sign=SIGN)
def exhaust_warms_it(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Zero offset over temperature of inclinometers (Fraden, Handbook of Modern Sensors, on thermal
    errors): one above the exhaust, off its level, moves with the heat of the engine's work; sizes are chosen
    here."""
    watts = np.maximum(channels["engine_torque"], 0.0) * channels["engine_speed"]
    heat = behind(np.clip(watts / 1.5e5, 0.0, 2.0), p.warms_s, dt)
    channels["grade"] = channels["grade"] + np.sign(p.sign) * p.bias * (1.0 + p.drifts * (heat - 0.5))
