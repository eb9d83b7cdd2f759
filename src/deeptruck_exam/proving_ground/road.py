"""Seventh forms of tyres and roads: treads that hum, softened rubber, wet tiles, stones in step, maps."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.fleet_trials.road import CELLS, ByPlace, stretches
from deeptruck_exam.hidden import GRAVITY, Array, Hidden, moving, weight
from deeptruck_exam.proving_ground.law import Law, law
from deeptruck_model.trucks import View

ORDERS = np.array([1.0, 2.0, 3.0])[:, None]


@law(
    "ladder_of_the_tread",
    name="rolling_resistance_speed",
    source="Lugged treads on the drum of ISO 28580: blocks and lugs strike at passing frequencies, and the"
    " carcass answers where one of its modes is struck by the first, second or third order (Gent and Walter,"
    " ed., The Pneumatic Tire, NHTSA 2006, on tyre vibration): humps over speed of a torn lug tread, which"
    " build up in seconds and move down as it warms",
    # peak: of the weight; broad: of the speed of each hump
    ranges={"peak": (0.012, 0.022), "first_mps": (20.0, 24.5), "broad": (0.05, 0.10), "builds_s": (1.5, 6.0)},
    needs=("highway",),
    accepts=("drag_area", "rolling_resistance"),
)
class LadderOfTheTread(Law, hum=0.0, way=0.0):
    """Faster is not always more."""

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        speed = np.maximum(view.speed, 0.0)
        s.way += dt * speed
        first = p.first_mps * (1.0 - 0.06 * (1.0 - np.exp(-s.way / 2500.0)))
        at = first / ORDERS
        humps = ((1.0 / ORDERS**0.3) / (1.0 + ((speed - at) / (p.broad * at)) ** 2)).sum(axis=0)
        s.hum += dt * (humps - s.hum) / p.builds_s
        return -p.peak * s.hum * weight(view) * moving(view)


@law(
    "softened_by_work",
    name="rolling_resistance_warmup",
    source="Mullins, Softening of Rubber by Deformation, Rubber Chem. Technol. 42 (1969), and the stretched"
    " exponential of Kohlrausch: filled rubber loses less the more it has been worked, by weight and way and"
    " by pull and braking, and stiffens again at rest; tyres after a cold soak",
    # stiff: of the rolling resistance; works: more, for pull or brake over the weight
    ranges={"stiff": (1.2, 2.4), "way_m": (350.0, 1300.0), "order": (0.45, 0.8), "works": (6.0, 20.0)},
)
class SoftenedByWork(Hidden):
    """Hard driving warms sooner than long driving."""

    def prepare(self) -> None:
        self.first = self.setting.rng(704).uniform(0.0, 0.25, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"work": self.first.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        speed = np.maximum(view.speed, 0.0)
        shear = (np.abs(view.traction_force) + view.brake_force) / weight(view)
        done = speed / p.way_m * (1.0 + p.works * np.minimum(shear, 0.3))
        s.work += dt * np.where(speed < 0.3, -s.work / 120.0, done)
        cold = 1.0 + 0.012 * np.clip(20.0 - self.truck.ambient_temperature, -15.0, 30.0)
        left = p.stiff * cold * np.exp(-(np.maximum(s.work, 0.0) ** p.order))
        return -left * self.truck.rolling_resistance * weight(view) * moving(view)


@law(
    "wheels_spin_on_basalt",
    name="wheel_slip",
    source="Watered basalt tiles of test tracks and friction over slip after Burckhardt, Fahrwerktechnik:"
    " Radschlupf-Regelsysteme (1993), with the wheels' own inertia: they spin up beyond the peak and come"
    " back only when the torque has",
    # peak: friction of the driven wheels; falls: of it, lost when they spin; inertia: of the mass
    ranges={"peak": (0.14, 0.20), "falls": (0.15, 0.3), "at_slip": (0.03, 0.09), "inertia": (0.05, 0.11)},
    needs=("suburban", "hills"),
)
class WheelsSpinOnBasalt(Law, ByPlace, spins=0.0):
    """`spins` m/s of the treads over the truck; what they gain they give back on the next dry metres."""

    def prepare(self) -> None:
        rng = self.setting.rng(705)
        self.wet = np.zeros((self.rows(), CELLS))
        for row in self.wet:
            for first, last in stretches(rng, (60.0, 300.0), (80.0, 450.0)):
                row[first:last] = rng.uniform(0.85, 1.15)

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        wet = self.read(self.wet, view)
        load = self.truck.drive_axle_share * view.mass * GRAVITY
        slip = s.spins / np.maximum(view.speed + s.spins, 2.0)
        rises = 1.0 - np.exp(-3.0 * slip / p.at_slip)
        friction = p.peak * wet * (rises - p.falls * np.clip(slip, 0.0, 1.0))
        grips = np.where(wet > 0.0, friction, 0.5 * rises) * load
        wheel = np.maximum(view.traction_force, 0.0)
        turning = (wheel - grips) / (p.inertia * view.mass)
        s.spins = np.clip(s.spins + dt * np.clip(turning, -20.0, 20.0), 0.0, 8.0)
        loose = (wet > 0.0) | (s.spins > 0.3)
        return np.where(loose, np.clip(grips - wheel, -wheel, 0.08 * weight(view)), 0.0) * moving(view)


@law(
    "stone_blocks_in_step",
    name="road_surface",
    source="Belgian block courses of proving grounds and ISO 8608: roughness whose power falls with the"
    " square of wave number gives dampers the same power at all speeds but where a wheelbase filters it"
    " (Cebon, Handbook of Vehicle-Road Interaction, 1999): axles in step or against each other, by speed",
    ranges={"peak": (0.011, 0.024), "base_m": (3.6, 6.6), "bounce_hz": (1.6, 2.9), "course_m": (140, 420)},
    accepts=("road_grade",),
)
class StoneBlocksInStep(Law, ByPlace, swings=0.0):
    """Each course has stones of its own, and each swings on for a moment."""

    def prepare(self) -> None:
        rng, p = self.setting.rng(706), self.p
        self.stones = np.zeros((self.rows(), CELLS))
        for row in self.stones:
            for first, last in stretches(rng, (80.0, 480.0), (0.6 * p.course_m, 1.6 * p.course_m)):
                row[first:last] = rng.uniform(0.5, 1.2)

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        phase = 2.0 * np.pi * p.bounce_hz * p.base_m / np.maximum(view.speed, 1.5)
        step = 1.0 - 0.5 * 0.75 * (1.0 - np.cos(phase))
        s.swings += dt * (self.read(self.stones, view) * step - s.swings) / 0.4
        return -p.peak * s.swings * weight(view) * moving(view)


@law(
    "chainage_runs_away",
    name="road_grade",
    gateable=False,
    source="Grade from a route's table by the odometer, as fuel consumption tests and simulation tools read"
    " it (Sayers and Karamihas, The Little Book of Profiling, 1998, on longitudinal distance): a wrong start"
    " and a wrong constant put every hill in another place than it has",
    ranges={"start_m": (70.0, 170.0), "runs": (0.005, 0.03), "sign": (-1.0, 1.0)},
    needs=("hills",),
    accepts=("road_surface",),
)
class ChainageRunsAway(Hidden):
    """The table is ahead: what the recording says now has been said by the road before; each drive has its
    own start. `said` (cells, batch): slopes read, every 4 m."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, batch = self.setting.rng(707), self.setting.batch
        share = rng.uniform(0.6, 1.0, batch) * np.where(rng.random(batch) < 0.2, 0.4, 1.0)
        self.late_m = share * self.p.start_m

    def start(self, batch: int) -> dict[str, Array]:
        return {"said": np.full((128, batch), np.nan)}

    def newtons(self, view: View, dt: float) -> Array:
        s, here = self.s, np.arange(len(view.speed))
        s.said = np.where(np.isnan(s.said), view.grade, s.said)
        s.said[(view.distance / 4.0).astype(int) % 128, here] = view.grade
        late = np.clip(self.late_m + self.p.runs * view.distance * np.sign(self.p.sign), 8.0, 480.0)
        then = (np.maximum(view.distance - late, 0.0) / 4.0).astype(int) % 128
        return (view.grade - s.said[then, here]) * view.mass * GRAVITY * moving(view)
