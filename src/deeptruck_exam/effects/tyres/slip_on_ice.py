"""Wheels that slip on ice and snow."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import CELLS, OnRoad, stretches, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="wheel_slip")


@law("one_wheel_on_ice", "fourth", "suburban hills")
@sizes(ice=(0.05, 0.10), brakes=(0.3, 0.7), finds_s=(1.0, 3.0), share_of_road=(0.25, 0.5))
class OneWheelOnIce(OnRoad, helps=0.0):
    """brakes: of the difference to dry grip, reached after finds_s.
    Source: Split friction and an open differential: both wheels carry what the worse one can, plus what the
    slip control brakes on the spinning wheel (Automotive Handbook, Bosch, on traction control of heavy
    vehicles); antilock systems that choose the lower side; where the ice lies and sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(371)
        self.road = windows(rng, self.rows(), 160.0, self.p.share_of_road)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        icy = self.between(self.road, view) > 0.0
        axle = self.truck.drive_axle_share * weight(view) * (1.0 + 0.3 * view.grade)
        pull = np.maximum(view.traction_force, 0.0)
        low = (p.ice + 0.25 * p.brakes * s.helps) * axle
        spins = icy & (pull > low)
        s.helps = np.clip(s.helps + dt * np.where(spins, 1.0, -0.5) / p.finds_s, 0.0, 1.0)
        lost = np.maximum(pull - low, 0.0) * icy
        held = np.maximum(view.brake_force - (0.5 * p.ice + 0.07) * weight(view), 0.0) * icy
        return held * moving(view) - lost


@law("polishes_its_own_ice", "fifth", "suburban hills")
@sizes(fresh=(0.16, 0.26), polished=(0.07, 0.12), melts_s=(0.5, 2.0), renews_m=(12.0, 50.0))
class PolishesItsOwnIce(OnRoad, polish=0.0):
    """The brush loses pull from two thirds of the grip on.
    Source: Spinning wheels melt and polish packed snow (Shoop and others, CRREL reports on traction; Ella,
    Formagne, Koutsos and Blackford, Tribology Int. 59, 2013, on ice): grip falls while they slide, comes back
    over metres of fresh snow; brush model near the limit (Pacejka, Tire and Vehicle Dynamics, 2012) ; places
    and sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(423)
        self.snow = np.zeros((self.rows(), CELLS))
        for row in self.snow:
            for first, last in stretches(rng, (100.0, 450.0), (120.0, 600.0)):
                row[first:last] = 1.0

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        snowy = self.read(self.snow, view)
        grip = (p.fresh + (p.polished - p.fresh) * s.polish) * weight(view)
        driven, all_wheels = self.truck.drive_axle_share * grip, 0.95 * grip
        pull = np.maximum(view.traction_force, 0.0)
        asks = pull / np.maximum(driven, 1.0)
        given = np.where(asks < 0.67, asks, 0.67 + 0.33 * np.tanh((asks - 0.67) / 0.33))
        lost = np.maximum(asks - given, 0.0) * driven * snowy
        held = np.maximum(view.brake_force - all_wheels, 0.0) * snowy
        slides = (lost + held > 0.03 * driven).astype(float)
        renews = np.maximum(view.speed, 0.0) / p.renews_m
        s.polish += dt * (slides * (1.0 - s.polish) / p.melts_s - (1.0 - slides) * s.polish * renews)
        s.polish = np.clip(s.polish, 0.0, 1.0)
        return held * moving(view) - lost


@law("t_ice_melts_under_it", "tenth", "suburban hills")
@sizes(grip=(0.13, 0.19), falls=(0.35, 0.65), rears=(0.25, 0.6), inertia=(0.05, 0.12))
class IceMeltsUnderIt(OnRoad, slides=0.0, lost=0.0):
    """`slides` m/s of the driven treads over the road, in the shade. Once they slide they melt the ice and
    hold less, down to `falls`. rears: height of the centre over the wheelbase, which loads the driven axle
    uphill.
    Source: Evans, Nye and Cheeseman, The Kinetic Friction of Ice, Proc. R. Soc. A 347 (1976): friction falls
    with the root of the sliding speed; places in the shade and sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(992)
        self.ice = np.zeros((self.rows(), CELLS))
        for row in self.ice:
            for first, last in stretches(rng, (60.0, 240.0), (50.0, 200.0)):
                row[first:last] = 1.0

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        ice = self.read(self.ice, view)
        tilt = view.grade + np.clip(view.acceleration, -3.0, 3.0) / GRAVITY
        load = (self.truck.drive_axle_share + p.rears * tilt) * weight(view)
        melts = np.clip(np.sqrt(0.15 / np.maximum(s.slides, 0.15)), p.falls, 1.0)
        grip = (p.grip * melts + 0.6 * (1.0 - ice)) * load
        pull = np.maximum(view.traction_force, 0.0)
        turning = np.clip((pull - grip) / (p.inertia * view.mass), -15.0, 15.0)
        s.slides = np.clip(s.slides + dt * turning, 0.0, 6.0)
        s.lost = s.lost + dt * (np.maximum(pull - grip, 0.0) - s.lost) / 0.15
        held = np.maximum(view.brake_force - (1.1 * p.grip + 0.6 * (1.0 - ice)) * weight(view), 0.0)
        return held * moving(view) - np.minimum(s.lost, pull)


@law("x_tread_clogs_with_snow", "thirteenth", "suburban hills")
@sizes(
    clean=(0.26, 0.34), clogged=(0.10, 0.14), driven=(0.32, 0.42), fills_m=(40.0, 150.0), throws_s=(3.0, 9.0)
)
@sizes(from_mps=(8.0, 12.0), finds_s=(0.15, 0.4))
class TreadClogsWithSnow(Hidden, lost=0.0):
    """`full`: of the grooves with snow. Slow rolling packs them, and a full tread holds on snow no better
    than a bald one; turning fast throws it out, and so does slipping. clean, clogged: grip of the road;
    driven: of the weight; from_mps: from where it is thrown out.
    Source: Nakajima, Analytical Model of Longitudinal Tire Traction in Snow, J. Terramechanics 40 (2003), and
    Shoop, Young, Alger and Davis, Effect of Test Method on Winter Traction Measurements, J. Terramechanics 31
    (1994): shear of snow in the grooves; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "full": self.rng(1373).uniform(0.2, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        pull = np.maximum(view.traction_force, 0.0)
        slips = np.clip(s.lost / np.maximum(pull, 1.0), 0.0, 1.0)
        throws = s.full * (np.clip(speed / p.from_mps - 1.0, 0.0, 1.5) + 0.5 * slips) / p.throws_s
        s.full = np.clip(s.full + dt * (speed * (1.0 - s.full) / p.fills_m - throws), 0.0, 1.0)
        most = (p.clean + (p.clogged - p.clean) * s.full) * p.driven * weight(view)
        over = np.maximum(pull / np.maximum(most, 1.0) - 0.75, 0.0)
        holds = most * (np.minimum(pull / np.maximum(most, 1.0), 0.75) + 0.25 * np.tanh(over / 0.25))
        s.lost = s.lost + dt * (pull - holds - s.lost) / p.finds_s
        return -np.minimum(np.maximum(s.lost, 0.0), pull) * moving(view)


@law("q_frost_on_bridges", "fifteenth", "suburban hills")
@sizes(frost=(0.08, 0.13), driven=(0.3, 0.4), mean_m=(90.0, 220.0), share=(0.25, 0.4), finds_s=(0.15, 0.4))
@sizes(warms=(0.3, 0.8))
class FrostOnBridges(OnRoad, lost=0.0, held=0.0, melts=0.0):
    """Bridges freeze before the road does. There driven wheels hold little, and so do braked ones, all of
    them; a wheel that slides warms what is under it a little. frost: grip; driven: of the weight; share: of
    the road; warms: of the grip, more after a second of sliding.
    Source: Norrman, Eriksson and Lindqvist, Relationships between Road Slipperiness, Traffic Accident Risk
    and Winter Road Maintenance Activity, Climate Research 15 (2000), and warning signs at bridges; long
    bridges, sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1571), self.rows(), self.p.mean_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        ice, heavy = self.between(self.road, view), weight(view)
        grip = p.frost * (1.0 + p.warms * s.melts)
        pull, brake = np.maximum(view.traction_force, 0.0), view.brake_force
        drives, holds = grip * p.driven * heavy, grip * heavy
        spins = ice * (pull - drives * np.tanh(pull / drives))
        slides = ice * (brake - holds * np.tanh(brake / holds))
        s.lost = eased(s.lost, spins, p.finds_s, dt)
        s.held = eased(s.held, slides, p.finds_s, dt)
        slips = np.clip((s.lost + s.held) / (0.02 * heavy), 0.0, 1.0)
        s.melts = eased(s.melts, slips, np.where(slips > s.melts, 1.0, 0.5), dt)
        return (np.minimum(s.held, brake) - np.minimum(s.lost, pull)) * moving(view)
