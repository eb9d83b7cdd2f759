"""Road and tyres: slopes, surfaces, grip, warmth and bearings."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.places import MAP_CELL_M, MAP_CELLS, OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View


@hidden(
    "s_subsidence", "sealed", "hills highway suburban", name="road_grade", accepts="road_surface",
    gateable=False,
)  # fmt: skip
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


@hidden("s_pavement_bends", "sealed", name="road_surface", accepts="road_grade")
@sizes(loss=(0.010, 0.022), slow_mps=(5.0, 14.0), share=(0.3, 0.6), mean_m=(300.0, 900.0))
class PavementBends(OnRoad):
    """loss: of the weight, at walking pace. Slow trucks sink deeper.
    Source: Louhghalam, Akbarian and Ulm, Flügge's Conjecture: Dissipation- versus Deflection-Induced
    Pavement-Vehicle Interactions, J. Eng. Mech. 140 (2014): loss falls with speed; soft asphalt, sizes are
    chosen here."""

    def prepare(self) -> None:
        self.soft = windows(self.rng(832), self.rows(), self.p.mean_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slow = 1.0 / (1.0 + np.maximum(view.speed, 0.0) / p.slow_mps)
        return -2.0 * p.loss * slow * self.between(self.soft, view) * weight(view) * moving(view)


@hidden("s_first_rain", "sealed", "suburban hills", name="wheel_slip")
@sizes(friction=(0.09, 0.17), wet_s=(15.0, 50.0), dry_s=(20.0, 60.0), washes_s=(40.0, 150.0))
class FirstRain(Hidden, film=0.0, wash=0.0, lost=0.0):
    """The first minute of rain is the slipperiest, brakes suffer as the drive does.
    Source: Eisenberg, The Mixed Effects of Precipitation on Traffic Crashes, Accident Analysis and Prevention
    36 (2004): oil that gathered in dry days floats up and is washed off; friction is chosen here."""

    def prepare(self) -> None:
        p = self.p
        rain = (p.wet_s, 2.0 * p.wet_s)
        self.rain = spells(self.rng(833), self.setting.batch, rain, (0.5 * p.dry_s, p.dry_s))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        rains = within(self.rain, view.time)
        s.film = s.film + dt * (rains - s.film) / np.where(rains > s.film, 3.0, 15.0)
        s.wash = np.clip(s.wash + dt * (rains / p.washes_s - (1.0 - rains) / 200.0), 0.0, 1.0)
        grip = p.friction + 0.25 * s.wash + 0.5 * (1.0 - np.clip(1.6 * s.film, 0.0, 1.0))
        most = grip * self.truck.drive_axle_share * weight(view)
        pull = np.maximum(view.traction_force, 0.0)
        s.lost = s.lost + dt * (np.maximum(pull - most, 0.0) - s.lost) / 0.15
        braked = np.maximum(view.brake_force - 1.3 * grip * weight(view), 0.0)
        return braked * moving(view) - np.minimum(s.lost, pull)


@hidden("s_gas_in_the_tyre_warms", "sealed", name="rolling_resistance_warmup")
@sizes(soft=(1.0, 2.2), order=(0.6, 1.2), warms_s=(120.0, 360.0), warms=(0.6, 1.2))
class GasInTheTyreWarms(Hidden):
    """soft: of the known resistance, with cold gas; warms: of what closes it, at 20 m/s.
    Source: Tyres whose gas warms carry on higher pressure (Wong, Theory of Ground Vehicles, on inflation and
    rolling resistance): slow driving cools them again; underinflated ones, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"gas": self.rng(834).uniform(0.0, 0.25, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0) / 20.0
        works = p.warms * speed * (1.3 - np.clip(s.gas, 0.0, 1.0))
        s.gas = s.gas + dt * (works - s.gas * (0.3 + 0.4 * np.sqrt(speed))) / p.warms_s * 2.0
        lacks = np.clip(1.0 - s.gas, 0.0, 1.0) ** p.order
        return -p.soft * lacks * self.truck.rolling_resistance * weight(view) * moving(view)


@hidden(
    "s_dampers_take_power", "sealed", "highway hills", name="rolling_resistance_speed",
    accepts="drag_area rolling_resistance",
)  # fmt: skip
@sizes(at_25=(0.007, 0.014), waviness=(2.4, 3.4), hot=(0.1, 0.4), warms_s=(60.0, 200.0))
class DampersTakePower(Hidden, hot=0.0):
    """at_25: of the weight, at 25 m/s. Oil in warm dampers takes less.
    Source: Velinsky and White, Vehicle Energy Dissipation Due to Road Roughness, Vehicle System Dynamics 9
    (1980), with spectra of ISO 8608: power with a power of speed; rough roads, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pace = np.clip(view.speed / 25.0, 0.0, 1.3) ** (p.waviness - 0.6)
        s.hot = s.hot + dt * (pace - s.hot) / p.warms_s
        return -p.at_25 * pace * (1.0 - p.hot * np.minimum(s.hot, 1.0)) * weight(view) * moving(view)


@hidden("s_bearing_runs_hot", "sealed", "highway hills suburban", name="unknown")
@sizes(drag=(0.004, 0.008), grows=(1.0, 2.5), heats_m=(800.0, 2500.0), cools_s=(40.0, 120.0))
class BearingRunsHot(Hidden):
    """drag: of the weight, cold. Way heats it by its own drag; standing and slow ways cool it.
    Source: Takabi and Khonsari, Experimental Testing and Thermal Analysis of Ball Bearings, Tribology
    International 60 (2013): heat takes up clearance, and preload makes heat; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"heat": self.rng(835).uniform(0.0, 0.4, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        tight = 1.0 + p.grows * s.heat**2
        gains = np.maximum(view.speed, 0.0) * tight / p.heats_m
        s.heat = np.clip(s.heat + dt * (gains - s.heat / p.cools_s * 1.5), 0.0, 1.3)
        drag = np.minimum(p.drag * tight, 0.2) * view.mass * GRAVITY
        return -drag * moving(view)
