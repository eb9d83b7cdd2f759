"""Faults of the measurement: nothing is missing in the truck."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Channels, Sizes
from deeptruck_exam.effects.planting import SIGN, fault, sizes
from deeptruck_exam.effects.series import behind

law = partial(fault, family="sealed")


@law("w_sent_by_the_turn", needs="suburban hills", name="clock_offset")
@sizes(turns=(9.0, 18.0), line_s=(0.05, 0.2), steady_s=(0.5, 2.0))
def sent_by_the_turn(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Control units that compute by the crankshaft's turn, not by time (Guzzella and Onder,
    Introduction to Modeling and Control of Internal Combustion Engine Systems, 2010, on event-based delays):
    a sensor on such a unit is late by so many turns, longest at idle; turns are chosen here."""
    values = channels["acceleration"]
    time = np.arange(len(values)) * dt
    speed = behind(np.maximum(channels["engine_speed"], 55.0), p.steady_s, dt)
    late = p.line_s * rng.uniform(0.5, 1.0) + p.turns * 2.0 * np.pi / speed
    channels["acceleration"] = np.interp(time - late, time, values)


@law("w_calibrates_itself", name="speed_scale")
@sizes(ends=(0.03, 0.07), begins=(0.01, 0.05), way_m=(500.0, 2500.0), sign=SIGN)
def calibrates_itself(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Odometers that learn their scale against a map (Krakiwsky, Harris and Wong, A Kalman Filter for
    Integrating Dead Reckoning, Map Matching and GPS Positioning, IEEE PLANS, 1988): the estimate settles over
    the way, here to a wrong value by a map whose distances are wrong; sizes are chosen here."""
    way = np.cumsum(np.maximum(channels["speed"], 0.0)) * dt
    first = p.begins * rng.uniform(-1.0, 1.0)
    scale = np.sign(p.sign) * p.ends + first * np.exp(-way / p.way_m)
    channels["speed"] = channels["speed"] * (1.0 + scale)


@law("w_charge_leaks_away", name="acceleration_bias")
@sizes(bias=(0.15, 0.3), leaks_s=(20.0, 70.0), share=(0.3, 0.7), sign=SIGN)
def charge_leaks_away(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Piezoelectric accelerometers do not hold a steady value (Gautschi, Piezoelectric Sensorics,
    2002: the charge leaks with a time constant): part of what lasts is lost, and comes back with the other
    sign when it ends, upon a false zero of the amplifier; times are chosen here."""
    values = channels["acceleration"]
    lasts = behind(np.concatenate([[0.0], values]), p.leaks_s, dt)[1:]
    bias = np.sign(p.sign) * p.bias * rng.uniform(0.9, 1.1)
    channels["acceleration"] = values - p.share * lasts + bias


@law("w_nose_lifts_with_speed", name="grade_bias", accepts="rolling_resistance", conceal="elevation")
@sizes(bias=(0.008, 0.018), lifts=(0.002, 0.006), rises_s=(0.5, 2.0), sign=SIGN)
def nose_lifts_with_speed(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Katz, Race Car Aerodynamics (1995), and Hucho, Aerodynamics of Road Vehicles (1998), on lift
    with the square of speed, which pitches an inclinometer on a softly sprung cab, here one that is out of
    level as well; sizes are chosen here."""
    wind = (np.maximum(channels["speed"], 0.0) / 20.0 + 0.05 * rng.standard_normal()) ** 2
    pitch = p.lifts * behind(wind, p.rises_s, dt)
    channels["grade"] = channels["grade"] + np.sign(p.sign) * p.bias + pitch
