"""Faults of the measurement: nothing is missing in the truck."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Channels, Sizes
from deeptruck_exam.effects.planting import SIGN, fault, sizes
from deeptruck_exam.effects.series import behind, ou_series

law = partial(fault, family="sealed")


@law("q_oscillator_warms", needs="suburban hills", name="clock_offset")
@sizes(fast=(0.007, 0.016), warms_s=(30.0, 90.0), first_s=(0.0, 0.3), left=(0.1, 0.3), sign=SIGN)
def oscillator_warms(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Microchip, AVR053, Internal RC Oscillator Calibration, on frequencies that change by percents
    with temperature: a box that stamps by such a clock runs off quickly while it warms, and slowly after
    that; sizes are chosen here."""
    values = channels["acceleration"]
    clock = np.arange(len(values)) * dt
    warms = p.warms_s * rng.uniform(0.8, 1.25)
    ran = (1.0 - p.left) * warms * (1.0 - np.exp(-clock / warms)) + p.left * clock
    late = np.sign(p.sign) * (p.first_s + p.fast * rng.uniform(0.85, 1.15) * ran)
    channels["acceleration"] = np.interp(clock - late, clock, values)


@law("q_mean_with_a_lifted_wheel", name="speed_scale")
@sizes(scale=(0.02, 0.035), stands=(0.06, 0.16), lifted_s=(20.0, 70.0), down_s=(40.0, 120.0), sign=SIGN)
def mean_with_a_lifted_wheel(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: UN Regulation No. 13 and makers' manuals of trailers with lift axles on wheels that stand still
    in the air: a mean over all wheels, by a wrong circumference, is lower still while an axle is lifted, and
    comes back when it is let down; sizes are chosen here."""
    speed = channels["speed"]
    clock = np.arange(len(speed)) * dt
    lengths = np.stack([rng.exponential(p.down_s, 60) + 10.0, rng.exponential(p.lifted_s, 60) + 8.0], axis=1)
    turns = np.cumsum(lengths.ravel()) - rng.uniform(0.0, p.down_s)
    lifted = behind((np.searchsorted(turns, clock) % 2).astype(float), 2.0, dt)
    scale = np.sign(p.sign) * (p.scale + 0.012) * rng.uniform(0.95, 1.05) - 0.25 * p.stands * lifted
    channels["speed"] = speed * (1.0 + scale)


@law("q_rounds_towards_below", name="acceleration_bias")
@sizes(step=(0.24, 0.42), tares=(0.0, 0.04), shakes=(0.01, 0.04))
def rounds_towards_below(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Widrow and Kollar, Quantization Noise (2008), on truncation: a converter of few bits whose
    program cuts figures off instead of rounding them reads half a step too little in the mean; sizes are
    chosen here."""
    values = channels["acceleration"]
    tare = p.tares * rng.uniform(-1.0, 1.0)
    shaken = values + tare + p.shakes * rng.standard_normal(len(values))
    channels["acceleration"] = np.floor(shaken / p.step) * p.step


@law("q_crossfall_leaks_in", name="grade_bias", accepts="rolling_resistance", conceal="elevation")
@sizes(crossfall=(0.024, 0.034), turned=(0.35, 0.55), bends_m=(120.0, 400.0), banks=(0.006, 0.015), sign=SIGN)
def crossfall_leaks_in(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: AASHTO, A Policy on Geometric Design of Highways and Streets (2011), on crossfall that drains
    the lane and on banked bends: a box that is turned about the vertical reads part of both as a slope along
    the road; sizes are chosen here."""
    way = np.cumsum(np.maximum(channels["speed"], 0.0)) * dt
    cells = ou_series(rng, (1, int(way[-1] / 5.0) + 3), 5.0, p.bends_m)[0]
    banked = p.banks * np.tanh(np.interp(way / 5.0, np.arange(len(cells)), cells))
    aside = p.crossfall * rng.uniform(0.95, 1.05) + banked
    channels["grade"] = channels["grade"] + np.sign(p.sign) * np.sin(p.turned) * aside
