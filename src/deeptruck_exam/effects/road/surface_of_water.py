"""Road surfaces with water on them or in them."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import CELL_M, OnRoad, smooth_stretches, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series, spells, within
from deeptruck_model.trucks import View

law = partial(hidden, name="road_surface", accepts="road_grade")


@law("y_water_in_the_sags", "eighteenth", "suburban hills highway")
@sizes(most=(0.007, 0.012), sag=(0.00003, 0.00007), long_m=(60.0, 140.0), rains_s=(15.0, 45.0))
@sizes(runs_off_s=(10.0, 30.0), power=(0.8, 1.5))
class WaterInTheSags(OnRoad, behind=0.0, wet=0.5):
    """Rain gathers where the road has been going down and begins to climb: in its sags, by their curvature.
    On crests and even slopes it runs off. `behind`: slope of the way before, by which a sag is told. `wet`:
    the land, which rains fill and which runs dry. most: of the weight, at 12 m/s; sag: 1/m, of deep water.
    Source: AASHTO, A Policy on Geometric Design of Highways and Streets (2018), on drainage of sag curves,
    and Wong, Theory of Ground Vehicles (2008), on water that wheels push; sizes are chosen here."""

    def prepare(self) -> None:
        p, batch = self.p, self.setting.batch
        on, off = (0.6 * p.rains_s, 1.8 * p.rains_s), (0.3 * p.rains_s, 1.2 * p.rains_s)
        self.rain = spells(self.rng(1862), batch, on, off)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "new": np.ones(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.behind = np.where(s.new > 0.5, view.grade, s.behind)
        s.new = np.zeros_like(s.new)
        bends = (view.grade - s.behind) / p.long_m
        s.behind = eased(s.behind, view.grade, p.long_m / np.maximum(speed, 1e-3), dt)
        s.wet = eased(s.wet, within(self.rain, view.time), p.runs_off_s, dt)
        level = np.exp(-((view.grade / 0.03) ** 2))
        deep = s.wet * np.clip(bends / p.sag + 0.35 * level, 0.0, 1.3)
        return -p.most * deep * np.minimum(speed / 12.0, 1.8) ** p.power * weight(view) * moving(view)


@law("h_waves_wash_over_it", "nineteenth", "suburban hills highway")
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


@law("h_sun_thaws_the_crust", "nineteenth", "suburban hills highway")
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


@law("b_bow_wave_in_the_ford", "twentieth", "suburban hills highway")
@sizes(most=(0.02, 0.034), deep_m=(1.5, 4.5), sharp=(0.18, 0.35), mean_m=(300.0, 900.0), wades=(0.2, 0.4))
@sizes(piles_s=(1.0, 3.0))
class BowWaveInTheFord(OnRoad, wave=0.0):
    """Water stands over stretches of the road. A truck pushes a `wave` ahead of it, which is largest at the
    speed that waves have in water so deep, so that it costs less to be slower or faster. most: of the weight,
    at that speed; deep_m: of water, as far as the wave's speed goes; sharp: width of the peak, of that speed;
    wades: of most, at 20 m/s, by the square of speed.
    Source: Lamb, Hydrodynamics (1932), on waves in shallow water, and Havelock, The Effect of Shallow Water
    on Wave Resistance, Proc. Royal Society A 100 (1922), on the peak at the wave's speed; sizes are chosen
    here."""

    def prepare(self) -> None:
        rng, p = self.rng(2062), self.p
        self.wet = smooth_stretches(
            rng, self.rows(), (0.2 * p.mean_m, p.mean_m), (0.5 * p.mean_m, 2.0 * p.mean_m)
        )
        depth = ou_series(rng, self.wet.shape, CELL_M, 250.0)
        self.depth = p.deep_m * np.exp(0.3 * depth)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        ratio = speed / np.sqrt(9.81 * self.read(self.depth, view))
        peak = np.exp(-0.5 * ((ratio - 1.0) / p.sharp) ** 2)
        s.wave = eased(s.wave, peak, p.piles_s, dt)
        cost = (
            p.most
            * np.sqrt(self.read(self.wet, view))
            * (s.wave + p.wades * np.minimum(speed / 20.0, 1.3) ** 2)
        )
        return -cost * weight(view) * moving(view)


@law("u_slush_lies", "twenty-first", "suburban hills highway")
@sizes(
    most=(0.018, 0.03), floats_mps=(14.0, 19.0), packs=(0.3, 0.5), mean_m=(300.0, 900.0), deeper=(1.0, 1.6)
)
class SlushLies(OnRoad):
    """Slush lies over stretches of the road. Wheels press it together at any speed and throw it ahead by the
    square of speed; from a speed on they float up on it and throw less, so that the drag has a peak. most: of
    the weight, at floats_mps where it is deep; packs: of that, at walking pace; deeper: power of the depth.
    Source: Horne, Joyner and Leland, Studies of the Retardation Force Developed on an Aircraft Tire Rolling
    in Slush or Water, NASA TN D-552 (1960), on the peak and what is left beyond; sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(2162), self.p
        gaps, lengths = (0.2 * p.mean_m, 0.9 * p.mean_m), (0.5 * p.mean_m, 2.0 * p.mean_m)
        lies = smooth_stretches(rng, self.rows(), gaps, lengths)
        depth = np.clip(1.0 + 0.35 * ou_series(rng, lies.shape, CELL_M, 80.0), 0.3, 1.7)
        self.slush = lies**0.5 * depth**p.deeper

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        ratio = np.maximum(view.speed, 0.0) / p.floats_mps
        throws = 2.0 * ratio**2 / (1.0 + ratio**5)
        cost = (p.packs + (1.0 - p.packs) * throws) * self.read(self.slush, view)
        return -p.most * cost * weight(view) * moving(view)
