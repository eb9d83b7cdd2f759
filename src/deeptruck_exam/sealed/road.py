"""Slabs that have faulted, and ramps over junctions."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Sizes, State, moving, weight
from deeptruck_exam.effects.places import MAP_CELL_M, MAP_CELLS, OnRoad, sections
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("w_slabs_have_faulted", name="road_surface", accepts="road_grade")
@sizes(loss=(0.010, 0.022), mean_m=(250.0, 800.0), bounce_hz=(1.9, 2.8), sharp=(1.5, 3.0), joints=(0.25, 0.5))
class SlabsHaveFaulted(OnRoad, swings=0.0):
    """Slabs of concrete step down at each joint, in some sections more than in others. Their springs and
    dampers take most where joints come with the bounce of the truck, and `swings` until they rest. loss: of
    the weight, in resonance, on bad sections; joints: of it, blows at any speed.
    Source: Byrum, Analysis by High-Speed Profile of Jointed Concrete Pavement Slab Curvatures, Transp. Res.
    Record 1730 (2000), on faulted joints, and Gillespie, Fundamentals of Vehicle Dynamics (1992), on bounce
    tuned to joints; sections are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1161)
        number = sections(rng, self.rows(), self.p.mean_m)
        kinds = rng.choice([0.0, 0.0, 0.5, 1.0, 1.0], (self.rows(), int(number.max()) + 1))
        slab_m = rng.choice([4.5, 5.0, 6.0, 7.5], kinds.shape)
        self.bad = np.take_along_axis(kinds, number, axis=1)
        self.slab_m = np.take_along_axis(slab_m, number, axis=1)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        tuned = speed / self.read(self.slab_m, view) / p.bounce_hz
        peak = 1.0 / (1.0 + p.sharp**2 * (np.maximum(tuned, 0.05) - 1.0 / np.maximum(tuned, 0.05)) ** 2)
        blows = p.joints * np.clip(speed / 15.0, 0.0, 1.5)
        wants = self.read(self.bad, view) * (blows + (1.0 - p.joints) * peak)
        s.swings = s.swings + dt * (wants - s.swings) / 0.7
        return -p.loss * s.swings * weight(view) * moving(view)


@law(
    "w_over_the_junction",
    needs="hills highway suburban",
    name="road_grade",
    accepts="road_surface",
    gateable=False,
)
@sizes(high_m=(3.5, 6.5), ramp_m=(130.0, 220.0), top_m=(40.0, 150.0), apart_m=(300.0, 900.0), dips=(0.2, 0.5))
class OverTheJunction(OnRoad):
    """The map has the level of the land; the road goes over its junctions on ramps, or under them. high_m: of
    a crossing over the road below; dips: share that go under, less deep.
    Source: AASHTO, A Policy on Geometric Design of Highways and Streets (2018), chapter 10: clearances and
    grades of separated crossings; where they lie is chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(1162), self.p
        self.road = np.zeros((self.rows(), MAP_CELLS))
        for row in self.road:
            height, at = np.zeros(MAP_CELLS), rng.uniform(0.0, p.apart_m)
            while at < MAP_CELL_M * MAP_CELLS:
                rise = p.high_m * rng.uniform(0.7, 1.1) * np.where(rng.random() < p.dips, -0.8, 1.0)
                height = height + rise * self.bridge(at, rng.uniform(0.5, 1.5) * p.top_m)
                at += 2.0 * p.ramp_m + 1.5 * p.top_m + rng.uniform(0.5, 1.5) * p.apart_m
            row[:] = np.clip(np.gradient(height, MAP_CELL_M), -0.05, 0.05)

    def bridge(self, first_m: float, top_m: float) -> Array:
        """Height (cells,) of one, over its most: up a ramp, along the top and down."""
        metres = np.arange(MAP_CELLS) * MAP_CELL_M - first_m
        up = np.clip(metres / self.p.ramp_m, 0.0, 1.0)
        down = np.clip((metres - self.p.ramp_m - top_m) / self.p.ramp_m, 0.0, 1.0)
        return np.asarray(up**2 * (3.0 - 2.0 * up) - down**2 * (3.0 - 2.0 * down))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        return -self.between(self.road, view) * weight(view) * moving(view)
