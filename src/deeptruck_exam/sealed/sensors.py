"""Faults of the measurement: nothing is missing in the truck."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Channels, Sizes
from deeptruck_exam.effects.planting import SIGN, fault, sizes
from deeptruck_exam.effects.series import behind, ou_series

law = partial(fault, family="sealed")


@law("j_pages_fill_by_what_changes", needs="suburban hills", name="clock_offset")
@sizes(base_s=(0.25, 0.4), page_s=(0.7, 1.3), least_s=(0.1, 0.25), calm=(0.15, 0.35))
def pages_fill_by_what_changes(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Bristol, Swinging Door Trending, ISA National Conference (1990), on recording only what
    changes: compressed acceleration fills a page soon where it changes much and late where it is calm, and
    the page is stamped when it is full; times are chosen here."""
    values = channels["acceleration"]
    clock = np.arange(len(values)) * dt
    moves = behind(np.abs(np.gradient(np.nan_to_num(values), dt)), 1.0, dt)
    busy = moves / max(float(moves.mean()), 1e-6)
    page = p.page_s * rng.uniform(0.95, 1.05) / (p.calm + busy)
    late = p.base_s + np.clip(page, p.least_s, 1.6 * p.page_s)
    channels["acceleration"] = np.interp(clock - behind(late, 0.5, dt), clock, values)


@law("j_radar_needs_rough_ground", needs="suburban hills highway", name="speed_scale")
@sizes(scale=(0.026, 0.044), smooth=(0.012, 0.024), rough_m=(120.0, 400.0), smooth_m=(80.0, 250.0))
def radar_needs_rough_ground(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Skolnik, Radar Handbook (2008), on clutter by roughness and angle: a radar for speed hears
    smooth ground most from straight below, so that its mean angle and its speed change with the surface, upon
    a bracket that was mounted too steep; sizes are chosen here."""
    speed = channels["speed"]
    way = np.cumsum(np.maximum(np.nan_to_num(speed), 0.0)) * dt
    count = int(way[-1] // 40.0) + 8
    lengths = rng.exponential(1.0, 2 * count) * np.tile([p.rough_m, p.smooth_m], count)
    on_smooth = np.searchsorted(np.cumsum(lengths), way) % 2
    ratio = 1.0 - p.scale * rng.uniform(0.95, 1.05) - p.smooth * behind(on_smooth.astype(float), 0.6, dt)
    channels["speed"] = speed * ratio


@law("j_table_of_whole_degrees", name="acceleration_bias")
@sizes(bias=(0.09, 0.15), drifts=(0.025, 0.05), degrees=(4.0, 12.0), warms_s=(80.0, 250.0), sign=SIGN)
def table_of_whole_degrees(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Fraden, Handbook of Modern Sensors (2016), on tables that take out the drift by temperature:
    this one has an entry for each few degrees, so that the bias drifts and jumps back again and again as the
    box warms, upon a zero that was set wrongly; sizes are chosen here."""
    values = channels["acceleration"]
    warm = 1.0 - np.exp(-(np.arange(len(values)) * dt + rng.uniform(0.0, 60.0)) / p.warms_s)
    since = (p.degrees * warm + rng.uniform(0.0, 1.0)) % 1.0
    side = np.sign(p.sign)
    channels["acceleration"] = values + side * (
        p.bias * rng.uniform(0.9, 1.1) + p.drifts * (2.0 * since - 1.0)
    )


@law("j_gusts_press_on_the_barometer", name="grade_bias", accepts="rolling_resistance", conceal="elevation")
@sizes(off=(0.008, 0.013), climbs_mps=(0.012, 0.03), lasts_s=(10.0, 40.0), slow_mps=(4.0, 7.0), sign=SIGN)
def gusts_press_on_the_barometer(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Wallace and Hobbs, Atmospheric Science (2006), on pressure and height: slope is reckoned from
    pressure over way, and where the weather's pressure moves, it seems to climb, the more, the slower the
    truck is, upon an error of the reckoning; sizes are chosen here."""
    grade = channels["grade"]
    speed = np.maximum(np.nan_to_num(channels["speed"]), 0.0)
    climbs = p.climbs_mps * np.clip(ou_series(rng, (1, len(grade)), dt, p.lasts_s)[0], -2.5, 2.5)
    seems = behind(climbs / np.maximum(speed, p.slow_mps), 1.0, dt)
    channels["grade"] = grade + np.sign(p.sign) * p.off * rng.uniform(0.9, 1.1) + seems
