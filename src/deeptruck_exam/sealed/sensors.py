"""Faults of the measurement: nothing is missing in the truck."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Channels, Sizes
from deeptruck_exam.effects.planting import SIGN, fault, sizes
from deeptruck_exam.effects.series import behind

law = partial(fault, family="sealed")


@law("x_each_leg_is_matched_alone", needs="suburban hills", name="clock_offset")
@sizes(peak_s=(0.35, 0.7), line_s=(0.15, 0.35), leg_s=(40.0, 120.0), slides_s=(1.0, 4.0))
def each_leg_is_matched_alone(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Knapp and Carter, The Generalized Correlation Method for Estimation of Time Delay, IEEE Trans.
    Acoustics, Speech and Signal Processing 24 (1976): a delay found at the highest peak is wrong by a whole
    wave where peaks are alike; here each leg of a drive is matched alone, waves are chosen here."""
    values = channels["acceleration"]
    clock = np.arange(len(values)) * dt
    ends = np.cumsum(p.leg_s * rng.uniform(0.6, 1.4, 2 + int(2.0 * clock[-1] / p.leg_s)))
    waves = rng.choice([0.0, 1.0, 1.0, 2.0], len(ends) + 1)
    late = p.line_s + p.peak_s * waves[np.searchsorted(ends, clock)]
    channels["acceleration"] = np.interp(clock - behind(late, p.slides_s, dt), clock, values)


@law("x_two_speed_axle", name="speed_scale")
@sizes(high=(0.02, 0.04), low=(0.05, 0.08), shifts_s=(0.3, 1.0), sign=SIGN)
def two_speed_axle(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Dana Spicer service manuals of two-speed axles, on speedometer adapters that have to follow the
    range of the axle: an adapter of another axle is wrong in both ranges, and more in the low one; factors
    and the gear where ranges change are chosen here."""
    gear = channels["gear"]
    low = np.where(gear <= 0.55 * max(float(np.max(gear)), 1.0), 1.0, 0.0)
    share = behind(low, p.shifts_s, dt)
    scale = np.sign(p.sign) * (p.high + (p.low - p.high) * share) * rng.uniform(0.95, 1.05)
    channels["speed"] = channels["speed"] * (1.0 + scale)


@law("x_glue_creeps", name="acceleration_bias")
@sizes(bias=(0.12, 0.22), creeps=(0.05, 0.14), third_s=(60.0, 200.0), gives=(0.01, 0.04), sign=SIGN)
def glue_creeps(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Andrade, On the Viscous Flow in Metals, and Allied Phenomena, Proc. R. Soc. A 84 (1910), and
    Findley, Lai and Onaran, Creep and Relaxation of Nonlinear Viscoelastic Materials (1976): creep with the
    third root of time; a box that tilts on its warm glue and gives to what it feels, sizes are chosen
    here."""
    values = channels["acceleration"]
    clock = np.arange(len(values)) * dt
    creeps = p.creeps * np.cbrt(clock / p.third_s) * rng.uniform(0.7, 1.3)
    gives = p.gives * behind(values, 8.0, dt)
    channels["acceleration"] = values + np.sign(p.sign) * (p.bias + creeps) + gives


@law("x_levels_anew_at_each_stand", name="grade_bias", accepts="rolling_resistance", conceal="elevation")
@sizes(bias=(0.009, 0.017), differs=(0.002, 0.005), level_s=(3.0, 8.0), stands_s=(1.0, 3.0), sign=SIGN)
def levels_anew_at_each_stand(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: WABCO, ECAS Electronically Controlled Air Suspension, System Description (2007): levels are set
    at stands, each within a tolerance, and kept while driving; a frame that is set nose up or down carries
    an inclinometer along, tolerances of worn sensors are chosen here."""
    stands = channels["speed"] < 0.2
    first = np.flatnonzero(stands & ~np.concatenate([[False], stands[:-1]]))
    level = np.full(len(stands), p.differs * rng.standard_normal())
    for at in first + round(p.stands_s / dt):
        level[at:] = p.differs * rng.standard_normal()
    slow = behind(level, p.level_s, dt)
    channels["grade"] = channels["grade"] + np.sign(p.sign) * p.bias + slow
