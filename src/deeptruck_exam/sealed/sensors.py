"""Faults of the measurement: nothing is missing in the truck."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Channels, Sizes
from deeptruck_exam.effects.planting import SIGN, fault, sizes
from deeptruck_exam.effects.series import behind

law = partial(fault, family="sealed")


@law("e_filter_grows_with_shaking", needs="suburban hills", name="clock_offset")
@sizes(late_s=(0.5, 1.0), calm=(0.4, 0.75), adapts_s=(4.0, 15.0))
def filter_grows_with_shaking(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Group delay of filters (Oppenheim and Schafer, Discrete-Time Signal Processing, 2010): half the
    length, and a sensor that makes its filter the longer the more it is shaken, which is by speed; delays are
    chosen here."""
    values = channels["acceleration"]
    time = np.arange(len(values)) * dt
    shaken = behind(np.clip(channels["speed"] / 20.0, 0.0, 1.2) ** 2, p.adapts_s, dt)
    late = p.late_s * (p.calm + (1.0 - p.calm) * shaken) + 0.02 * rng.uniform()
    channels["acceleration"] = np.interp(time - late, time, values)


@law("e_height_of_the_optics", name="speed_scale")
@sizes(scale=(0.03, 0.07), height=(0.004, 0.016), pitches_s=(0.3, 0.8), sign=SIGN)
def height_of_the_optics(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Optical sensors over ground count a grating's lines (Ator, Image-Velocity Sensing with Parallel
    Slit Reticles, J. Opt. Soc. Am. 53, 1963): their scale goes with the height above the road, which a wrong
    mounting and the pitch of the frame change; sizes are chosen here."""
    pitch = behind(np.clip(channels["acceleration"], -2.0, 2.0), p.pitches_s, dt)
    where = rng.choice([-1.0, 1.0])  # ahead of the axles or behind them
    channels["speed"] = channels["speed"] * (1.0 + np.sign(p.sign) * p.scale + where * p.height * pitch)


@law("e_bias_is_a_telegraph", name="acceleration_bias")
@sizes(bias=(0.16, 0.34), jumps=(0.15, 0.4), stays_s=(8.0, 40.0), sign=SIGN)
def bias_is_a_telegraph(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Burst noise (Kogan, Electronic Noise and Fluctuations in Solids, 1996): a level that jumps
    between two, as a defect is charged or not, upon a false zero; sizes of a cheap sensor, chosen here."""
    n = len(channels["acceleration"])
    turns = np.cumsum(rng.random(n) < dt / p.stays_s) + rng.integers(2)
    bias = p.bias * (1.0 + p.jumps * ((turns % 2) - 0.5))
    channels["acceleration"] = channels["acceleration"] + np.sign(p.sign) * bias


@law("e_springs_stay_bent", name="grade_bias", accepts="rolling_resistance", conceal="elevation")
@sizes(bias=(0.009, 0.02), pitch=(0.002, 0.006), rubs=(0.25, 0.7), sign=SIGN)
def springs_stay_bent(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Fancher, Ervin, MacAdam and Winkler, Measurement and Representation of the Mechanical
    Properties of Truck Leaf Springs, SAE 800905: friction between the leaves keeps a frame nose
    down after a braking and up after a pull, below an inclinometer out of level; sizes are chosen here."""
    squat = _held(np.clip(channels["acceleration"], -2.0, 2.0), p.rubs, rng.uniform(-0.3, 0.3))
    channels["grade"] = channels["grade"] + np.sign(p.sign) * p.bias + p.pitch * behind(squat, 0.3, dt)


def _held(values: Array, width: float, first: float) -> Array:
    """What is dragged along by the values once they have gone further than `width` from it."""
    out, at = np.empty(len(values)), first
    for k, value in enumerate(values.tolist()):
        at = min(max(at, value - width), value + width)
        out[k] = at
    return out
