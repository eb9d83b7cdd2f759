"""Tyres: resistance with speed, warm-up, slip."""

from __future__ import annotations

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_exam.laws.catalogue import law, sizes
from deeptruck_exam.laws.law import GRAVITY, Law, Sizes, State, index, moving, weight
from deeptruck_exam.laws.series import OnRoad, ou_series, smooth_spans
from deeptruck_model.trucks import View


@law("rolling_resistance_speed", "highway hills", accepts="drag_area")
@sizes(at_100mph=(0.012, 0.030), power=(2.3, 2.6))
class StuttgartFormula(Law):
    """Rolling resistance grows with the power 2.5 of speed.
    Source: Gillespie, Fundamentals of Vehicle Dynamics (1992), Stuttgart formula."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        growth = p.at_100mph * np.maximum(view.speed / 44.7, 0.0) ** p.power  # 44.7 m/s: 100 mph
        return -growth * weight(view)


@law("rolling_resistance_speed", "highway", accepts="drag_area")
@sizes(loss=(0.006, 0.011), critical_mps=(21.5, 24.5), width_mps=(1.5, 3.2))
class StandingWave(Law):
    """Rolling loss turns up steeply towards the speed of the standing wave.
    Source: The Pneumatic Tire, ed. Gent and Walter, NHTSA DOT HS 810 561 (2006)."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        steep = np.exp(np.minimum((view.speed - p.critical_mps) / p.width_mps, 1.0))
        return -p.loss * steep * weight(view) * moving(view)


@law("rolling_resistance_warmup")
@sizes(cold_gain=(0.9, 2.2), tread_s=(40.0, 90.0), carcass_s=(150.0, 420.0), split=(0.3, 0.6))
class ColdTyres(Law):
    """The loss decreases as tread and carcass warm up; every drive starts at another temperature.
    Source: Nielsen and Sandberg, A New Model for Rolling Resistance of Pneumatic Tires, SAE 2002-01-1200."""

    def prepare(self) -> None:
        self.cold = self.rng(3).uniform(0.35, 1.0, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"tread": self.cold.copy(), "carcass": self.cold.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        working = 0.15 + np.clip(view.speed / 20.0, 0.0, 1.3)
        s.tread += dt * (0.6 * s.carcass - s.tread) * working / p.tread_s
        s.carcass -= dt * s.carcass * working / p.carcass_s
        share = p.split * np.maximum(s.tread, 0.0) + (1.0 - p.split) * s.carcass
        return -p.cold_gain * share * self.truck.rolling_resistance * weight(view) * moving(view)


@law("rolling_resistance_warmup")
@sizes(per_k=(0.025, 0.045), heat_jk=(0.15e6, 0.35e6), flat_n=(300.0, 1100.0), roll_out_m=(300.0, 1000.0))
class SelfHeatingTyres(Law):
    """The loss decreases exponentially with tyre temperature, which is raised by the loss and lowered by the
    air; flat spots from parking overnight disappear. heat_jk: all tyres, per 20 t of truck.
    Source: Mars and Luchini, An Analytical Model for the Transient Rolling Resistance Behavior of Tires, Tire
    Science and Technology 27 (1999)."""

    def prepare(self) -> None:
        rng = self.rng(150)
        self.first = rng.uniform(-35.0, -12.0, self.setting.batch)
        self.flat = rng.uniform(0.0, 1.0, self.setting.batch) ** 2

    def start(self, batch: int) -> dict[str, Array]:
        return {"below": self.first.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        size = weight(view) / 2.0e5  # N, 20 t
        steady = self.truck.rolling_resistance * weight(view)
        loss = steady * np.exp(-p.per_k * s.below)
        speed = np.maximum(view.speed, 0.0)
        # the air takes 60 W/K at rest, more with the power 0.6 of speed, as from a turbulent boundary layer
        gained = (loss - steady) * speed - 60.0 * size * s.below * (1.0 + speed) ** 0.6
        s.below = np.minimum(s.below + dt * gained / (p.heat_jk * size), 0.0)
        flat = p.flat_n * size * self.flat * np.exp(-view.distance / p.roll_out_m)
        return -(loss - steady + flat) * moving(view)


@law("wheel_slip", "suburban hills")
@sizes(c1=(0.12, 0.22), c3=(0.02, 0.06), share_of_time=(0.1, 0.35))
class SlipperyRoad(Law, slip=0.0):
    """A driven wheel that spins on snow or wet ice and regains grip.
    Source: Burckhardt, Fahrwerktechnik: Radschlupf-Regelsysteme (1993): friction c1 (1 - exp(-c2 s)) - c3 s.
    """

    def prepare(self) -> None:
        rng = self.rng(5)
        noise = ou_series(rng, (self.setting.batch, int(self.setting.duration_s) + 2), 1.0, 25.0)
        self.slippery = noise < np.quantile(noise, self.p.share_of_time)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        here = self.slippery[:, index(view, self.slippery)]
        load = self.truck.drive_axle_share * weight(view)
        friction = p.c1 * (1.0 - np.exp(-40.0 * np.maximum(s.slip, 0.02))) - p.c3 * s.slip
        grip = np.maximum(friction, 0.03) * load
        pull = np.maximum(view.traction_force, 0.0)
        s.slip = np.clip(s.slip + dt * (pull - grip) / (0.04 * weight(view)), 0.0, 1.0)
        lost = np.maximum(pull - grip, 0.0)
        brake_lost = np.maximum(
            view.brake_force - 1.15 * p.c1 * weight(view), 0.0
        )  # anti-lock keeps near the peak
        return np.where(here, brake_lost * moving(view) - lost, 0.0)


@law("wheel_slip", "suburban hills")
@sizes(friction=(0.10, 0.19), cut=(0.3, 0.6), back_s=(1.0, 2.5), gap_m=(150.0, 450.0))
class TractionControl(OnRoad, given=1.0):
    """Slip control cuts torque when wheels spin on ice, and restores it by a ramp until they spin again; on
    ice, brakes are held just below locking.
    Source: Automotive Handbook (Bosch), on traction control; friction of snow and ice, Wong, Theory of Ground
    Vehicles."""

    def prepare(self) -> None:
        gap = self.p.gap_m
        road = smooth_spans(self.rng(153), self.rows(), (0.5 * gap, 1.5 * gap), (120.0, 350.0))
        self.road = (road > 0.15).astype(float)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        shift = 0.25 * (np.clip(view.acceleration, -2.0, 2.0) / GRAVITY + view.grade)  # h / wheelbase
        grip = p.friction * self.truck.drive_axle_share * weight(view) * (1.0 + shift)
        icy = self.here(view) > 0.0
        pull = np.maximum(view.traction_force, 0.0)
        spins = icy & (s.given * pull > grip)
        s.given = np.where(spins, s.given * (1.0 - p.cut), np.minimum(s.given + dt / p.back_s, 1.0))
        lost = (1.0 - s.given) * pull
        held = np.maximum(view.brake_force - 0.9 * p.friction * weight(view), 0.0) * icy
        return held * moving(view) - lost
