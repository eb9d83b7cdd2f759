"""Faults of the measurement: nothing is missing in the truck."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Channels, Sizes
from deeptruck_exam.effects.planting import SIGN, fault, sizes
from deeptruck_exam.effects.series import behind

law = partial(fault, family="sealed")


@law("y_engine_comes_first", needs="suburban hills", name="clock_offset")
@sizes(late_s=(0.4, 0.75), at_rads=(120.0, 160.0), power=(1.0, 2.0), calms_s=(0.5, 2.0))
def engine_comes_first(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Liu and Layland, Scheduling Algorithms for Multiprogramming in a Hard-Real-Time Environment, J.
    ACM 20 (1973): tasks of the engine come first and come more often at high engine speed, so the task that
    records acceleration has to wait; sizes are chosen here."""
    values = channels["acceleration"]
    clock = np.arange(len(values)) * dt
    speed = channels.get("engine_speed", np.full(len(values), p.at_rads))
    turns = np.clip(behind(np.nan_to_num(speed, nan=p.at_rads), p.calms_s, dt) / p.at_rads, 0.3, 1.6)
    channels["acceleration"] = np.interp(clock - p.late_s * turns**p.power, clock, values)


@law("y_one_node_is_wrong", needs="suburban hills highway", name="speed_scale")
@sizes(scale=(0.018, 0.032), hump=(0.015, 0.03), at_mps=(9.0, 17.0), wide_mps=(4.0, 7.0), sign=SIGN)
def one_node_is_wrong(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Fraden, Handbook of Modern Sensors (2016), on calibration by lines between nodes: a factor is
    wrong everywhere, and one node of the table more, which lifts all speeds about it; sizes are chosen
    here."""
    speed = channels["speed"]
    near = np.clip(1.0 - np.abs(speed - p.at_mps) / p.wide_mps, 0.0, 1.0)
    scale = np.sign(p.sign) * (p.scale * rng.uniform(0.95, 1.05) + p.hump * near)
    channels["speed"] = speed * (1.0 + scale)


@law("y_heater_cycles", name="acceleration_bias")
@sizes(bias=(0.09, 0.16), swings=(0.03, 0.07), on_s=(8.0, 20.0), off_s=(20.0, 50.0), sign=SIGN)
def heater_cycles(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: IEEE Std 1293-1998 on accelerometers and their temperature: a heater in the box goes on at one
    temperature and off at another, and the bias swings with it like a bent saw tooth; sizes are chosen
    here."""
    on, off = p.on_s * rng.uniform(0.9, 1.1), p.off_s * rng.uniform(0.9, 1.1)
    phase = (np.arange(len(channels["acceleration"])) * dt + rng.uniform(0.0, on + off)) % (on + off)
    rise = (1.0 - np.exp(-2.0 * phase / on)) / (1.0 - np.exp(-2.0))
    fall = (np.exp(-2.0 * (phase - on) / off) - np.exp(-2.0)) / (1.0 - np.exp(-2.0))
    swing = np.where(phase < on, rise, fall) - 0.5
    bias = np.sign(p.sign) * p.bias * rng.uniform(0.9, 1.1) + p.swings * swing
    channels["acceleration"] = channels["acceleration"] + bias


@law("y_runs_into_its_stops", name="grade_bias", accepts="rolling_resistance", conceal="elevation")
@sizes(off=(0.008, 0.013), stops=(0.03, 0.05), eases_s=(0.3, 1.0), sign=SIGN)
def runs_into_its_stops(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Doebelin, Measurement Systems (2004), on pendulums that are held by springs and soft stops: one
    that stands askew reads less and less of a slope, the nearer it comes to one of its stops; sizes are
    chosen here."""
    leans = behind(channels["grade"], p.eases_s, dt) + np.sign(p.sign) * p.off * rng.uniform(0.9, 1.1)
    channels["grade"] = p.stops * np.tanh(leans / p.stops)
