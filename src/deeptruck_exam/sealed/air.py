"""Cold air that sloshes in its basin, cars that slip in behind a leader, and plates that hang in the wind."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, index, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("j_cold_air_sloshes", needs="highway hills suburban", name="headwind", accepts="drag_area")
@sizes(wind_mps=(6.5, 10.5), basin_m=(1600.0, 4200.0), swings_s=(70.0, 200.0), fades=(0.15, 0.4))
class ColdAirSloshes(Hidden):
    """Cold air lies in each basin between two ridges and sloshes to and fro, as water in a tub: the wind
    swings everywhere at the same time, most in the middle of a basin, and never blows over its ridges. Basins
    beside each other swing by turns. wind_mps: at most; basin_m: from ridge to ridge; fades: of the swing, by
    which it waxes and wanes.
    Source: Lareau and Horel, Dynamically Induced Displacements of a Persistent Cold-Air Pool, Boundary-Layer
    Meteorology 154 (2015), on seiches of cold pools; a lively small one, sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(2201), self.p
        seconds = int(self.setting.duration_s) + 3
        self.ridge = rng.uniform(0.0, 2.0 * p.basin_m, int(self.setting.route.max()) + 1)
        phase = rng.uniform(0.0, 2.0 * np.pi, (self.setting.batch, 1))
        swing = np.sin(2.0 * np.pi * np.arange(seconds) / p.swings_s + phase)
        waxes = 1.0 + p.fades * ou_series(rng, (self.setting.batch, seconds), 1.0, 1.5 * p.swings_s)
        self.swing = swing * np.clip(waxes, 0.2, 1.8)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        across = np.sin(np.pi * (self.place(view) - self.ridge[self.setting.route]) / p.basin_m)
        wind = p.wind_mps * across * self.swing[:, index(view, self.swing)]
        against = np.clip(1.0 - self.setting.direction * wind / np.maximum(view.speed, 3.0), -1.0, 2.5)
        return -(against * np.abs(against) - 1.0) * view.drag_force * np.clip(view.speed / 3.0, 0.0, 1.0)


@law(
    "j_cars_slip_in_between",
    needs="highway hills",
    name="drafting",
    accepts="drag_area headwind",
    leader=True,
)
@sizes(most=(0.7, 0.92), reach_m=(90.0, 170.0), room_m=(28.0, 45.0), waits_s=(6.0, 20.0), leaves=(0.15, 0.35))
@sizes(stays_s=(15.0, 45.0))
class CarsSlipInBetween(Hidden, between=0.0, tempts=0.0, saved=0.0):
    """Whoever leaves much room to a leader soon has a car in it, which takes his wake and leaves one of its
    own that is next to nothing. It goes when it is bored, or at once when the truck comes close. `tempts`: 1
    when room was left long enough; `between`: 1 with a car there. most: of the drag, saved right behind the
    leader; room_m: for a car; waits_s: until one comes; leaves: of what is saved, behind a car.
    Source: Hucho, Aerodynamics of Road Vehicles (1998), on wakes, and Sultan, Brackstone and McDonald,
    Drivers' Use of Deceleration and Acceleration Information in Car-Following Process, TRR 1883 (2004), on
    gaps that others take; sizes are chosen here."""

    def prepare(self) -> None:
        self.mood = self.rng(2202).uniform(0.5, 1.6, self.setting.batch)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gap = np.clip(self.gap(view), 3.0, 1e4)
        roomy = (gap > p.room_m) & (view.speed > 6.0)
        tempts = np.where(roomy, 1.0 / (p.waits_s * self.mood), -1.0 / (0.5 * p.waits_s))
        bored = -1.0 / (p.stays_s * self.mood)
        s.tempts = np.clip(s.tempts + dt * np.where(s.between > 0.5, bored, tempts), 0.0, 1.0)
        comes = (s.tempts >= 1.0) & roomy
        goes = (s.tempts <= 0.0) | (gap < 0.5 * p.room_m)
        s.between = np.where(comes, 1.0, np.where(goes, 0.0, s.between))
        open_way = p.most / (1.0 + (gap / p.reach_m) ** 2)
        s.saved = eased(s.saved, open_way * (1.0 - (1.0 - p.leaves) * s.between), 1.2, dt)
        return s.saved * view.drag_force * moving(view)


@law(
    "j_plates_swing_back",
    needs="suburban hills highway",
    name="drag_area",
    accepts="headwind rolling_resistance_speed",
)
@sizes(more=(3.0, 4.4), lifts_mps=(12.0, 15.5), long_m=(0.7, 1.6), dull=(0.2, 0.5), flies=(0.8, 1.2))
class PlatesSwingBack(Hidden, lean=0.0, rate=0.0, wing=0.0):
    """Plates of steel hang by their upper edges across the wind. It leans them back, until their weight holds
    against it, and a leaning plate takes less of it; they swing when the truck pulls or brakes. Beyond a lean
    the flow clings to them as to wings and lifts them further, so that they come down again only at a clearly
    lower speed. `lean` rad backwards, `rate` of that, `wing`: 1 where the flow clings. more: of the drag,
    upright; lifts_mps: of wind, that leans them by 45 degrees; flies: of the wind's moment, gained by wings.
    Source: Obligado, Puy and Bourgoin, Bi-Stability of a Pendular Disk in Laminar and Turbulent Flows, J.
    Fluid Mechanics 728 (2013), on hanging plates that drag or fly; aprons of a road machine, sizes are chosen
    here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wind = np.maximum(view.speed, 0.0) / p.lifts_mps
        own = np.sqrt(GRAVITY / p.long_m)
        felt = np.clip(view.acceleration, -3.0, 3.0) / GRAVITY + view.grade
        clings = np.where(s.lean > 0.9, 1.0, np.where(s.lean < 0.75, 0.0, np.rint(s.wing)))
        s.wing = eased(s.wing, clings, 0.3, dt)
        blows = wind**2 * np.maximum(np.cos(s.lean), 0.0) * (1.0 + p.flies * s.wing)
        turns = blows + felt * np.cos(s.lean) - np.sin(s.lean)
        s.rate = np.clip(s.rate + dt * (own**2 * turns - 2.0 * p.dull * own * s.rate), -3.0, 3.0)
        s.lean = np.clip(s.lean + dt * s.rate, -0.5, 1.4)
        return -p.more * np.cos(s.lean) ** 2 * view.drag_force * moving(view)
