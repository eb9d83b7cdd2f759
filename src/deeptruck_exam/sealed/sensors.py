"""Sensors that say what is not so."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Channels, Sizes
from deeptruck_exam.effects.planting import SIGN, fault, sizes
from deeptruck_exam.effects.series import behind


@fault("s_radio_hops", "sealed", "suburban hills", name="clock_offset")
@sizes(late_s=(0.4, 1.0), swings=(0.1, 0.35), turns_s=(30.0, 120.0), sign=SIGN)
def radio_hops(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Clocks of radio sensors follow their crystal's temperature between beacons (Elson, Girod and
    Estrin, Fine-Grained Network Time Synchronization, OSDI 2002); sizes are chosen here."""
    values = channels["acceleration"]
    time = np.arange(len(values)) * dt
    swing = p.swings * np.sin(2.0 * np.pi * time / p.turns_s + rng.uniform(0.0, 6.28))
    channels["acceleration"] = np.interp(time - np.sign(p.sign) * p.late_s * (1.0 + swing), time, values)


@fault("s_radar_looks_down", "sealed", name="speed_scale")
@sizes(scale=(0.04, 0.085), dives=(0.002, 0.008), sign=SIGN)
def radar_looks_down(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Doppler radars over ground read with the cosine of their angle, which mounting and pitch change
    (Tompkins, Hart, Freeland, Wilkerson and Wilhelm, Trans. ASAE 31, 1988); sizes are chosen here."""
    pitch = behind(np.clip(channels["acceleration"], -3.0, 3.0), 0.8, dt)
    channels["speed"] = channels["speed"] * (1.0 + np.sign(p.sign) * p.scale + p.dives * pitch)


@fault("s_supply_sags", "sealed", name="acceleration_bias")
@sizes(bias=(0.15, 0.38), ripple=(0.05, 0.25), turns_s=(15.0, 60.0), sign=SIGN)
def supply_sags(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Ratiometric sensors move with their supply (Fraden, Handbook of Modern Sensors, on ratiometric
    technique): consumers that switch on and off move the zero; sizes are chosen here."""
    time = np.arange(len(channels["acceleration"])) * dt
    duty = (np.sin(2.0 * np.pi * time / p.turns_s + rng.uniform(0.0, 6.28)) > 0.0).astype(float)
    sags = 1.0 + p.ripple * (behind(duty, 2.0, dt) - 0.5)
    channels["acceleration"] = channels["acceleration"] + np.sign(p.sign) * p.bias * sags


@fault("s_bubble_lags", "sealed", name="grade_bias", accepts="rolling_resistance", conceal="elevation")
@sizes(bias=(0.009, 0.022), lag_s=(0.4, 1.8), shakes=(0.0, 0.15), sign=SIGN)
def bubble_lags(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Electrolytic levels settle slowly and shift with vibration (Fraden, Handbook of Modern Sensors,
    on inclination detectors), upon an error of their mounting; sizes are chosen here."""
    settled = behind(channels["grade"], p.lag_s, dt)
    shaken = 1.0 + p.shakes * np.clip(channels["speed"] / 25.0, 0.0, 1.2)
    channels["grade"] = settled + np.sign(p.sign) * p.bias * shaken
