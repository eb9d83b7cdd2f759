"""Second forms between tyre and road."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import GRAVITY, Array, Hidden, hidden, moving, place, weight
from deeptruck_model.trucks import View


def smooth_stretches(
    rng: np.random.Generator, routes: int, gaps: tuple[float, float], lengths: tuple[float, float]
) -> Array:
    """(routes, cells of 5 m) from 0 to 1: raised cosines in stretches, over 60 km of road."""
    road = np.zeros((routes, 12000))
    for row in road:
        at = rng.uniform(*gaps)
        while at < 59000.0:
            length = rng.uniform(*lengths)
            low, high = int(at / 5.0), int((at + length) / 5.0)
            shape = np.sin(np.pi * (np.arange(high - low) + 0.5) / max(high - low, 1)) ** 2
            row[low:high] = rng.uniform(0.6, 1.0) * shape[: len(row) - low]
            at += length + rng.uniform(*gaps)
    return road


class OnTheRoad(Hidden):
    """`road` (routes, cells of 5 m) met at the truck's place."""

    road: Array

    def met(self, view: View) -> Array:
        cell = (place(self.setting, view) / 5.0).astype(int) % self.road.shape[1]
        return np.asarray(self.road[self.setting.route, cell])

    def routes(self) -> int:
        return int(self.setting.route.max()) + 1


@hidden(
    "standing_wave",
    name="rolling_resistance_speed",
    forms="second",
    source="The Pneumatic Tire, ed. Gent and Walter, NHTSA DOT HS 810 561 (2006): rolling loss turns up"
    " steeply towards the speed of the standing wave, earlier for soft or overloaded tyres; the exponential"
    " and its numbers are chosen here",
    ranges={"loss": (0.006, 0.011), "critical_mps": (21.5, 24.5), "width_mps": (1.5, 3.2)},
    needs=("highway",),
    accepts=("drag_area",),
)
class StandingWave(Hidden):
    def newtons(self, view: View, dt: float) -> Array:
        steep = np.exp(np.minimum((view.speed - self.p.critical_mps) / self.p.width_mps, 1.0))
        return -self.p.loss * steep * weight(view) * moving(view)


@hidden(
    "tyres_heat_themselves",
    name="rolling_resistance_warmup",
    forms="second",
    source="Mars and Luchini, An Analytical Model for the Transient Rolling Resistance Behavior of Tires,"
    " Tire Science and Technology 27 (1999): loss falls exponentially with temperature, which its own heat"
    " raises against the air; flat spots of a night's parking that roll out are chosen here",
    ranges={
        "per_k": (0.025, 0.045),
        "heat_jk": (0.15e6, 0.35e6),  # all tyres, per 20 t of truck
        "flat_n": (300.0, 1100.0),
        "roll_out_m": (300.0, 1000.0),
    },
)
class TyresHeatThemselves(Hidden):
    """Warming takes distance and load, not time; a truck that stands cools."""

    def prepare(self) -> None:
        rng = self.setting.rng(150)
        self.first = rng.uniform(-35.0, -12.0, self.setting.batch)
        self.flat = rng.uniform(0.0, 1.0, self.setting.batch) ** 2

    def start(self, batch: int) -> dict[str, Array]:
        return {"below": self.first.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s, size = self.p, self.s, weight(view) / 2.0e5
        steady = self.truck.rolling_resistance * weight(view)
        loss = steady * np.exp(-p.per_k * s.below)
        speed = np.maximum(view.speed, 0.0)
        gained = (loss - steady) * speed - 60.0 * size * s.below * (1.0 + speed) ** 0.6
        s.below = np.minimum(s.below + dt * gained / (p.heat_jk * size), 0.0)
        flat = p.flat_n * size * self.flat * np.exp(-view.distance / p.roll_out_m)
        return -(loss - steady + flat) * moving(view)


@hidden(
    "standing_water",
    name="road_surface",
    forms="second",
    source="Gengenbach (1968), in Mitschke and Wallentowitz, Dynamik der Kraftfahrzeuge: splash resistance"
    " of a tyre with its width, water depth and the power 1.6 of speed; where the water stands, and how"
    " much of it each day, are chosen here",
    ranges={"film": (0.35, 1.0), "gap_m": (250.0, 600.0), "pool_m": (150.0, 500.0), "driest": (0.4, 0.9)},
    accepts=("road_grade",),
)
class StandingWater(OnTheRoad):
    """film: N for each 1 kN of weight at 15 m/s would be 7.6 times it."""

    def prepare(self) -> None:
        rng, p = self.setting.rng(151), self.p
        self.road = smooth_stretches(
            rng, self.routes(), (0.6 * p.gap_m, 1.6 * p.gap_m), (0.7 * p.pool_m, 1.8 * p.pool_m)
        )
        self.wet = rng.uniform(p.driest, 1.0, self.setting.batch)

    def newtons(self, view: View, dt: float) -> Array:
        splash = 0.01 * (np.clip(view.speed, 0.0, 22.0) / 15.0) ** 1.6  # beyond it the tyres float
        return -self.p.film * self.wet * self.met(view) * splash * weight(view) * moving(view)


@hidden(
    "grade_from_a_coarse_map",
    name="road_grade",
    forms="second",
    gateable=False,
    source="A map's grade is smooth: bridges, dips and ramps of 100-300 m fall between points of a terrain"
    " model of 30-90 m with metres of error (Rodriguez, Morris and Belz, Photogramm. Eng. Remote Sens. 72,"
    " 2006, on SRTM); slopes chosen here",
    ranges={"slope": (0.02, 0.045), "gap_m": (250.0, 700.0)},
    needs=("hills", "highway", "suburban"),
    accepts=("road_surface",),
)
class CoarseMap(OnTheRoad):
    """Humps and dips the recorded grade does not have: up and down again, by the direction of travel."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.setting.rng(152), self.p
        humps = smooth_stretches(rng, self.routes(), (p.gap_m, 2.0 * p.gap_m), (160.0, 420.0))
        slope = np.gradient(humps, axis=1)
        sign = rng.choice([-1.0, 1.0], (self.routes(), 1))
        self.road = p.slope * sign * slope / np.abs(slope).max()

    def newtons(self, view: View, dt: float) -> Array:
        slope = self.setting.direction * self.met(view)
        return -slope * weight(view) * moving(view)


@hidden(
    "traction_control_hunts",
    name="wheel_slip",
    forms="second",
    source="Slip control cuts torque when wheels spin and gives it back by a ramp until they spin again:"
    " Automotive Handbook (Bosch), on traction control; friction of compacted snow and ice 0.1-0.3 (Wong,"
    " Theory of Ground Vehicles); where the ice lies is chosen here",
    ranges={"friction": (0.10, 0.19), "cut": (0.3, 0.6), "back_s": (1.0, 2.5), "gap_m": (150.0, 450.0)},
    needs=("suburban", "hills"),
)
class TractionControl(OnTheRoad):
    """Saw teeth of traction on icy stretches; brakes there are held just below locking."""

    def prepare(self) -> None:
        gap = self.p.gap_m
        road = smooth_stretches(self.setting.rng(153), self.routes(), (0.5 * gap, 1.5 * gap), (120.0, 350.0))
        self.road = (road > 0.15).astype(float)

    def start(self, batch: int) -> dict[str, Array]:
        return {"given": np.ones(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        shift = 0.25 * (np.clip(view.acceleration, -2.0, 2.0) / GRAVITY + view.grade)  # h / wheelbase
        grip = p.friction * self.truck.drive_axle_share * weight(view) * (1.0 + shift)
        icy = self.met(view) > 0.0
        pull = np.maximum(view.traction_force, 0.0)
        spins = icy & (s.given * pull > grip)
        s.given = np.where(spins, s.given * (1.0 - p.cut), np.minimum(s.given + dt / p.back_s, 1.0))
        lost = (1.0 - s.given) * pull
        held = np.maximum(view.brake_force - 0.9 * p.friction * weight(view), 0.0) * icy
        return held * moving(view) - lost
