"""Road and tyres: slopes, surfaces, grip, warmth and rubber."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.places import MAP_CELL_M, MAP_CELLS, OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import some_drives
from deeptruck_model.trucks import View


@hidden(
    "n_bridges_stand_proud", "sealed", "hills highway suburban", name="road_grade", accepts="road_surface",
    gateable=False,
)  # fmt: skip
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


@hidden("n_clay_sticks", "sealed", name="road_surface", accepts="road_grade")
@sizes(
    soft=(0.006, 0.014), sticks=(0.008, 0.016), picks_m=(60.0, 200.0), sheds_m=(120.0, 450.0),
    share=(0.25, 0.45), mean_m=(150.0, 500.0),
)  # fmt: skip
class ClaySticks(OnRoad, clod=0.0):
    """Stretches of clay hold the wheels and load them with it; beyond, it is thrown off over the way, sooner
    at speed. soft, sticks: of the weight.
    Source: Bekker, Introduction to Terrain-Vehicle Systems (1969), on adhesive soils, and rules on mud that
    trucks carry from sites onto roads; lengths and sizes are chosen here."""

    def prepare(self) -> None:
        self.clay = windows(self.rng(942), self.rows(), self.p.mean_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        here, speed = self.between(self.clay, view), np.maximum(view.speed, 0.0)
        picks = here * (1.0 - s.clod) / p.picks_m
        sheds = (1.0 - here) * s.clod * np.clip(speed / 10.0, 0.2, 2.0) / p.sheds_m
        s.clod = np.clip(s.clod + dt * speed * (picks - sheds), 0.0, 1.0)
        return -(p.soft * here + p.sticks * s.clod) * weight(view) * moving(view)


@hidden("n_floats_when_light", "sealed", "highway hills", name="wheel_slip")
@sizes(friction=(0.22, 0.34), floats_mps=(21.0, 27.0), share=(0.35, 0.6), mean_m=(250.0, 800.0))
class FloatsWhenLight(OnRoad, lost=0.0):
    """Where water stands, what the tyres press on the road falls with the square of speed.
    Source: Horne, Yager and Ivey, Recent Studies to Investigate Effects of Tire Footprint Aspect Ratio on
    Dynamic Hydroplaning Speed, ASTM STP 929 (1986): lightly loaded truck tyres float at road speeds; friction
    and stretches are chosen here."""

    def prepare(self) -> None:
        self.water = windows(self.rng(943), self.rows(), self.p.mean_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        water = self.between(self.water, view)
        presses = np.clip(1.0 - (np.maximum(view.speed, 0.0) / p.floats_mps) ** 2, 0.2, 1.0)
        grip = p.friction * presses + 0.6 * (1.0 - water)
        pull = np.maximum(view.traction_force, 0.0)
        over = np.maximum(pull - grip * self.truck.drive_axle_share * weight(view), 0.0)
        s.lost = s.lost + dt * (over - s.lost) / 0.2
        braked = np.maximum(view.brake_force - 1.5 * grip * weight(view), 0.0)
        return braked * moving(view) - np.minimum(s.lost, pull)


@hidden("n_brakes_warm_the_rims", "sealed", name="rolling_resistance_warmup")
@sizes(
    soft=(1.6, 3.0), works_s=(200.0, 600.0), brakes_jpkg=(150.0, 500.0), cools_s=(200.0, 600.0),
    knee=(0.25, 0.5),
)  # fmt: skip
class BrakesWarmTheRims(Hidden):
    """Tyres warm by their own work and by what the brakes give their rims. soft: of the known resistance,
    cold.
    Source: Heat of brakes reaches rims and beads (Day, Braking of Road Vehicles, 2014, on thermal effects),
    and rolling loss falls with the tyre's temperature (Wong, Theory of Ground Vehicles); sizes are chosen
    here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(944).uniform(0.0, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        brakes = view.brake_force * speed / (p.brakes_jpkg * view.mass)
        cools = s.warm * (0.4 + 0.6 * np.sqrt(speed / 20.0)) / p.cools_s
        s.warm = np.clip(s.warm + dt * (speed / 20.0 / p.works_s + brakes - cools), 0.0, 5.0)
        lacks = p.soft * np.exp(-s.warm / p.knee)
        return -lacks * self.truck.rolling_resistance * weight(view) * moving(view)


@hidden(
    "n_rubber_by_decades", "sealed", "highway suburban", name="rolling_resistance_speed",
    accepts="drag_area rolling_resistance",
)  # fmt: skip
@sizes(per_decade=(0.008, 0.015), from_mps=(2.0, 8.0), fitted=(0.4, 0.75))
class RubberByDecades(Hidden):
    """per_decade: of the weight; fitted: share of drives with these tyres. Steep at walking pace, ever
    flatter beyond.
    Source: Ferry, Viscoelastic Properties of Polymers (1980): the loss of filled rubber changes with the
    logarithm of frequency; winter treads of much loss, sizes are chosen here."""

    def prepare(self) -> None:
        self.fitted = some_drives(self.rng(945), self.setting.batch, self.p.fitted)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        decades = np.log10(1.0 + np.maximum(view.speed, 0.0) / p.from_mps)
        return -p.per_decade * self.fitted * decades * weight(view) * moving(view)
