"""Faults of the measurement: nothing is missing in the truck."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Channels, Sizes
from deeptruck_exam.effects.planting import SIGN, fault, sizes
from deeptruck_exam.effects.series import behind

law = partial(fault, family="sealed")


@law("b_recorder_dozes_at_low_speed", needs="suburban hills", name="clock_offset")
@sizes(late_s=(0.3, 0.5), dozes_s=(0.5, 0.9), below_mps=(7.0, 11.0), wakes_s=(3.0, 9.0))
def recorder_dozes_at_low_speed(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Benini, Bogliolo and De Micheli, A Survey of Design Techniques for System-Level Dynamic Power
    Management, IEEE Trans. VLSI Systems 8 (2000): a recorder lowers its clock when the truck is slow, and
    then stamps acceleration later than when it is awake; sizes are chosen here."""
    values = channels["acceleration"]
    clock = np.arange(len(values)) * dt
    speed = np.maximum(np.nan_to_num(channels["speed"]), 0.0)
    dozes = behind(1.0 / (1.0 + (speed / p.below_mps) ** 4), p.wakes_s, dt)
    late = p.late_s * rng.uniform(0.95, 1.05) + p.dozes_s * dozes
    channels["acceleration"] = np.interp(clock - late, clock, values)


@law("b_counter_is_dead_after_each_tooth", needs="suburban hills highway", name="speed_scale")
@sizes(dead=(0.02, 0.045), scale=(0.022, 0.04))
def counter_is_dead_after_each_tooth(
    p: Sizes, channels: Channels, dt: float, rng: np.random.Generator
) -> None:
    """Source: Knoll, Radiation Detection and Measurement (2010), on dead time, of which any counter of pulses
    has some: the faster teeth pass, the more of them fall into it; upon a wheel taken for larger than it is,
    so that both make it slower; sizes are chosen here."""
    speed = channels["speed"]
    counted = speed / (1.0 + p.dead * np.maximum(np.nan_to_num(speed), 0.0) / 20.0)
    channels["speed"] = counted * (1.0 - p.scale * rng.uniform(0.95, 1.05))


@law("b_sealed_box_feels_the_height", name="acceleration_bias")
@sizes(bias=(0.1, 0.16), per_m=(0.0008, 0.002), most=(0.03, 0.05), sign=SIGN)
def sealed_box_feels_the_height(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Fraden, Handbook of Modern Sensors (2016), on stress from packages, which bend with the
    pressure of the air: a sealed sensor whose bias goes with the height that the truck has climbed since it
    was set to zero, wrongly; sizes are chosen here."""
    values = channels["acceleration"]
    speed = np.maximum(np.nan_to_num(channels["speed"]), 0.0)
    grade = np.nan_to_num(channels.get("grade", np.zeros(len(values))))
    climbed = np.cumsum(speed * grade) * dt
    bends = p.most * np.tanh(p.per_m * climbed / p.most)
    channels["acceleration"] = values + np.sign(p.sign) * p.bias * rng.uniform(0.9, 1.1) + bends


@law("b_frame_twists_with_the_torque", name="grade_bias", accepts="rolling_resistance", conceal="elevation")
@sizes(off=(0.007, 0.012), twists=(0.002, 0.0045), settles_s=(0.5, 2.0), sign=SIGN)
def frame_twists_with_the_torque(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Gillespie, Fundamentals of Vehicle Dynamics (1992), on what the engine's torque does to a
    frame: a sensor on a cross member beside the engine leans as the torque is carried by its mounts, upon an
    error of its mounting; sizes are chosen here."""
    grade = channels["grade"]
    torque = np.nan_to_num(channels.get("engine_torque", np.zeros(len(grade))))
    leans = p.twists * behind(np.clip(torque / 1000.0, -0.5, 2.2), p.settles_s, dt)
    channels["grade"] = grade + np.sign(p.sign) * (p.off * rng.uniform(0.9, 1.1) + leans)
