"""Air that moves, bodies that stand in it, trucks ahead."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, moving
from deeptruck_exam.effects.places import Bends
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View


@hidden("s_rolls_of_the_boundary_layer", "sealed", "highway hills", name="headwind", accepts="drag_area")
@sizes(mean_mps=(2.0, 6.0), rolls_mps=(2.5, 5.0), length_m=(500.0, 1800.0), drifts_mps=(1.0, 6.0))
class Rolls(Hidden):
    """Bands of wind that drift over the road, met faster or slower by the way one drives.
    Source: Etling and Brown, Roll Vortices in the Planetary Boundary Layer, Boundary-Layer Meteorology 65
    (1993): regular bands of fast and slow air; two wavelengths, sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(801), self.setting.batch
        self.phase = rng.uniform(0.0, 2.0 * np.pi, (2, batch))
        self.mean = self.p.mean_mps * rng.choice([-1.0, 1.0]) * self.setting.direction

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = self.place(view) - p.drifts_mps * view.time
        long = np.sin(2.0 * np.pi * at / p.length_m + self.phase[0])
        short = np.sin(2.0 * np.pi * at / (0.37 * p.length_m) + self.phase[1])
        wind = self.mean + self.setting.direction * p.rolls_mps * (0.7 * long + 0.45 * short)
        speed = np.maximum(view.speed, 0.5)
        relative = np.clip(1.0 + wind / speed, -1.5, 3.0)
        felt = (relative * np.abs(relative) - 1.0) * view.drag_force
        return -felt * np.clip(view.speed / 3.0, 0.0, 1.0)


@hidden("s_gap_opens_in_bends", "sealed", "highway hills", name="drag_area", accepts="headwind")
@sizes(gain=(0.4, 0.9), tightest=(0.0025, 0.006), closes_m=(60.0, 250.0))
class GapOpensInBends(Bends, angle=0.0):
    """gain: of the drag, at the tightest bend. The trailer follows over its length.
    Source: Drag of articulated trucks over the gap and the angle between tractor and trailer (Hucho,
    Aerodynamics of Road Vehicles, 1998, on commercial vehicles); sizes are chosen here."""

    def prepare(self) -> None:
        self.bend = self.draw_bends(self.rng(802), self.p.tightest)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        bend = np.abs(self.read(self.bend, view)) / p.tightest
        way = np.where(bend > s.angle, 12.0, p.closes_m)
        s.angle = s.angle + dt * np.maximum(view.speed, 0.0) * (bend - s.angle) / way
        return -p.gain * np.sqrt(np.clip(s.angle, 0.0, 1.0)) * view.drag_force * moving(view)


@hidden("s_wake_has_to_form", "sealed", "highway", name="drafting", accepts="drag_area headwind", leader=True)
@sizes(saving=(0.45, 0.7), reach_m=(25.0, 50.0), forms_m=(60.0, 250.0), breaks_mps=(0.8, 2.5))
class WakeHasToForm(Hidden, formed=0.0):
    """breaks_mps: change of gap in a second that breaks it. It forms again over the way.
    Source: Le Good, Resnick, Boardman and Clough, Effects on the Aerodynamic Characteristics of Vehicles in
    Longitudinal Proximity, SAE 2018-37-0018, on steady pairs; the loss when gaps change is chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"formed": np.full(batch, 0.5), "gap": np.full(batch, np.nan)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gap = self.gap(view)
        s.gap = np.where(np.isnan(s.gap), gap, s.gap)
        s.gap = s.gap + dt * (gap - s.gap) / 0.8
        broken = np.clip(np.abs(gap - s.gap) / 0.8 / p.breaks_mps - 0.5, 0.0, 1.0)
        forms = np.maximum(view.speed, 0.0) * (1.0 - s.formed) / p.forms_m - broken * s.formed / 1.5
        s.formed = np.clip(s.formed + dt * forms, 0.0, 1.0)
        return p.saving * s.formed * np.exp(-((gap / p.reach_m) ** 2)) * view.drag_force
