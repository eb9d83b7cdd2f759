"""Faults of the measurement: nothing is missing in the truck."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Channels, Sizes
from deeptruck_exam.effects.planting import SIGN, fault, sizes
from deeptruck_exam.effects.series import behind, ou_series

law = partial(fault, family="sealed")


@law("z_loop_rings", needs="suburban hills", name="clock_offset")
@sizes(late_s=(0.4, 0.75), rings_s=(0.3, 0.6), every_s=(25.0, 60.0), swings_s=(8.0, 20.0), sign=SIGN)
def loop_rings(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Gardner, Phaselock Techniques (2005), on loops with little damping: whenever its reference
    jumps, a clock swings about its new time before it settles, and it is late besides; sizes are chosen
    here."""
    values = channels["acceleration"]
    clock = np.arange(len(values)) * dt
    late = np.full(len(values), p.late_s * rng.uniform(0.9, 1.1))
    for jump in np.cumsum(rng.exponential(p.every_s, 40) + 4.0) - p.every_s:
        since = np.maximum(clock - jump, 0.0)
        swings = np.exp(-since / (0.8 * p.swings_s)) * np.sin(2.0 * np.pi * since / p.swings_s)
        late = late + p.rings_s * rng.choice([-1.0, 1.0]) * swings
    channels["acceleration"] = np.interp(clock - np.sign(p.sign) * late, clock, values)


@law("z_each_gear_has_its_table", needs="suburban hills highway", name="speed_scale")
@sizes(scale=(0.02, 0.04), spread=(0.006, 0.014), moves_s=(0.3, 1.0), sign=SIGN)
def each_gear_has_its_table(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: makers' manuals on transmission control, on road speed that is computed from the shaft's speed
    by tables: each gear's ratio was entered with an error of its own, and the axle's with a larger one; sizes
    are chosen here."""
    table = p.spread * rng.uniform(-1.0, 1.0, 40)
    gear = np.clip(np.rint(channels["gear"]), 0, 39).astype(int)
    scale = np.sign(p.sign) * p.scale * rng.uniform(0.95, 1.05) + behind(table[gear], p.moves_s, dt)
    channels["speed"] = channels["speed"] * (1.0 + scale)


@law("z_capacitor_remembers", name="acceleration_bias")
@sizes(bias=(0.09, 0.16), soaks=(0.25, 0.5), first_s=(2.0, 4.0), last_s=(25.0, 60.0), sign=SIGN)
def capacitor_remembers(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Dow, An Analysis of Certain Errors in Electronic Differential Analyzers, II: Capacitor
    Dielectric Absorption, IRE Trans. Electronic Computers 7 (1958): a capacitor gives back for a minute
    what it has soaked up, here beside a constant bias; sizes are chosen here."""
    values = channels["acceleration"]
    times = np.geomspace(p.first_s, p.last_s, 3)
    soaked = np.mean([behind(values, float(tau), dt) for tau in times], axis=0)
    channels["acceleration"] = values + np.sign(p.sign) * p.bias * rng.uniform(0.9, 1.1) + p.soaks * soaked


@law("z_sits_on_the_trailer", name="grade_bias", accepts="rolling_resistance", conceal="elevation")
@sizes(off=(0.008, 0.013), behind_m=(8.0, 14.0), rocks=(0.001, 0.003), rocks_s=(2.0, 6.0), sign=SIGN)
def sits_on_the_trailer(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Fancher and Winkler, A Factbook of the Mechanical Properties of the Components for Single-Unit
    and Articulated Heavy Trucks, UMTRI-86-12 (1986), on hitches and springs: a box on a trailer that stands
    askew reads its slope some metres later, and rocks with its load; sizes are chosen here."""
    grade = channels["grade"]
    way = np.cumsum(np.maximum(channels["speed"], 0.0) * dt) + 1e-6 * np.arange(len(grade))
    later = np.interp(way - p.behind_m, way, grade)
    rocks = p.rocks * ou_series(rng, (1, len(grade)), dt, p.rocks_s)[0]
    channels["grade"] = later + np.sign(p.sign) * p.off * rng.uniform(0.9, 1.1) + rocks
