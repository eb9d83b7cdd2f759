"""Sensors and loggers that say what is not so."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Channels, Sizes
from deeptruck_exam.effects.planting import SIGN, fault, sizes
from deeptruck_exam.effects.series import behind


@fault("n_queue_in_the_gateway", "sealed", "suburban hills", name="clock_offset")
@sizes(late_s=(0.4, 0.9), stalls_s=(0.3, 1.0), every_s=(8.0, 30.0), drains=(0.05, 0.2))
def queue_in_the_gateway(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Lindley, The Theory of Queues with a Single Server, Proc. Cambridge Phil. Soc. 48 (1952): what
    waits grows by what comes, here stalls of a gateway, and falls at a constant rate; sizes are chosen
    here."""
    values = channels["acceleration"]
    comes = (rng.random(len(values)) < dt / p.every_s) * rng.exponential(p.stalls_s, len(values))
    waits, queue = np.zeros(len(values)), 0.0
    for k, more in enumerate(comes.tolist()):
        queue = max(min(queue + more, 1.2) - p.drains * dt, 0.0)
        waits[k] = queue
    time = np.arange(len(values)) * dt
    channels["acceleration"] = np.interp(time - p.late_s - waits, time, values)


@fault("n_pulses_are_missed", "sealed", name="speed_scale")
@sizes(scale=(0.04, 0.09), misses=(0.02, 0.06), weak_mps=(3.0, 7.0), sign=SIGN)
def pulses_are_missed(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Inductive pickups give a voltage in proportion to speed, so that slow teeth fall below the
    trigger (Fraden, Handbook of Modern Sensors, on magnetic sensors), upon a wrong number of teeth; sizes are
    chosen here."""
    missed = p.misses * np.exp(-channels["speed"] / p.weak_mps)
    channels["speed"] = channels["speed"] * (1.0 + np.sign(p.sign) * p.scale) * (1.0 - missed)


@fault("n_engine_shakes_the_box", "sealed", name="acceleration_bias")
@sizes(bias=(0.15, 0.36), rings=(0.2, 0.7), at_rads=(95.0, 165.0), wide_rads=(10.0, 30.0), sign=SIGN)
def engine_shakes_the_box(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Vibration rectification (IEEE Std 1293) where the firing frequency meets the resonance of a
    bracket: the response of a damped oscillator over engine speed; sizes are chosen here."""
    away = (channels["engine_speed"] - p.at_rads) / p.wide_rads
    rings = 1.0 + p.rings * (behind(1.0 / (1.0 + away**2), 0.5, dt) - 0.3)
    channels["acceleration"] = channels["acceleration"] + np.sign(p.sign) * p.bias * rings


@fault(
    "n_believes_in_flat_land", "sealed", name="grade_bias", accepts="rolling_resistance", conceal="elevation"
)
@sizes(bias=(0.009, 0.02), takes=(0.1, 0.35), learns_s=(60.0, 200.0), sign=SIGN)
def believes_in_flat_land(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Inclinometers that trim their zero by the mean of the road, as if that were level (adaptive
    offsets of slope sensors: Kiencke and Nielsen, Automotive Control Systems, 2005, on observers), upon an
    error of their mounting; sizes are chosen here."""
    mean = behind(np.append(0.0, channels["grade"]), p.learns_s, dt)[1:]
    channels["grade"] = channels["grade"] + np.sign(p.sign) * p.bias - p.takes * mean
