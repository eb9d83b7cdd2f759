"""Brakes of trailers. The tool has no name for them."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="unknown")


@law("overrun_brake", "second", "suburban hills", trucks="trucksim volvo")
@sizes(trailer=(0.25, 0.45), threshold=(0.02, 0.05), gain=(1.0, 2.5), damper_s=(0.3, 1.0))
class OverrunBrake(Hidden, push=0.0):
    """threshold: of the trailer's weight.
    Source: Inertia braking of drawbar trailers, UN Regulation No. 13, annex 12: the trailer brakes itself
    with the push on the coupling, after a threshold, through a damper; numbers of a heavy drawbar trailer,
    chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        trailer = p.trailer * view.mass
        pushes = -trailer * (np.clip(view.acceleration, -4.0, 4.0) + GRAVITY * view.grade)
        lag = np.where(pushes > s.push, p.damper_s, 2.5 * p.damper_s)
        s.push += dt * (pushes - s.push) / lag
        braked = p.gain * np.maximum(s.push - p.threshold * trailer * GRAVITY, 0.0)
        return -np.minimum(braked, 0.35 * trailer * GRAVITY) * moving(view)


@law("stretch_brake", "fourth", "suburban descent", trucks="trucksim volvo")
@sizes(depth=(0.022, 0.050), period_s=(2.0, 4.5), duty=(0.3, 0.5), below_mps=(11.0, 14.0))
class StretchBrake(Hidden, closed=0.0, force=0.0):
    """depth: over weight. No pedal is pressed, and no brake command is recorded.
    Source: Stretch brakes (truck makers' driver guides): while the throttle is closed at low speed the
    trailer's brakes are pulsed, to keep the train straight; pulses and depth are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        closed = (view.u[:, 0] <= 0.01 * self.truck.full_command) & (view.speed > 1.5)
        s.closed = np.where(closed & (view.speed < p.below_mps), s.closed + dt, 0.0)
        within = (s.closed - 0.5) / p.period_s
        pulse = (s.closed > 0.5) & (within - np.floor(within) < p.duty)
        s.force += dt * (p.depth * weight(view) * pulse - s.force) / np.where(pulse, 0.2, 0.3)
        return -s.force * moving(view)


@law("timed_trailer_brakes", "fourth", "suburban descent")
@sizes(level=(0.025, 0.055), ramp_s=(1.5, 4.0), lets_go_s=(0.2, 0.8))
class TimedTrailerBrakes(Hidden, current=0.0):
    """level: over weight; magnets grip less as the wheels slow down.
    Source: Time-delayed controllers of electric trailer brakes (suppliers' installation guides; SAE J2663 on
    electric brakes): the stop-lamp switch starts a ramp to a dialled level, however gently the driver brakes;
    ramps and levels are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        lamp = view.u[:, 1] > 0.02
        rate = np.where(lamp, 1.0 / p.ramp_s, -1.0 / p.lets_go_s)
        s.current = np.clip(s.current + dt * rate, 0.0, 1.0)
        grips = np.clip(np.maximum(view.speed, 0.0) / 5.0, 0.0, 1.0) ** 0.5
        return -p.level * s.current * grips * weight(view) * moving(view)
