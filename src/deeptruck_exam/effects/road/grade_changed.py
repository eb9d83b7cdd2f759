"""Roads whose slopes have changed since they were recorded, or change under the truck."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Sizes, State, moving, weight
from deeptruck_exam.effects.places import (
    CELL_M,
    CELLS,
    MAP_CELL_M,
    MAP_CELLS,
    OnRoad,
    sections,
    smooth_stretches,
    stretches,
    windows,
)
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, name="road_grade", accepts="road_surface", gateable=False)


@law("s_subsidence", "eighth", "hills highway suburban")
@sizes(slope=(0.018, 0.035), radius_m=(90.0, 260.0), apart_m=(400.0, 900.0))
class Subsidence(OnRoad):
    """Troughs that were not there when the road was surveyed.
    Source: Knothe's influence function of mining subsidence (Kratzsch, Mining Subsidence Engineering, 1983):
    the surface sinks as an integral of Gauss's bell; sizes are chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(831), self.p
        at_m = np.arange(MAP_CELLS) * MAP_CELL_M
        self.road = np.zeros((self.rows(), MAP_CELLS))
        for row in self.road:
            middle = 0.0
            while middle < at_m[-1]:
                middle += p.apart_m * rng.uniform(0.5, 1.5)
                away = (at_m - middle) / (p.radius_m * rng.uniform(0.7, 1.3))
                row += p.slope * rng.uniform(0.6, 1.0) * 1.65 * away * np.exp(-0.5 * away**2)
        self.road = np.clip(self.road, -p.slope, p.slope)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slope = self.setting.direction * self.between(self.road, view)
        return -slope * weight(view) * moving(view)


@law("t_road_on_thawing_ground", "tenth", "hills highway suburban")
@sizes(slope=(0.014, 0.026), shortest_m=(70.0, 140.0), longest=(2.0, 4.0), apart_m=(80.0, 400.0))
class RoadOnThawingGround(OnRoad):
    """Waves of many lengths where ice has melted out of the ground since the survey. slope: standard
    deviation in the middle of a stretch; longest: over the shortest.
    Source: Andersland and Ladanyi, Frozen Ground Engineering (2004), on thaw settlement under roads, uneven
    as the ice in the ground is; lengths and slopes are chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p, rows = self.rng(989), self.p, self.rows()
        at_m = np.arange(MAP_CELLS) * MAP_CELL_M
        waves_m = p.shortest_m * p.longest ** rng.random((rows, 12, 1))
        phase = rng.uniform(0.0, 2.0 * np.pi, waves_m.shape)
        waves = np.sin(2.0 * np.pi * at_m / waves_m + phase).sum(axis=1) / np.sqrt(6.0)
        thaws = smooth_stretches(rng, rows, (0.5 * p.apart_m, 1.5 * p.apart_m), (400.0, 1600.0))
        self.road = np.clip(p.slope * waves * np.sqrt(thaws[:, ::2]), -0.055, 0.055)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slope = self.setting.direction * self.between(self.road, view)
        return -slope * weight(view) * moving(view)


@law("x_slopes_were_taken_down", "thirteenth", "hills descent")
@sizes(share=(0.3, 0.55), mean_m=(500.0, 1400.0), built=(0.4, 0.6), eases_m=(30.0, 90.0), tips=(0.002, 0.006))
class SlopesWereTakenDown(OnRoad):
    """Stretches were rebuilt since the map was made: cuttings and embankments took a share of each slope, and
    what was dug is spread at their ends, where the road is a little steeper than mapped. share: of the slope;
    built: of the road; tips: slope of the ends.
    Source: AASHTO, A Policy on Geometric Design of Highways and Streets (2018), chapter 3, on reducing
    grades, and Hickerson, Route Location and Design (1964), on balance of cut and fill; stretches are chosen
    here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(1362), self.p
        wide = max(3, round(p.eases_m / MAP_CELL_M))
        ease = np.hanning(wide + 2) / np.hanning(wide + 2).sum()
        rough = np.zeros((self.rows(), MAP_CELLS))
        for row in rough:
            at = 0
            while at < MAP_CELLS:
                cells = max(4, round(p.mean_m * rng.uniform(0.5, 1.5) / MAP_CELL_M))
                row[at : at + cells] = (rng.random() < p.built) * rng.uniform(0.7, 1.2)
                at += cells
        self.road = np.array([np.convolve(row, ease, mode="same") for row in rough])
        self.ends = (
            p.tips * np.gradient(self.road, axis=1) / max(float(np.abs(np.diff(self.road)).max()), 1e-6)
        )

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        taken = np.clip(p.share * self.between(self.road, view), 0.0, 0.7) * view.grade
        tips = self.setting.direction * self.between(self.ends, view)
        return np.asarray((taken - tips) * weight(view) * moving(view))


@law("k_ramps_follow_the_tide", "fourteenth", "hills highway suburban")
@sizes(rises_m=(2.0, 4.0), ramp_m=(80.0, 160.0), long_m=(150.0, 500.0), apart_m=(600.0, 1600.0))
class RampsFollowTheTide(OnRoad):
    """Floating bridges, which the map has as they lie at half tide: at high water a ramp leads up to each and
    another one down behind it, at low water it is the other way round. Each drive has its own hour. rises_m:
    of the highest water over the middle one; ramp_m: of each ramp.
    Source: Watanabe and Utsunomiya, Analysis and Design of Floating Bridges, Progress in Structural
    Engineering and Materials 5 (2003), on transition spans over tides; bridges and sizes are chosen
    here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(1462), self.p
        height = np.zeros((self.rows(), MAP_CELLS))
        metres = np.arange(MAP_CELLS) * MAP_CELL_M
        for row in height:
            at = rng.uniform(0.0, p.apart_m)
            while at < metres[-1]:
                ramp, long = p.ramp_m * rng.uniform(0.8, 1.2), p.long_m * rng.uniform(0.6, 1.4)
                up = np.clip((metres - at) / ramp, 0.0, 1.0)
                down = np.clip((metres - at - ramp - long) / ramp, 0.0, 1.0)
                row += up - down
                at += 2.0 * ramp + long + p.apart_m * rng.uniform(0.5, 1.5)
        ease = np.hanning(7) / np.hanning(7).sum()
        self.road = np.array([np.convolve(np.gradient(row, MAP_CELL_M), ease, mode="same") for row in height])

    def start(self, batch: int) -> dict[str, Array]:
        hour = 2.0 * np.pi * self.rng(1463).random(batch)
        return {"tide": np.sign(np.sin(hour)) * np.sqrt(np.abs(np.sin(hour)))}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slope = self.setting.direction * p.rises_m * s.tide * self.between(self.road, view)
        return -slope * weight(view) * moving(view)


@law("z_slopes_in_whole_steps", "seventeenth", "hills descent", accepts="")
@sizes(step=(0.009, 0.016), drops=(0.55, 0.95), mean_m=(900.0, 3000.0), rounds=(0.1, 0.3))
class SlopesInWholeSteps(OnRoad):
    """The register of the road holds its slopes in whole steps, and whatever is over a step was left out. So
    a slope is always steeper than its entry, by something between nothing and a step; some sections were
    entered more carefully. drops: of what is over a step; rounds: of a step, where the entry changes softly.
    Source: FHWA, Highway Performance Monitoring System, Field Manual, on grades that are held in
    classes, and Widrow and Kollar, Quantization Noise (2008); truncation and sizes are chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(1761), self.p
        number = sections(rng, self.rows(), p.mean_m)
        share = rng.choice([0.35, 1.0, 1.0], (self.rows(), int(number.max()) + 1)) * p.drops
        ease = np.hanning(13) / np.hanning(13).sum()
        self.share = np.array([np.convolve(r, ease, "same") for r in np.take_along_axis(share, number, 1)])

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        steps = np.abs(view.grade) / p.step
        over = steps - np.floor(steps)
        left = np.minimum(over, (1.0 - over) / p.rounds * (1.0 - p.rounds))  # falls softly to the next step
        slope = np.sign(view.grade) * p.step * left * self.read(self.share, view)
        return -slope * weight(view) * moving(view)


@law("y_map_saw_the_tree_tops", "eighteenth", "hills descent", accepts="")
@sizes(
    high_m=(3.5, 6.5), uneven=(0.15, 0.3), mean_m=(300.0, 900.0), share=(0.35, 0.6), pixel_m=(180.0, 320.0)
)
class MapSawTheTreeTops(OnRoad):
    """The slopes known are those of a radar's map from space, which took the tops of woods for ground. At the
    edge of a wood the map climbs, where the road does not; inside, it follows unequal trees. high_m: of a
    wood, as the radar saw it; uneven: of that; mean_m: of a wood; pixel_m: over which the map is a mean.
    Source: Farr and others, The Shuttle Radar Topography Mission, Reviews of Geophysics 45 (2007), on heights
    of canopies in the map; sizes are chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(1861), self.p
        woods = windows(rng, self.rows(), p.mean_m, p.share)
        trees = 1.0 + p.uneven * ou_series(rng, woods.shape, MAP_CELL_M, 120.0)
        cells = 2 * round(p.pixel_m / MAP_CELL_M) + 1
        ease = np.hanning(cells) / np.hanning(cells).sum()
        tops = np.array([np.convolve(row, ease, mode="same") for row in p.high_m * woods * trees])
        self.road = np.gradient(tops, MAP_CELL_M, axis=1)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        climbs = np.clip(self.setting.direction * self.between(self.road, view), -0.05, 0.05)
        return climbs * weight(view) * moving(view)  # the map has it, the road has not


@law("b_light_bridges_sag", "twentieth", "hills highway suburban", accepts="")
@sizes(sags=(0.011, 0.018), long_m=(90.0, 150.0), gap_m=(60.0, 140.0), heavier=(0.5, 1.0))
class LightBridgesSag(OnRoad):
    """The road goes over light bridges, one after the other, that sag under who drives over them: each begins
    with a slope down and ends with one up, the steeper the heavier the truck. At the ends and in the middle
    there is none. sags: of a bridge's length, for 20 t in its middle; heavier: power of the mass.
    Source: Timoshenko and Young, Vibration Problems in Engineering (1955), on the path of a load that moves
    over a beam; very light bridges, sizes are chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(2061), self.p
        self.road = np.zeros((self.rows(), CELLS))
        gaps, lengths = (p.gap_m, 4.0 * p.gap_m), (0.6 * p.long_m, 1.5 * p.long_m)
        for row in self.road:
            for first, last in stretches(rng, gaps, lengths):
                along = (np.arange(last - first) + 0.5) / max(last - first, 1)
                row[first:last] = -32.0 * along * (1.0 - along) * (1.0 - 2.0 * along)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = self.place(view) / CELL_M
        low, share, route = at.astype(int) % (CELLS - 1), at - np.floor(at), self.setting.route
        bent = (1.0 - share) * self.road[route, low] + share * self.road[route, low + 1]
        heavy = np.minimum((view.mass / 20000.0) ** p.heavier, 2.0)
        slope = np.clip(self.setting.direction * p.sags * heavy * bent, -0.07, 0.07)
        return -slope * weight(view) * moving(view)


@law("u_hillside_slips_in_blocks", "twenty-first", "hills highway suburban", accepts="")
@sizes(tilts=(0.013, 0.022), long_m=(90.0, 200.0), gap_m=(30.0, 90.0), steep=(0.14, 0.25))
class HillsideSlipsInBlocks(OnRoad):
    """Since the survey the hillside has slipped in blocks. Each has turned back as it went down: the road on
    it leans one way over most of its length, and comes back to its old height by a short steep scarp. tilts:
    of a block; long_m: of one; steep: of its length, that the scarp takes.
    Source: Varnes, Slope Movement Types and Processes, TRB Special Report 176 (1978), on slips whose blocks
    turn back; slow ones that the road has followed, sizes are chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(2161), self.p
        self.road = np.zeros((self.rows(), CELLS))
        for row in self.road:
            gaps, lengths = (p.gap_m, 4.0 * p.gap_m), (0.6 * p.long_m, 1.6 * p.long_m)
            for first, last in stretches(rng, gaps, lengths):
                along = (np.arange(last - first) + 0.5) / max(last - first, 1)
                down = rng.uniform(0.6, 1.2) * rng.choice([-1.0, 1.0])
                scarp = along > 1.0 - p.steep
                row[first:last] = down * np.where(scarp, -(1.0 - p.steep) / p.steep, 1.0)
        ease = np.hanning(9) / np.hanning(9).sum()
        self.road = np.stack([np.convolve(row, ease, mode="same") for row in self.road])

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = self.place(view) / CELL_M
        low, share, route = at.astype(int) % (CELLS - 1), at - np.floor(at), self.setting.route
        leans = (1.0 - share) * self.road[route, low] + share * self.road[route, low + 1]
        slope = np.clip(self.setting.direction * p.tilts * leans, -0.07, 0.07)
        return -slope * weight(view) * moving(view)
