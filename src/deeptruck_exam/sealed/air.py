"""Wind over fields and woods, a column of leaders, round loads."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, index, moving
from deeptruck_exam.effects.places import CELL_M, CELLS, OnRoad, stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("e_fields_and_woods", needs="hills highway", name="headwind", accepts="drag_area")
@sizes(aloft_mps=(12.0, 19.0), rough_m=(0.5, 1.2), smooth_m=(0.003, 0.03), fetch_m=(60.0, 250.0))
@sizes(gusts=(1.6, 2.6))
class FieldsAndWoods(OnRoad):
    """`rough`: logarithm of the roughness length that the wind at the truck's height has come to; it follows
    the land over a fetch, into the woods sooner than out of them. The rougher the land, the weaker the wind
    and the gustier. aloft_mps: at 60 m; gusts: standard deviation over the friction velocity.
    Source: Garratt, The Internal Boundary Layer - A Review, Boundary-Layer Meteorology 50 (1990), on changes
    of roughness; gusts of 2.4 friction velocities (Panofsky and Dutton, Atmospheric Turbulence, 1984); woods,
    headings and the least wind in them are chosen here."""

    high_m, aloft_m = 3.0, 60.0

    def prepare(self) -> None:
        rng, p, batch = self.rng(1001), self.p, self.setting.batch
        self.land = np.full((self.rows(), CELLS), np.log(p.smooth_m))
        self.heading = np.empty((self.rows(), CELLS))
        for land, heading in zip(self.land, self.heading, strict=True):
            for first, last in stretches(rng, (250.0, 1500.0), (200.0, 900.0)):
                land[first:last] = np.log(p.rough_m)
            heading[:] = rng.uniform(-1.0, 1.0) + 0.35 * ou_series(rng, (1, CELLS), CELL_M, 900.0)[0]
        self.side = rng.choice([-1.0, 1.0])
        self.turbulence = ou_series(rng, (batch, int(self.setting.duration_s / 0.1) + 20), 0.1, 4.0)

    def start(self, batch: int) -> dict[str, Array]:
        return {"rough": np.full(batch, np.nan)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        land, speed = self.read(self.land, view), np.maximum(view.speed, 0.0)
        s.rough = np.where(np.isnan(s.rough), land, s.rough)
        fetch = p.fetch_m * np.where(land > s.rough, 0.6, 1.4)
        s.rough = s.rough + dt * (speed + 3.0) * (land - s.rough) / fetch
        friction = 0.4 * p.aloft_mps / (np.log(self.aloft_m) - s.rough)
        mean = 2.5 * friction * np.maximum(np.log(self.high_m) - s.rough, 0.6)
        gust = p.gusts * friction * self.turbulence[:, index(view, self.turbulence, 0.1)]
        heading = self.read(self.heading, view)
        along = self.side * self.setting.direction * np.cos(heading) * (mean + gust)
        relative = np.clip(1.0 + along / np.maximum(view.speed, 0.5), -1.5, 3.0)
        felt = (relative * np.abs(relative) - 1.0) * view.drag_force
        return -felt * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("e_rank_in_the_column", needs="highway", name="drafting", accepts="drag_area headwind", leader=True)
@sizes(deficit=(0.35, 0.5), length_m=(10.0, 22.0), apart_m=(18.0, 40.0), changes_s=(15.0, 50.0))
class RankInTheColumn(Hidden, ranked=1.0):
    """The leader is the last of one to five in a row, of whom some leave and others join; their wakes add up
    by squares. deficit: of the wind of driving, right behind one; length_m: over which a wake is mixed.
    Source: Katic, Højstrup and Jensen, A Simple Model for Cluster Efficiency, European Wind Energy Conference
    (1986), on wakes that add by squares; who drives farther back saves more (Davila, Aramburu and
    Freixas, Making the Best Out of Aerodynamics: Platoons, SAE 2013-01-0767); sizes are chosen here."""

    def prepare(self) -> None:
        rng, shape = self.rng(1002), (self.setting.batch, int(self.setting.duration_s) + 20)
        self.ranks = np.empty(shape)
        for row in self.ranks:
            turns = rng.random(shape[1]) < 1.0 / self.p.changes_s
            row[:] = rng.integers(1, 6, shape[1] + 1)[np.cumsum(turns)]

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.ranked = s.ranked + dt * (self.ranks[:, index(view, self.ranks)] - s.ranked) / 3.0
        gap = np.maximum(self.gap(view), 0.0)
        squares = np.zeros(len(gap))
        for k in range(5):
            there = np.clip(s.ranked - k, 0.0, 1.0)
            squares += there / (1.0 + (gap + k * p.apart_m) / p.length_m) ** 2
        slower = np.minimum(p.deficit * np.sqrt(squares), 0.8)
        return (1.0 - (1.0 - slower) ** 2) * view.drag_force


@law("e_round_loads", needs="highway hills", name="drag_area", accepts="rolling_resistance_speed")
@sizes(more=(0.7, 1.2), thick_m=(0.21, 0.29), left=(0.3, 0.5), apart=(0.03, 0.08))
class RoundLoads(Hidden, late=0.0):
    """Tubes lie across the stream: their drag falls to a half or less where the flow becomes turbulent, and
    rises again at a lower speed. `late`: 1 where it separates late. more: of the drag, below, with the
    whole load, which is not on every drive; left: of that, above; apart: of the Reynolds number, between
    there and back.
    Source: Schewe, On the Force Fluctuations Acting on a Circular Cylinder in Crossflow from Subcritical up
    to Transcritical Reynolds Numbers, J. Fluid Mech. 133 (1983): a jump at 300 000, with hysteresis; loads
    are chosen here."""

    viscosity = 1.8e-5
    critical = 3.0e5

    def prepare(self) -> None:
        self.loaded = self.rng(1003).permutation(np.tile([1.0, 0.7, 1.0, 0.0], 1 + self.setting.batch // 4))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        reynolds = np.maximum(view.speed, 0.0) * p.thick_m * self.truck.air_density / self.viscosity
        threshold = self.critical * (1.0 + p.apart * np.where(s.late > 0.5, -1.0, 1.0))
        wanted = 1.0 / (1.0 + np.exp(-np.clip((reynolds / threshold - 1.0) / 0.015, -40.0, 40.0)))
        s.late = s.late + dt * (wanted - s.late) / 0.6
        share = p.more * self.loaded[: len(reynolds)] * (1.0 - (1.0 - p.left) * s.late)
        return -share * view.drag_force * moving(view)
