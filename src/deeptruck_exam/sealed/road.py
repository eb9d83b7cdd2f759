"""Contours that lie far apart, a beach, plates of iron, a mouth that sticks to the road, and a thin crust."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import MAP_CELL_M, OnRoad, smooth_stretches, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series, spells, within
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("h_contours_lie_far_apart", needs="hills highway suburban", name="road_grade", gateable=False)
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


@law("h_waves_wash_over_it", needs="suburban hills highway", name="road_surface", accepts="road_grade")
@sizes(
    sand=(0.01, 0.017), water=(0.008, 0.014), every_s=(11.0, 22.0), firm_s=(4.0, 10.0), mean_m=(400.0, 1200.0)
)
@sizes(share=(0.5, 0.75))
class WavesWashOverIt(OnRoad, firm=0.5, deep=0.0):
    """Over stretches the road is a beach. `deep`: water, as a wave runs up and back; it holds by the square
    of speed. `firm` sand: each wave leaves it firm, and it gets loose again as it dries. Waves come in groups
    of high ones and low ones. sand: of the weight, on loose sand; water: of the weight, at 12 m/s.
    Source: Komar, Beach Processes and Sedimentation (1998), on swash and groups of waves, and Wong, Theory of
    Ground Vehicles (2008), on sand by its water; fast drying and sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1962), self.p
        self.road = windows(rng, self.rows(), p.mean_m, p.share)
        self.groups = p.every_s * rng.uniform(5.0, 8.0, self.setting.batch)
        self.phase = rng.uniform(0.0, 2.0 * np.pi, self.setting.batch)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        high = 0.6 + 0.4 * np.sin(2.0 * np.pi * view.time / self.groups + self.phase)
        runs = np.maximum(np.sin(2.0 * np.pi * view.time / p.every_s + 1.7 * self.phase), 0.0) ** 3
        s.deep = eased(s.deep, 1.3 * high * runs, 0.6, dt)
        s.firm = eased(s.firm, np.where(s.deep > 0.15, 1.0, 0.0), np.where(s.deep > 0.15, 0.8, p.firm_s), dt)
        wade = p.water * s.deep * np.minimum(view.speed / 12.0, 1.6) ** 2
        cost = p.sand * (1.0 - 0.85 * s.firm) + wade
        return -cost * self.between(self.road, view) * weight(view) * moving(view)


@law("h_magnet_over_iron_plates", needs="suburban hills highway", name="unknown")
@sizes(
    eddies=(0.016, 0.028), most_mps=(5.0, 9.0), draws=(0.02, 0.035), gap_m=(90.0, 260.0), long_m=(60.0, 220.0)
)
class MagnetOverIronPlates(OnRoad):
    """A strong magnet hangs low under the truck to gather nails. Some stretches of the road lie on iron. It
    is drawn towards iron, forwards where a stretch begins and back where it ends. Over iron eddy currents
    hold it: most at one speed and less beyond it. eddies, draws: of the weight; most_mps: that speed.
    Source: Reitz, Forces on Moving Magnets due to Eddy Currents, J. Applied Physics 41 (1970), and Hughes
    and Drury, Electric Motors and Drives (2013), on iron drawn to a field; a huge magnet, sizes are chosen
    here."""

    def prepare(self) -> None:
        p = self.p
        gaps, lengths = (0.4 * p.gap_m, 1.6 * p.gap_m), (0.6 * p.long_m, 1.4 * p.long_m)
        self.iron = smooth_stretches(self.rng(1963), self.rows(), gaps, lengths)
        self.edge = 8.0 * np.gradient(self.iron, axis=1)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        ratio = np.maximum(view.speed, 0.0) / p.most_mps
        holds = p.eddies * self.read(self.iron, view) * 2.0 * ratio / (1.0 + ratio**2)
        edge = np.clip(self.setting.direction * self.read(self.edge, view), -1.0, 1.0)
        return (p.draws * edge - holds) * weight(view) * moving(view)


@law("h_mouth_sticks_to_the_road", needs="suburban hills highway", name="unknown")
@sizes(
    most=(0.022, 0.036),
    at_rads=(130.0, 170.0),
    smooth_m=(100.0, 400.0),
    glides_mps=(8.0, 15.0),
    seals_s=(0.4, 1.2),
)
class MouthSticksToTheRoad(OnRoad, sucks=0.0):
    """A sweeper's mouth is let down to the road, and a fan on the engine draws air through it. Where the road
    is smooth its rubber seals, it sucks itself on and drags; where it is rough, air gets in. `sucks`: vacuum
    in the mouth, which a fast engine makes strong. At speed it glides on what air it lets in. most: of the
    weight; glides_mps: where half is left.
    Source: Peel, Michielen and Parker, Some Aspects of Road Sweeping Vehicle Automation, IEEE AIM (2001), on
    suction heads, and Bleier, Fan Handbook (1998), on pressure by turns; sizes are chosen here."""

    def prepare(self) -> None:
        rough = ou_series(self.rng(1964), (self.rows(), 6000), MAP_CELL_M, self.p.smooth_m)
        self.road = 1.0 / (1.0 + np.exp(-2.5 * rough))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = np.clip(view.engine_speed / p.at_rads, 0.0, 1.3)
        s.sucks = eased(s.sucks, turns**2 * self.between(self.road, view), p.seals_s, dt)
        glides = 1.0 / (1.0 + (np.maximum(view.speed, 0.0) / p.glides_mps) ** 2)
        return -p.most * s.sucks * (0.25 + 0.75 * glides) * weight(view) * moving(view)


@law("h_sun_thaws_the_crust", needs="suburban hills highway", name="road_surface", accepts="road_grade")
@sizes(
    most=(0.012, 0.02), mean_m=(200.0, 700.0), share=(0.5, 0.75), thaws_s=(30.0, 90.0), clouds_s=(15.0, 50.0)
)
@sizes(sinks=(0.2, 0.5))
class SunThawsTheCrust(OnRoad):
    """A dirt road has frozen to a hard crust. Where no wood shades it, sun thaws it to mud, deeper with each
    minute, and it freezes again while clouds pass. `thawed`: 1 to the bottom of the crust. Slow wheels sink
    deeper. most: of the weight, thawed; sinks: more, at walking pace; clouds_s: of one cloud, usually.
    Source: Andersland and Ladanyi, Frozen Ground Engineering (2004), on thaw by the root of what the sun has
    given, and Shoop, Vehicle Mobility on Thawing Soils, CRREL (1990); quick thaw, sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1965), self.p
        self.road = windows(rng, self.rows(), p.mean_m, p.share)
        on, off = (1.0 * p.clouds_s, 2.5 * p.clouds_s), (0.5 * p.clouds_s, 1.5 * p.clouds_s)
        self.sun = spells(rng, self.setting.batch, on, off)

    def start(self, batch: int) -> dict[str, Array]:
        return {"heat": self.rng(1966).uniform(0.0, 0.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        shines = within(self.sun, view.time)
        s.heat = np.clip(s.heat + dt * (1.6 * shines * (1.0 - s.heat) - 0.6 * s.heat) / p.thaws_s, 0.0, 1.0)
        slow = 1.0 + p.sinks * np.exp(-np.maximum(view.speed, 0.0) / 5.0)
        cost = p.most * np.sqrt(s.heat) * slow * self.between(self.road, view)
        return -cost * weight(view) * moving(view)
