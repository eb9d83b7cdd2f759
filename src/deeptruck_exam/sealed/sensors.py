"""Faults of the measurement: nothing is missing in the truck."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Channels, Sizes
from deeptruck_exam.effects.planting import SIGN, fault, sizes
from deeptruck_exam.effects.series import behind

law = partial(fault, family="sealed")


@law("v_two_masters", needs="suburban hills", name="clock_offset")
@sizes(late_s=(0.35, 0.7), apart_s=(0.3, 0.8), stays_s=(20.0, 60.0), slews_s=(2.0, 6.0), sign=SIGN)
def two_masters(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: IEEE 1588 (2019), Precision Clock Synchronization Protocol, on best masters that are chosen
    anew: two that disagree by tenths of a second take turns, and the box follows whichever leads; sizes are
    chosen here."""
    values = channels["acceleration"]
    clock = np.arange(len(values)) * dt
    turns = np.cumsum(rng.exponential(p.stays_s, 80) + 5.0) - rng.uniform(0.0, p.stays_s)
    second = behind((np.searchsorted(turns, clock) % 2).astype(float), p.slews_s, dt)
    late = np.sign(p.sign) * (p.late_s * rng.uniform(0.9, 1.1) + p.apart_s * second)
    channels["acceleration"] = np.interp(clock - late, clock, values)


@law("v_front_wheels_squat", name="speed_scale")
@sizes(scale=(0.02, 0.04), squats=(0.01, 0.025), springs_s=(0.2, 0.6), sign=SIGN)
def front_wheels_squat(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Gillespie, Fundamentals of Vehicle Dynamics (1992), on load that braking throws onto the front
    axle: its tyres flatten then and turn faster than the truck moves, and more slowly when it pulls; the
    scale is wrong besides; sizes are chosen here."""
    nods = behind(np.clip(channels["acceleration"], -3.0, 3.0), p.springs_s, dt)
    scale = np.sign(p.sign) * p.scale * rng.uniform(0.95, 1.05) - p.squats * nods
    channels["speed"] = channels["speed"] * (1.0 + scale)


@law("v_remembers_the_last_jolt", name="acceleration_bias")
@sizes(bias=(0.09, 0.16), drags=(0.08, 0.18), wide=(0.25, 0.6), sign=SIGN)
def remembers_the_last_jolt(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Visintin, Differential Models of Hysteresis (1994), on play, and makers' data of piezoresistive
    accelerometers on hysteresis: a mass in worn glue stays where the last jolt has pushed it, until a jolt
    the other way is as strong; sizes are chosen here."""
    values = channels["acceleration"]
    rests, at = np.empty(len(values)), 0.0
    for k, value in enumerate(values):
        at = min(max(at, value - p.wide), value + p.wide)
        rests[k] = at
    bias = np.sign(p.sign) * p.bias * rng.uniform(0.9, 1.1)
    channels["acceleration"] = values + bias + p.drags * np.tanh(rests / 0.3)


@law("v_valve_lets_it_sink", name="grade_bias", accepts="rolling_resistance", conceal="elevation")
@sizes(off=(0.007, 0.012), sinks=(0.007, 0.014), sinks_s=(25.0, 90.0), lifts_s=(3.0, 8.0), sign=SIGN)
def valve_lets_it_sink(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Wabco, ECAS Electronically Controlled Air Suspension, System Description, on tolerance bands of
    levelling: a leaking bellow lets one end sink until its controller lifts it again, and a box on the frame
    reads that as a slope that saws up and down; sizes are chosen here."""
    clock = np.arange(len(channels["grade"])) * dt
    falls, lifts = p.sinks_s * rng.uniform(0.8, 1.25), p.lifts_s
    phase = (clock + rng.uniform(0.0, falls + lifts)) % (falls + lifts)
    sunk = np.where(phase < falls, phase / falls, 1.0 - (phase - falls) / lifts)
    tilt = p.off * rng.uniform(0.9, 1.1) + p.sinks * (sunk - 0.5)
    channels["grade"] = channels["grade"] + np.sign(p.sign) * tilt
