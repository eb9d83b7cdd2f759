"""Faults of the measurement: nothing is missing in the truck."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Channels, Sizes
from deeptruck_exam.effects.planting import SIGN, fault, sizes
from deeptruck_exam.effects.series import behind, ou_series

law = partial(fault, family="sealed")


@law("k_polled_by_turns", needs="suburban hills", name="clock_offset")
@sizes(round_s=(0.4, 0.8), absent=(0.1, 0.35), timeout_s=(0.4, 1.0), line_s=(0.05, 0.2))
def polled_by_turns(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Modbus over Serial Line, Specification and Implementation Guide V1.02 (2006): one master asks
    its devices by turns and waits in vain for those that are absent; what it has of a device is held until it
    is its turn again; rounds and times are chosen here."""
    values = channels["acceleration"]
    clock = np.arange(len(values)) * dt
    count = int(clock[-1] / (0.8 * p.round_s)) + 4
    rounds = p.round_s * rng.uniform(0.9, 1.1, count) + p.timeout_s * (rng.random(count) < p.absent)
    asked = np.concatenate([[-1e-9], np.cumsum(rounds)])
    last = asked[np.searchsorted(asked, clock, side="right") - 1]
    channels["acceleration"] = np.interp(last - p.line_s, clock, values)


@law("k_from_the_dashboard", name="speed_scale")
@sizes(scale=(0.03, 0.065), more_mps=(0.2, 0.7), needle_s=(0.15, 0.5))
def from_the_dashboard(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: UN Regulation No. 39 on speedometers, which never show less than the speed, and at most a
    tenth and 4 km/h more: a logger that reads the instrument, with the lag of its needle, has a scale and a
    little on top of that; sizes are chosen here."""
    values = channels["speed"]
    top = p.more_mps * np.clip(values / 4.0, 0.0, 1.0)
    shown = values * (1.0 + p.scale * rng.uniform(0.95, 1.05)) + top
    channels["speed"] = behind(shown, p.needle_s, dt)


@law("k_feels_the_bends_too", name="acceleration_bias")
@sizes(bias=(0.12, 0.24), crossed=(0.06, 0.14), bend_m=(60.0, 200.0), tight=(0.002, 0.006), sign=SIGN)
def feels_the_bends_too(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Titterton and Weston, Strapdown Inertial Navigation Technology (2004), on cross-coupling of
    accelerometers: a box that is turned about the vertical feels part of what presses aside in bends, upon
    its bias; bends and sizes are chosen here."""
    speed = np.maximum(channels["speed"], 0.0)
    way = np.cumsum(speed) * dt
    cells = ou_series(rng, (1, int(way[-1] / 5.0) + 3), 5.0, p.bend_m)[0]
    bend = p.tight * np.interp(way / 5.0, np.arange(len(cells)), cells)
    aside = np.clip(speed**2 * bend, -2.5, 2.5)
    channels["acceleration"] = channels["acceleration"] + np.sign(p.sign) * p.bias + p.crossed * aside


@law("k_two_antennas", name="grade_bias", accepts="rolling_resistance", conceal="elevation")
@sizes(bias=(0.009, 0.017), echoes=(0.001, 0.003), sky_s=(20.0, 60.0), jumps=(0.001, 0.003), sign=SIGN)
def two_antennas(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Bae, Ryu and Gerdes, Road Grade and Vehicle Parameter Estimation for Longitudinal Control Using
    GPS, IEEE ITSC (2001), on slope by two antennas: masts that are not level, echoes that change as the sky
    turns, and a jump when the set of satellites does; sizes are chosen here."""
    count = len(channels["grade"])
    echoes = p.echoes * ou_series(rng, (1, count), dt, p.sky_s)[0]
    sets = np.cumsum(rng.random(count) < dt / p.sky_s)
    jumps = p.jumps * rng.standard_normal(int(sets[-1]) + 1)[sets]
    off = np.sign(p.sign) * p.bias * rng.uniform(0.95, 1.05)
    channels["grade"] = channels["grade"] + off + echoes + behind(jumps, 1.0, dt)
