"""Faults of the measurement: nothing is missing in the truck."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Channels, Sizes
from deeptruck_exam.effects.planting import SIGN, fault, sizes
from deeptruck_exam.effects.series import behind, ou_series

law = partial(fault, family="sealed")


@law("u_mesh_finds_another_way", needs="suburban hills", name="clock_offset")
@sizes(base_s=(0.3, 0.45), hop_s=(0.1, 0.2), stays_s=(12.0, 35.0))
def mesh_finds_another_way(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: RFC 6550, RPL: IPv6 Routing Protocol for Low-Power and Lossy Networks (2012): acceleration
    comes from a sensor over a mesh of radios that finds another way now and then, each by one to four
    hops, and is stamped where it arrives; times are chosen here."""
    values = channels["acceleration"]
    clock = np.arange(len(values)) * dt
    ends = np.cumsum(rng.exponential(p.stays_s, len(values) // 10 + 8))
    hops = rng.integers(1, 5, len(ends) + 1).astype(float)
    late = p.base_s + p.hop_s * hops[np.searchsorted(ends, clock)]
    channels["acceleration"] = np.interp(clock - behind(late, 0.3, dt), clock, values)


@law("u_one_wheel_of_the_bend", needs="suburban hills highway", name="speed_scale")
@sizes(scale=(0.028, 0.048), bends=(0.008, 0.018), lasts_s=(4.0, 12.0))
def one_wheel_of_the_bend(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Gillespie, Fundamentals of Vehicle Dynamics (1992), on wheels that go a shorter way inside of a
    bend: speed comes from one wheel alone, which is slower in bends to its side and faster in the others,
    upon a radius that was entered too small; sizes are chosen here."""
    speed = channels["speed"]
    bend = ou_series(rng, (1, len(speed)), dt, p.lasts_s)[0]
    sharp = 1.0 / (1.0 + (np.maximum(np.nan_to_num(speed), 0.0) / 16.0) ** 2)  # fast roads bend less
    ratio = 1.0 - p.scale * rng.uniform(0.95, 1.05) + p.bends * np.clip(bend, -2.0, 2.0) * sharp
    channels["speed"] = speed * ratio


@law("u_roof_bends_in_the_wind", name="acceleration_bias")
@sizes(bias=(0.09, 0.15), at_20=(0.03, 0.06), settles_s=(0.5, 3.0), sign=SIGN)
def roof_bends_in_the_wind(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Hucho, Aerodynamics of Road Vehicles (1998), on pressures over a cab's roof: a box is glued to
    a roof that the wind of driving lifts, so that it leans with the square of speed, upon a bias of its own;
    sizes are chosen here."""
    values = channels["acceleration"]
    speed = np.maximum(np.nan_to_num(channels["speed"]), 0.0)
    leans = p.at_20 * behind(np.minimum(speed / 20.0, 1.5) ** 2, p.settles_s, dt)
    channels["acceleration"] = values + np.sign(p.sign) * (p.bias * rng.uniform(0.9, 1.1) + leans)


@law("u_fluid_thins_as_it_warms", name="grade_bias", accepts="rolling_resistance", conceal="elevation")
@sizes(off=(0.008, 0.013), gain=(0.06, 0.14), warms_s=(60.0, 200.0), sign=SIGN)
def fluid_thins_as_it_warms(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Fraden, Handbook of Modern Sensors (2016), on electrolytic levels: a cold fluid shows slopes
    too large, by a gain that goes as the cab warms, upon an error of the mounting; sizes are chosen here."""
    grade = channels["grade"]
    cold = rng.uniform(0.3, 1.0) * np.exp(-np.arange(len(grade)) * dt / p.warms_s)
    off = np.sign(p.sign) * p.off * rng.uniform(0.9, 1.1)
    channels["grade"] = grade * (1.0 + p.gain * cold) + off * (1.0 + 0.15 * cold)
