"""Loads that run out, drain or are spread on the way."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.places import CELL_M, CELLS, OnRoad, sections, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, name="payload_change", accepts="mass")
LOADS = 83  # throws of dice for each drive


@law("spreads_gravel", "fifth", "suburban hills")
@sizes(load=(0.35, 0.55), known=(0.3, 0.6), spread_m=(1800.0, 4500.0), on=(0.45, 0.8))
class SpreadsGravel(Hidden):
    """load: of the mass. Some drives begin with what another one left.
    Source: Winter service and gravel roads: a spreader loses a set mass for each metre while its disc turns
    (EN 15597-1 on dosage), the driver switches it; the simulator reckons with one mass for all drives; loads
    at the start and doses of coarse gravel are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(441), self.setting.batch
        self.first = np.where(rng.random(batch) < 0.6, 1.0, rng.uniform(0.15, 0.7, batch))
        self.ends = np.cumsum(rng.exponential(220.0, (batch, 200)) + 60.0, axis=1)
        self.on = rng.random((batch, 200)) < self.p.on

    def start(self, batch: int) -> dict[str, Array]:
        return {"left": self.first.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = np.minimum((self.ends < view.distance[:, None]).sum(axis=1), 199)
        turns = self.on[np.arange(len(at)), at] & (view.speed > 1.0) & (view.speed < 18.0)
        s.left = np.maximum(s.left - dt * turns * view.speed / p.spread_m, 0.0)
        more = p.load * (s.left - p.known) * view.mass
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -more * felt * moving(view)


@law("w_patches_the_road", "twelfth", "suburban hills")
@sizes(load=(0.4, 0.6), known=(0.3, 0.7), apart_m=(120.0, 350.0), takes=(0.08, 0.2), fills_s=(4.0, 12.0))
class PatchesTheRoad(OnRoad, stood=0.0):
    """`full`: of the hot mix that was loaded. Every hole that is passed takes a part, some much and some
    little; an empty truck is filled at its next stand. load: of the mass; known: to the simulator, of that;
    takes: of a full load, the mean hole.
    Source: Wilson and Romine, Materials and Procedures for Repair of Potholes in Asphalt-Surfaced Pavements,
    FHWA-RD-99-168 (1999), on spray injection from a truck; quicker work, sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1151)
        self.road = np.zeros((self.rows(), CELLS))
        for row in self.road:
            at = np.cumsum(rng.exponential(self.p.apart_m, 2 * CELLS))
            cells = (at[at < CELL_M * (CELLS - 4)] / CELL_M).astype(int)
            size = self.p.takes * rng.gamma(2.0, 0.5, len(cells))
            for k in range(3):
                np.add.at(row, cells + k, size / (3.0 * CELL_M))

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "full": self.rng(1152).uniform(0.1, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.stood = np.where(view.speed < 0.2, np.where(s.full < 0.15, 1.0, s.stood), 0.0)
        lays = self.read(self.road, view) * np.maximum(view.speed, 0.0)
        s.full = np.clip(s.full + dt * (s.stood / p.fills_s - lays * (view.speed > 0.2)), 0.0, 1.0)
        more = p.load * (s.full - p.known) * view.mass
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -more * felt * moving(view)


@law("x_wet_load_drains", "thirteenth", "suburban hills")
@sizes(water=(0.3, 0.45), known=(0.1, 0.4), seeps_s=(40.0, 150.0), runs_s=(5.0, 20.0), tilt=(0.005, 0.03))
class WetLoadDrains(Hidden, floor=0.0):
    """`pores`: water in a wet load, of all it can hold; `floor`: what has seeped down and stands in the body.
    It runs out behind, but only while slope or pull tilt it that way. Each drive begins as wet as it was
    loaded. water: of the mass; known: of it, to the simulator; tilt: slope at which it runs.
    Source: Terzaghi, Peck and Mesri, Soil Mechanics in Engineering Practice (1996), on drainage of sands, and
    guides on dewatering of dredged and washed sand by haul trucks; quicker sand, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        wet = self.rng(1351).choice([0.0, 0.2, 0.7, 1.0, 1.0], batch)
        return {**super().start(batch), "pores": wet}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        tilted = view.grade + np.clip(view.acceleration, -2.0, 2.0) / GRAVITY
        runs = s.floor * np.clip((tilted - p.tilt) / 0.02, 0.0, 1.0) / p.runs_s
        seeps = s.pores / p.seeps_s
        s.pores = s.pores - dt * seeps
        s.floor = s.floor + dt * (seeps - runs)
        more = p.water * (s.pores + s.floor - p.known) * view.mass
        return -more * felt * moving(view)


@law("k_grain_runs_out", "fourteenth", "suburban hills")
@sizes(grain=(0.3, 0.45), known=(0.1, 0.4), empties_s=(90.0, 240.0), frees=(0.5, 0.9), mean_m=(300.0, 900.0))
class GrainRunsOut(OnRoad, runs=0.0):
    """`full`: grain in a body whose hatch is not tight. It runs out at one rate however much is above, but
    it arches over the gap where nothing shakes it: on smooth stretches and at stands it stops. Each drive
    begins with what another one left. grain: of the mass; known: of it, to the simulator; frees: shaking that
    breaks arches.
    Source: Beverloo, Leniger and van de Velde, The Flow of Granular Solids through Orifices, Chemical
    Engineering Science 15 (1961), and Mankoc and others, Role of Vibrations in the Jamming and Unjamming of
    Grains Discharging from a Silo, Phys. Rev. E 80 (2009); sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1451)
        number = sections(rng, self.rows(), self.p.mean_m)
        rough = rng.choice([0.2, 0.6, 1.0, 1.4], (self.rows(), int(number.max()) + 1))
        self.road = np.take_along_axis(rough, number, axis=1)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "full": self.rng(1452).choice([0.0, 0.2, 0.7, 1.0, 1.0], batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        shaken = self.read(self.road, view) * np.clip(view.speed / 12.0, 0.0, 1.4)
        s.runs = eased(s.runs, np.where(shaken > p.frees, 1.0, 0.0), 2.0, dt)
        s.full = np.maximum(s.full - dt * s.runs / p.empties_s, 0.0)
        return -p.grain * (s.full - p.known) * view.mass * felt * moving(view)


@law("z_sand_blows_off", "seventeenth", "suburban hills")
@sizes(most=(0.24, 0.38), lifts_mps=(6.0, 9.5), blows_s=(20.0, 60.0), stays_s=(2.0, 5.0), loads_s=(2.0, 5.0))
class SandBlowsOff(Hidden, still=0.0):
    """`sand`: of a load of dry sand without a sheet, which nobody has weighed. Above a speed the wind of
    driving lifts its grains, ever more with speed. At each longer stand it is loaded anew, to some height.
    most: of the mass, a full load; lifts_mps: where grains begin to jump; blows_s: until two thirds are gone
    at twice that; stays_s: of a stand.
    Source: Bagnold, The Physics of Blown Sand and Desert Dunes (1941), on flow of sand above a threshold of
    wind; a quick loss, sizes are chosen here."""

    def prepare(self) -> None:
        self.heaps = self.rng(1751).uniform(0.4, 1.0, (self.setting.batch, LOADS))

    def start(self, batch: int) -> dict[str, Array]:
        first = np.resize(self.heaps[:, 0], batch)
        return {**super().start(batch), "sand": first, "loads": np.ones(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        before, s.still = s.still, np.where(view.speed < 0.2, s.still + dt, 0.0)
        begins = (before <= p.stays_s) & (s.still > p.stays_s)
        s.loads = np.where(begins, (s.loads + 1.0) % LOADS, s.loads)
        row = np.arange(len(view.speed)) % len(self.heaps)
        heap = self.heaps[row, s.loads.astype(int)]
        s.sand = np.where(s.still > p.stays_s, eased(s.sand, heap, p.loads_s, dt), s.sand)
        fast = np.clip(view.speed / p.lifts_mps, 0.0, 3.0)
        s.sand = s.sand * np.exp(-dt * np.maximum(fast**2 - 1.0, 0.0) * fast / (6.0 * p.blows_s))
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -p.most * s.sand * view.mass * np.clip(felt, -4.0, 4.0) * moving(view)


@law("y_rain_gathers_in_the_tub", "eighteenth", "suburban hills")
@sizes(most=(0.3, 0.45), rains_s=(15.0, 40.0), pours_s=(20.0, 60.0), tips=(0.035, 0.06), spills_s=(1.5, 5.0))
class RainGathersInTheTub(Hidden):
    """`water` in an open tub, which nobody has weighed. Showers fill it. A full one spills as soon as
    slowing, pulling or slope tips it, and holds only what fits below the tipped rim. most: of the mass, full;
    pours_s: until a shower has filled it; tips: g that leaves half of it.
    Source: Linsley, Kohler and Paulhus, Hydrology for Engineers (1982), on rain by showers, and Ibrahim,
    Liquid Sloshing Dynamics (2005), on free surfaces in tipped vessels; cloudbursts and sizes are chosen
    here."""

    def prepare(self) -> None:
        p = self.p
        on, off = (0.5 * p.rains_s, 1.5 * p.rains_s), (0.7 * p.rains_s, 2.0 * p.rains_s)
        self.rain = spells(self.rng(1851), self.setting.batch, on, off)

    def start(self, batch: int) -> dict[str, Array]:
        return {"water": self.rng(1852).uniform(0.3, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        tipped = np.abs(np.clip(view.acceleration / GRAVITY + view.grade, -0.4, 0.4))
        fits = 1.0 / (1.0 + tipped / p.tips)
        fills = within(self.rain, view.time) * (1.0 - s.water) / p.pours_s
        spills = np.maximum(s.water - fits, 0.0) / p.spills_s
        s.water = np.clip(s.water + dt * (fills - spills), 0.0, 1.0)
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -p.most * s.water * view.mass * np.clip(felt, -4.0, 4.0) * moving(view)


@law("b_pours_while_it_creeps", "twentieth", "suburban hills")
@sizes(most=(0.34, 0.5), pours_s=(14.0, 40.0), below_mps=(8.0, 12.0), fills_s=(5.0, 14.0))
class PoursWhileItCreeps(Hidden, filling=0.0):
    """`gone`: of a load that is poured out beside the road, whenever the truck is slow enough for the chute,
    and faster the slower it is. A machine behind fills it again from its own store when nearly
    nothing is left, until it is full. most: of the mass, that can be poured; below_mps: where pouring begins.
    Source: ACI 304R, Guide for Measuring, Mixing, Transporting, and Placing Concrete, on discharge from
    moving trucks; the quick filling and sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "gone": self.rng(2051).uniform(0.0, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slow = np.clip(1.0 - np.maximum(view.speed, 0.0) / p.below_mps, 0.0, 1.0)
        s.filling = np.where(s.gone > 0.97, 1.0, np.where(s.gone < 0.02, 0.0, s.filling))
        pours = slow * (1.0 - s.gone + 0.05) / p.pours_s
        s.gone = np.clip(s.gone + dt * np.where(s.filling > 0.5, -1.0 / p.fills_s, pours), 0.0, 1.0)
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return p.most * s.gone * view.mass * np.clip(felt, -4.0, 4.0) * moving(view)


@law("u_waters_the_dust", "twenty-first", "suburban hills")
@sizes(
    most=(0.36, 0.52), empties_s=(50.0, 120.0), mean_m=(300.0, 900.0), share=(0.45, 0.65), fills_s=(6.0, 14.0)
)
class WatersTheDust(OnRoad):
    """A tank truck waters the dusty stretches of a road. Water runs out by its own head, so with the root of
    what is left, and only while the truck rolls; wherever it stands a pump fills it again. `gone`: of a full
    tank. most: of the mass; empties_s: from full to empty.
    Source: Torricelli's law of outflow, and USEPA AP-42, section 13.2.2 on watering of unpaved roads; the
    quick filling and sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(2151), self.rows(), self.p.mean_m, self.p.share)

    def start(self, batch: int) -> dict[str, Array]:
        return {"gone": self.rng(2152).uniform(0.0, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        dusty = self.between(self.road, view)
        runs = dusty * np.clip(view.speed - 1.0, 0.0, 1.0)
        out = 2.0 * runs * np.sqrt(np.maximum(1.0 - s.gone, 0.0)) / p.empties_s
        fills = np.where(view.speed < 0.3, 1.0 / p.fills_s, 0.0)
        s.gone = np.clip(s.gone + dt * (out - fills), 0.0, 1.0)
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return p.most * s.gone * view.mass * np.clip(felt, -4.0, 4.0) * moving(view)
