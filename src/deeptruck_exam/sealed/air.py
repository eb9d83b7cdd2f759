"""Gusts, hatches that lift, and wakes that do not follow the road."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State
from deeptruck_exam.effects.places import Bends
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import some_drives
from deeptruck_model.trucks import View


@hidden("n_gusts_of_the_standard", "sealed", "highway hills", name="headwind", accepts="drag_area")
@sizes(
    mean_mps=(3.0, 7.0), gust_mps=(9.0, 16.0), lasts_s=(8.0, 16.0), every_s=(8.0, 25.0),
    winds_m=(1500.0, 5000.0), turns_rad=(0.5, 1.3),
)  # fmt: skip
class GustsOfTheStandard(Hidden):
    """Each gust dips, rises and dips again, in a mean wind through which the road winds.
    Source: IEC 61400-1, Wind Turbines, Design Requirements: the extreme operating gust is -0.37 of its size
    times sin(3 pi t/T)(1 - cos(2 pi t/T)); how often, how strong, and the road's turns are chosen here."""

    def prepare(self) -> None:
        rng, p, batch = self.rng(901), self.p, self.setting.batch
        shape = (batch, int(2.0 * self.setting.duration_s / p.lasts_s) + 8)
        pauses = p.lasts_s + rng.exponential(p.every_s, shape)
        self.begins = np.cumsum(pauses, axis=1) - p.every_s
        self.size = p.gust_mps * rng.uniform(0.5, 1.2, shape) * rng.choice([-0.6, 1.0, 1.0], shape)
        self.blows = rng.uniform(0.0, 2.0 * np.pi)
        self.phase = rng.uniform(0.0, 2.0 * np.pi, int(self.setting.route.max()) + 1)

    def gust(self, time: float) -> Array:
        """(batch,) m/s."""
        last = np.maximum((self.begins <= time).sum(axis=1) - 1, 0)
        row = np.arange(len(last))
        x = np.clip((time - self.begins[row, last]) / self.p.lasts_s, 0.0, 1.0)
        return np.asarray(-0.37 * self.size[row, last] * np.sin(3 * np.pi * x) * (1 - np.cos(2 * np.pi * x)))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = 2.0 * np.pi * self.place(view) / p.winds_m + self.phase[self.setting.route]
        angle = self.blows - p.turns_rad * np.sin(at)
        wind = p.mean_mps + self.gust(view.time)
        speed = np.maximum(view.speed, 0.5)
        along = speed + self.setting.direction * wind * np.cos(angle)
        total = np.hypot(along, wind * np.sin(angle))
        felt = np.clip(along * total / speed**2, -2.0, 4.0) - 1.0
        return -felt * view.drag_force * np.clip(view.speed / 3.0, 0.0, 1.0)


@hidden("n_hatch_lifts", "sealed", "highway hills", name="drag_area", accepts="rolling_resistance_speed")
@sizes(gain=(0.65, 1.15), lifts_mps=(13.0, 18.0), falls=(0.72, 0.92), swings_s=(0.6, 2.0), loose=(0.4, 0.75))
class HatchLifts(Hidden, up=0.0):
    """`up`: sine of its angle. gain: of the drag area, upright; falls: speed over that at which it lifts;
    loose: share of drives on which it was not latched.
    Source: Moments about a hinge: suction over a roof grows with speed squared (Hucho, Aerodynamics of Road
    Vehicles, 1998, on pressures), weight holds by the cosine; once in the stream it stays up longer. Sizes
    of an unlatched roof hatch are chosen here."""

    def prepare(self) -> None:
        self.loose = some_drives(self.rng(903), self.setting.batch, self.p.loose)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        lifts = p.lifts_mps * (1.0 - (1.0 - p.falls) * np.clip(2.0 * s.up, 0.0, 1.0))
        cosine = np.clip((lifts / np.maximum(view.speed, 1.0)) ** 2, 0.0, 1.0)
        s.up = s.up + dt * (np.sqrt(1.0 - cosine**2) - s.up) / p.swings_s
        return -p.gain * s.up * self.loose * view.drag_force


@hidden(
    "n_wake_goes_straight_on", "sealed", "highway", name="drafting", accepts="drag_area headwind", leader=True
)
@sizes(deficit=(0.75, 0.95), widens=(0.015, 0.04), tightest=(0.004, 0.010), beside_m=(0.3, 1.3))
class WakeGoesStraightOn(Bends):
    """It leaves the follower where the road bends, and in part where the leader drives beside his track.
    widens: m of radius for each m of way.
    Source: Jensen, A Note on Wind Generator Interaction, Risø-M-2411 (1983): a wake of one speed that widens
    and keeps its momentum; a truck's radius, bends and sizes are chosen here."""

    radius_m, half_width_m = 1.4, 1.25

    def prepare(self) -> None:
        rng = self.rng(902)
        self.bend = self.draw_bends(rng, self.p.tightest)
        self.beside = rng.normal(0.0, self.p.beside_m, self.setting.batch)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gap = np.maximum(self.gap(view), 0.0)
        radius = self.radius_m + p.widens * gap
        aside = np.abs(self.beside + 0.5 * self.read(self.bend, view) * gap**2)
        cover = np.clip((radius + self.half_width_m - aside) / (2.0 * self.half_width_m), 0.0, 1.0)
        slower = p.deficit * (self.radius_m / radius) ** 2 * cover
        return (1.0 - (1.0 - slower) ** 2) * view.drag_force
