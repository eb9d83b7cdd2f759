"""Faults of the measurement: nothing is missing in the truck."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Channels, Sizes
from deeptruck_exam.effects.planting import SIGN, fault, sizes
from deeptruck_exam.effects.series import behind, ou_series

law = partial(fault, family="sealed")


@law("h_blocks_have_to_be_erased", needs="suburban hills", name="clock_offset")
@sizes(late_s=(0.35, 0.6), grows_s=(0.25, 0.5), block_s=(15.0, 45.0), power=(0.5, 1.5))
def blocks_have_to_be_erased(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Bez, Camerlenghi, Modelli and Visconti, Introduction to Flash Memory, Proc. IEEE 91 (2003): a
    recorder stamps acceleration as it is stored, and each block that fills makes storing slower, until it has
    been erased and all begins anew; sizes are chosen here."""
    values = channels["acceleration"]
    clock = np.arange(len(values)) * dt
    block = p.block_s * rng.uniform(0.9, 1.1)
    full = ((clock + rng.uniform(0.0, block)) % block) / block
    channels["acceleration"] = np.interp(clock - p.late_s - p.grows_s * full**p.power, clock, values)


@law("h_tyre_goes_down", needs="suburban hills highway", name="speed_scale")
@sizes(scale=(0.018, 0.03), sinks=(0.012, 0.028), way_m=(800.0, 3000.0), sign=SIGN)
def tyre_goes_down(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Persson, Gustafsson and Drevö, Indirect Tire Pressure Monitoring Using Sensor Fusion, SAE
    2002-01-1250, on radii by pressure: a wheel of the wrong size besides loses air on the way, and turns ever
    faster for the same speed; sizes are chosen here."""
    speed = channels["speed"]
    way = np.cumsum(np.maximum(np.nan_to_num(speed), 0.0)) * dt
    down = 1.0 - np.exp(-(way + rng.uniform(0.0, 400.0)) / p.way_m)
    side = np.sign(p.sign)
    channels["speed"] = speed * (1.0 + side * (p.scale * rng.uniform(0.95, 1.05) + p.sinks * down))


@law("h_folds_the_engine_down", name="acceleration_bias")
@sizes(bias=(0.09, 0.15), folded=(0.03, 0.07), rate_hz=(17.0, 29.0), sign=SIGN)
def folds_the_engine_down(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Oppenheim and Schafer, Discrete-Time Signal Processing (2010), on aliasing, and IEEE Std
    1293-1998 on rectified vibration: a box that samples slowly takes the shaking of an engine for a slow
    swing, upon a bias that the same shaking makes; sizes are chosen here."""
    values = channels["acceleration"]
    speed = channels.get("engine_speed", np.full(len(values), 130.0))
    hertz = behind(np.nan_to_num(speed, nan=130.0), 0.3, dt) / (2.0 * np.pi)
    folded = hertz - p.rate_hz * np.rint(hertz / p.rate_hz)
    swing = np.cos(2.0 * np.pi * (np.cumsum(folded) * dt + rng.random()))
    bias = np.sign(p.sign) * p.bias * rng.uniform(0.9, 1.1)
    slow = 1.0 / (1.0 + (folded / 2.0) ** 2)  # what a filter behind it leaves
    channels["acceleration"] = values + bias + p.folded * slow * swing


@law("h_one_side_in_the_sun", name="grade_bias", accepts="rolling_resistance", conceal="elevation")
@sizes(off=(0.007, 0.012), warps=(0.002, 0.005), road_m=(400.0, 1500.0), warms_s=(20.0, 60.0), sign=SIGN)
def one_side_in_the_sun(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Fraden, Handbook of Modern Sensors (2016), on inclinometers and gradients of temperature: the
    sun warms one side of a bracket, another after each bend, and warps it slowly, upon an error of its
    mounting; sizes are chosen here."""
    grade = channels["grade"]
    way = np.cumsum(np.maximum(np.nan_to_num(channels["speed"]), 0.0)) * dt
    heading = ou_series(rng, (1, int(way[-1] / 10.0) + 3), 10.0, p.road_m)[0]
    sunny = np.sin(2.0 * np.interp(way, 10.0 * np.arange(len(heading)), heading) + rng.uniform(0.0, 6.3))
    warps = p.warps * behind(sunny, p.warms_s, dt)
    channels["grade"] = grade + np.sign(p.sign) * p.off * rng.uniform(0.9, 1.1) + warps
