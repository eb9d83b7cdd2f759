"""Slopes that nobody recorded, or that the record has wrong."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Setting, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import (
    CELL_M,
    CELLS,
    MAP_CELL_M,
    MAP_CELLS,
    OnRoad,
    sections,
    smooth_stretches,
    stretches,
)
from deeptruck_exam.effects.planting import SIGN, Planted, hidden, planted, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, name="road_grade", accepts="road_surface", gateable=False)


@planted("road_grade", "first", "hills highway", name="road_grade")
def road(setting: Setting, p: Sizes) -> Planted:
    """Source: Road profiles as in the route generator (routes.py); the slope is not recorded at all."""
    return Planted(conceal=("grade", "elevation"))


@law("grade_from_a_coarse_map", "second", "hills highway suburban")
@sizes(slope=(0.02, 0.045), gap_m=(250.0, 700.0))
class CoarseMap(OnRoad):
    """Humps and dips the recorded grade does not have: up and down again, by the direction of travel.
    Source: A map's grade is smooth: bridges, dips and ramps of 100-300 m fall between points of a terrain
    model of 30-90 m with metres of error (Rodriguez, Morris and Belz, Photogramm. Eng. Remote Sens. 72, 2006,
    on SRTM); slopes chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(152), self.p
        humps = smooth_stretches(rng, self.rows(), (p.gap_m, 2.0 * p.gap_m), (160.0, 420.0))
        slope = np.gradient(humps, axis=1)
        sign = rng.choice([-1.0, 1.0], (self.rows(), 1))
        self.road = p.slope * sign * slope / np.abs(slope).max()

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slope = self.setting.direction * self.read(self.road, view)
        return -slope * weight(view) * moving(view)


@law("tangents_not_in_the_map", "third", "hills highway suburban")
@sizes(slope=(0.014, 0.028), mean_m=(300.0, 800.0))
class TangentsNotInTheMap(OnRoad):
    """Steps of slope with ramps of 100 m between; the height they gain is kept.
    Source: Vertical alignment of straight grades joined by parabolas, AASHTO, A Policy on Geometric Design of
    Highways and Streets: the recorded grade lacks every second one, as of a map before the road was rebuilt;
    slopes and lengths chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng = self.rng(252)
        number = sections(rng, self.rows(), self.p.mean_m)
        size = rng.uniform(0.6, 1.4, (self.rows(), int(number.max()) + 1))
        slopes = self.p.slope * size * rng.choice([-1.0, 0.0, 1.0], size.shape, p=[0.35, 0.3, 0.35])
        steps = np.take_along_axis(slopes, number, axis=1)
        self.road = np.stack([np.convolve(row, np.ones(20) / 20.0, mode="same") for row in steps])

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        return -self.setting.direction * self.read(self.road, view) * weight(view) * moving(view)


@law("lost_between_map_points", "fourth", "hills highway suburban")
@sizes(slope=(0.011, 0.021), points_m=(250.0, 700.0), smooth_m=(50.0, 110.0))
class LostBetweenMapPoints(OnRoad):
    """The height is right at every point of the map.
    Source: Slopes of a road map are straight between its points (ADASIS v2 and v3 slope profiles), and the
    road is not: heights between two points wander as a Brownian bridge, after the spectrum of long waves of
    ISO 8608 (waviness 2); spacings and sizes of an old map, chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, rows = self.rng(372), self.rows()
        width = max(2, round(self.p.smooth_m / MAP_CELL_M))
        wander = np.cumsum(rng.standard_normal((rows, MAP_CELLS)), axis=1)
        points = round(self.p.points_m / MAP_CELL_M)
        cells = np.arange(MAP_CELLS)
        at = np.arange(0, MAP_CELLS + points, points).clip(max=MAP_CELLS - 1)
        height = np.stack([row - np.interp(cells, at, row[at]) for row in wander])
        kernel = np.ones(width) / width
        smooth = np.stack([np.convolve(row, kernel, mode="same") for row in height])
        slope = np.gradient(smooth, axis=1)
        self.road = self.p.slope * np.clip(slope / slope.std(), -2.5, 2.5)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        return -self.setting.direction * self.between(self.road, view) * view.mass * GRAVITY * moving(view)


@law("grade_held_in_outages", "fifth", "hills highway suburban")
@sizes(slope=(0.016, 0.032), outage_m=(250.0, 650.0), between_m=(120.0, 420.0))
class GradeHeldInOutages(OnRoad):
    """`road` (2, routes, cells): driven forwards and backwards, for the way in is at another end.
    Source: Slope from satellite heights is frozen where reception fails (cuttings, woods, bridges: Groves,
    Principles of GNSS, Inertial and Multisensor Navigation Systems, 2013), while the road goes on to rise or
    fall: the error is nothing at the way in and all at the way out; lengths and sizes chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(413), self.p
        self.road = np.zeros((2, self.rows(), CELLS))
        for k in range(self.rows()):
            gaps = (0.5 * p.between_m, 1.5 * p.between_m)
            for first, last in stretches(rng, gaps, (0.6 * p.outage_m, 1.7 * p.outage_m)):
                m = last - first
                way = np.linspace(0.0, 1.0, m)
                bend = rng.uniform(0.5, 1.0) * rng.choice([-1.0, 1.0]) * 0.5 * (1.0 - np.cos(np.pi * way))
                swing = 0.6 * rng.uniform(-1.0, 1.0) * np.sin(2.0 * np.pi * way)
                walk = p.slope * (bend + swing)
                self.road[0, k, first:last] = walk
                self.road[1, k, first:last] = walk - walk[-1]

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        way = (self.setting.direction < 0).astype(int)
        slope = self.setting.direction * self.road[way, self.setting.route, self.cell(view)]
        return -slope * view.mass * GRAVITY * moving(view)


@law("carriageways_apart", "sixth", "hills highway suburban")
@sizes(height_m=(5.0, 10.0), length_m=(500.0, 1000.0), between_m=(60.0, 350.0))
class CarriagewaysApart(OnRoad):
    """`climbs` (routes, cells): what a truck meets beyond the map's slope, the same either way.
    Source: Independent alignments of divided highways (AASHTO, A Policy on Geometric Design of Highways and
    Streets): in rolling land one carriageway lies metres above the other, while the map has a line between
    them, so that either way climbs where the other falls; heights and lengths are chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(507), self.p
        self.climbs = np.zeros((self.rows(), CELLS))
        gaps = (0.5 * p.between_m, 1.5 * p.between_m)
        for row in self.climbs:
            for first, last in stretches(rng, gaps, (0.7 * p.length_m, 1.4 * p.length_m)):
                m = last - first
                apart = rng.choice([-1.0, 1.0]) * p.height_m * rng.uniform(0.5, 1.0)
                # the height between them is a bell, wider on one side
                bell = np.sin(np.pi * np.linspace(0.0, 1.0, m + 1) ** rng.uniform(0.7, 1.4)) ** 2
                row[first:last] = np.clip(np.diff(apart * bell) / CELL_M, -0.055, 0.055)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        return -self.read(self.climbs, view) * view.mass * GRAVITY * moving(view)


@law("chainage_runs_away", "seventh", "hills")
@sizes(start_m=(70.0, 170.0), runs=(0.005, 0.03), sign=SIGN)
class ChainageRunsAway(Hidden):
    """The table is ahead: what the recording says now has been said by the road before; each drive has its
    own start. `said` (cells, batch): slopes read, every 4 m.
    Source: Grade from a route's table by the odometer, as fuel consumption tests and simulation tools read it
    (Sayers and Karamihas, The Little Book of Profiling, 1998, on longitudinal distance): a wrong start and a
    wrong constant put every hill in another place than it has."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, batch = self.rng(707), self.setting.batch
        share = rng.uniform(0.6, 1.0, batch) * np.where(rng.random(batch) < 0.2, 0.4, 1.0)
        self.late_m = share * self.p.start_m

    def start(self, batch: int) -> dict[str, Array]:
        return {"said": np.full((128, batch), np.nan)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        here = np.arange(len(view.speed))
        s.said = np.where(np.isnan(s.said), view.grade, s.said)
        s.said[(view.distance / 4.0).astype(int) % 128, here] = view.grade
        late = np.clip(self.late_m + p.runs * view.distance * np.sign(p.sign), 8.0, 480.0)
        then = (np.maximum(view.distance - late, 0.0) / 4.0).astype(int) % 128
        return (view.grade - s.said[then, here]) * view.mass * GRAVITY * moving(view)


@law("n_bridges_stand_proud", "ninth", "hills highway suburban")
@sizes(slope=(0.022, 0.04), fades_m=(40.0, 130.0), bridge_m=(20.0, 90.0), apart_m=(220.0, 600.0))
class BridgesStandProud(OnRoad):
    """Embankments have sunk since the survey: up to each bridge and down behind it, the steeper the nearer.
    Source: Briaud, James and Hoffman, Settlement of Bridge Approaches (the Bump at the End of the Bridge),
    NCHRP Synthesis 234 (1997); an exponential fall of height away from the abutment, sizes are chosen
    here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(941), self.p
        at_m = np.arange(MAP_CELLS) * MAP_CELL_M
        self.road = np.zeros((self.rows(), MAP_CELLS))
        for row in self.road:
            middle = 0.0
            while middle < at_m[-1]:
                middle += p.bridge_m + p.apart_m * rng.uniform(0.5, 1.5)
                past = np.maximum(np.abs(at_m - middle) - 0.5 * p.bridge_m, 0.0)
                fall = np.exp(-past / (p.fades_m * rng.uniform(0.7, 1.3))) * (past > 0.0)
                row -= p.slope * rng.uniform(0.6, 1.1) * np.sign(at_m - middle) * fall
        self.road = np.clip(self.road, -p.slope, p.slope)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slope = self.setting.direction * self.between(self.road, view)
        return -slope * weight(view) * moving(view)


@law("e_lane_beside_the_axis", "eleventh", "hills highway suburban")
@sizes(banks=(0.06, 0.09), aside_m=(8.0, 14.0), runoff_m=(40.0, 75.0), straight_m=(30.0, 120.0))
class LaneBesideTheAxis(OnRoad):
    """The map has the axis of the road; the lane lies aside of it, and climbs and falls where the road is
    banked for a bend. Who comes the other way has the other side, and meets the same slope. banks: slope
    across, in the tightest.
    Source: AASHTO, A Policy on Geometric Design of Highways and Streets (2018), on superelevation runoff and
    relative gradients of lanes far from the axis of rotation; widths and bends are chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(1062), self.p
        self.road = np.zeros((self.rows(), MAP_CELLS))
        ramp = np.hanning(round(2.0 * p.runoff_m / MAP_CELL_M) + 3)
        for row in self.road:
            bank, side = np.zeros(CELLS), rng.choice([-1.0, 1.0])
            for first, last in stretches(rng, (p.straight_m, 3.0 * p.straight_m), (90.0, 350.0)):
                side *= rng.choice([-1.0, -1.0, 1.0])
                bank[first:last] = side * p.banks * rng.uniform(0.5, 1.0)
            eased = np.convolve(bank[: 2 * MAP_CELLS : 2], ramp / ramp.sum(), mode="same")
            row[:] = np.clip(np.gradient(p.aside_m * eased, MAP_CELL_M), -0.03, 0.03)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        return -self.between(self.road, view) * weight(view) * moving(view)


@law("w_over_the_junction", "twelfth", "hills highway suburban")
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


@law("q_surveyed_one_way", "fifteenth", "hills descent", accepts="")
@sizes(late_m=(45.0, 90.0), gain=(0.8, 1.2))
class SurveyedOneWay(Hidden, lagging=-9.0):
    """`lagging`: slope as a filter follows it along the way. The map comes from one survey drive whose slopes
    were filtered as they came, so each lies too far along that way. Who drives the same way meets hills
    earlier than the map says, who drives the other way later. late_m: of the filter.
    Source: Oppenheim and Schafer, Discrete-Time Signal Processing (2010), on the delay of causal filters, and
    Sahlholm and Johansson, Road Grade Estimation for Look-ahead Vehicle Control, Control Engineering Practice
    18 (2010), on slopes that are recorded along drives; sizes are chosen here."""

    conceal = ("elevation",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.lagging = np.where(s.lagging < -5.0, view.grade, s.lagging)
        s.lagging = eased(s.lagging, view.grade, p.late_m / np.maximum(view.speed, 0.05), dt)
        slope = self.setting.direction * p.gain * (view.grade - s.lagging)
        return -np.clip(slope, -0.06, 0.06) * weight(view) * moving(view)


@law("v_heights_by_the_barometer", "sixteenth", "hills descent", accepts="")
@sizes(spread=(0.12, 0.22), mean_m=(700.0, 2500.0), drifts=(0.001, 0.003), sign=(-1.0, 1.0))
class HeightsByTheBarometer(OnRoad):
    """The map's heights were read from a barometer, day after day. Cold days had denser air than was thought
    and warm ones thinner, so a day's slopes are all too steep or too flat by one share; and weather that
    changed during the day tilts all of it. spread: of the slope, between days; drifts: of slope, likewise.
    Source: Saastamoinen, Atmospheric Correction for the Troposphere and Stratosphere (1972), on heights by
    pressure and temperature, and Bomford, Geodesy (1980), on barometric heighting; large shares, sizes are
    chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(1661), self.p
        number = sections(rng, self.rows(), p.mean_m)
        shape = (self.rows(), int(number.max()) + 2)
        turns = np.sign(p.sign) * np.where(np.arange(shape[1]) % 2, -1.0, 1.0)
        share = turns * rng.uniform(0.5, 1.0, shape)
        tilt = rng.uniform(-1.0, 1.0, shape)
        ease = np.hanning(11) / np.hanning(11).sum()
        rows = [np.take_along_axis(part, number, axis=1) for part in (share, tilt)]
        self.share, self.tilt = (np.array([np.convolve(r, ease, mode="same") for r in part]) for part in rows)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        tilt = p.drifts * self.setting.direction * self.read(self.tilt, view)
        slope = p.spread * self.read(self.share, view) * view.grade + tilt
        return -slope * weight(view) * moving(view)


@law("h_contours_lie_far_apart", "nineteenth", "hills highway suburban", accepts="")
@sizes(step_m=(5.0, 9.0), flat=(0.008, 0.016), long_m=(70.0, 160.0), most=(0.03, 0.045))
class ContoursLieFarApart(OnRoad):
    """The slopes known come from a map of contours. Each stretch between two of them was taken for even. On
    steep land they lie close together, and little is missed; on flat land whole rises and hollows lie between
    two contours. step_m: of height, between contours; flat: slope at which half is missed; long_m: of rises.
    Source: Imhof, Cartographic Relief Presentation (2007), on contour intervals and what they leave out, and
    Carter, The Effect of Data Precision on Slope, Cartographica 29 (1992); sizes are chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        p = self.p
        rises = ou_series(self.rng(1961), (self.rows(), 6000), MAP_CELL_M, p.long_m)
        ease = np.hanning(9) / np.hanning(9).sum()
        rises = np.array([np.convolve(row, ease, mode="same") for row in rises])
        self.road = np.gradient(rises, MAP_CELL_M, axis=1) * 0.4 * p.step_m

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        misses = 1.0 / (1.0 + (view.grade / p.flat) ** 2)
        slope = p.most * np.tanh(self.setting.direction * self.between(self.road, view) * misses / p.most)
        return -slope * weight(view) * moving(view)
