"""Front wheels that lose their load, seals that ride up, a warming by the root of the way, and tyres that
hold against the wind from the side."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, index, moving, weight
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("y_front_wheels_lose_their_load", needs="suburban hills", name="wheel_slip")
@sizes(grip=(0.3, 0.4), front=(0.24, 0.34), lifts=(1.0, 1.6), mean_m=(120.0, 450.0), share=(0.5, 0.75))
@sizes(slides=(0.1, 0.3))
class FrontWheelsLoseTheirLoad(OnRoad, lost=0.0, load=0.3):
    """Only the front wheels drive. Pull and slope both move load to the rear, and so take away the grip by
    which the front pulls. `load` of the front, which follows by the nodding of the truck. On wet stretches it
    slips. grip: of the load on it; front: of the weight, level; lifts: load lost, over pull and slope;
    slides: of the grip, lost in sliding.
    Source: Gillespie, Fundamentals of Vehicle Dynamics (1992), on traction limits of driven front axles by
    transfer of load; a short, high truck, sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1871), self.rows(), self.p.mean_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration / GRAVITY + view.grade, -0.2, 0.2)
        s.load = eased(s.load, np.clip(p.front - p.lifts * felt, 0.05, 0.5), 0.35, dt)
        pull = np.maximum(view.traction_force, 0.0)
        over = np.maximum(pull / (p.grip * s.load * weight(view)) - 0.8, 0.0)
        holds = p.grip * s.load * weight(view) * (0.8 + (1.0 - p.slides) * 0.25 * np.tanh(4.0 * over))
        lacks = np.maximum(pull - holds, 0.0) * np.where(over > 0.0, 1.0, 0.0)
        s.lost = eased(s.lost, self.between(self.road, view) * lacks, 0.2, dt)
        return -np.minimum(s.lost, pull) * moving(view)


@law(
    "y_seals_ride_up",
    needs="highway hills suburban",
    name="rolling_resistance_speed",
    accepts="drag_area rolling_resistance",
)
@sizes(
    slow=(0.009, 0.015), rides_mps=(4.0, 8.0), films=(0.003, 0.006), builds_s=(1.5, 5.0), breaks_s=(0.4, 1.2)
)
class SealsRideUp(Hidden, film=0.0):
    """Many tight seals at hubs and shafts rub dry when they turn slowly. Faster, they ride up on a film and
    rub little; then the film itself costs more with the root of speed. `film`: builds slowly and breaks soon.
    slow: of the weight, rubbing dry; rides_mps: where half is lifted; films: of the weight, at 20 m/s.
    Source: Müller and Nau, Fluid Sealing Technology (1998), on lip seals between dry rubbing and a film; many
    seals, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        wish = 1.0 - np.exp(-((speed / p.rides_mps) ** 2) * 0.7)
        s.film = eased(s.film, wish, np.where(wish > s.film, p.builds_s, p.breaks_s), dt)
        cost = p.slow * (1.0 - s.film) + p.films * s.film * np.sqrt(speed / 20.0)
        return -cost * weight(view) * moving(view)


@law("y_warms_by_the_root_of_the_way", name="rolling_resistance_warmup")
@sizes(most=(0.0075, 0.0125), way_m=(100.0, 320.0), cools_s=(20.0, 60.0), loads=(0.3, 0.7))
class WarmsByTheRootOfTheWay(Hidden):
    """Heat goes into thick rubber by the root of time: much of the stiffness is lost over the first metres,
    and the rest over many kilometres. `way` m that the tyres remember, which a stand takes away bit by bit.
    most: of the weight, quite cold; way_m: until three tenths are lost; loads: how much more way a heavy
    truck counts.
    Source: Incropera and DeWitt, Fundamentals of Heat and Mass Transfer (1996), on bodies so thick that heat
    goes in by the root of time; thick tyres, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"way": self.p.way_m * self.rng(1873).uniform(0.0, 0.8, batch) ** 2}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        heavy = 1.0 + p.loads * (np.clip(view.mass / 20000.0, 0.4, 2.0) - 1.0)
        forgets = s.way / p.cools_s * np.clip(1.0 - speed / 2.0, 0.0, 1.0)
        s.way = np.clip(s.way + dt * (heavy * speed - forgets), 0.0, 1e5)
        return -p.most / np.sqrt(1.0 + s.way / p.way_m) * weight(view) * moving(view)


@law("y_holds_against_the_side_wind", needs="highway hills suburban", name="unknown")
@sizes(costs=(0.0028, 0.005), gusts_s=(4.0, 12.0), mean=(0.4, 0.9), steers_s=(0.4, 1.2), most=(0.011, 0.017))
@sizes(light=(0.5, 1.0))
class HoldsAgainstTheSideWind(OnRoad, slips=0.0):
    """The wind blows from the side, and tyres hold against it by running askew, which costs the square of the
    side force. `slips`: their angle, over the usual one. Gusts pass within seconds, and a light truck has to
    run more askew. costs: of the weight, at the usual angle; mean: of the wind, beside its gusts; light:
    power of the mass; most: of the weight.
    Source: Baker, Ground Vehicles in High Cross Winds, J. Fluids and Structures 5 (1991), on side forces, and
    Pacejka, Tire and Vehicle Dynamics (2012), on drag by slip angle; strong winds, sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1874), self.p
        samples = int(self.setting.duration_s / 0.25) + 8
        gusts = ou_series(rng, (self.setting.batch, samples), 0.25, p.gusts_s)
        self.side = rng.choice([-1.0, 1.0]) * p.mean + gusts

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wind = self.side[:, index(view, self.side, 0.25)]
        fast = np.clip(view.speed / 15.0, 0.0, 1.8)
        light = (20000.0 / np.maximum(view.mass, 8000.0)) ** p.light
        s.slips = eased(s.slips, wind * np.abs(wind) * (0.4 + 0.6 * fast) * light, p.steers_s, dt)
        askew = p.most * np.tanh(p.costs / p.most * s.slips**2)
        return -askew * weight(view) * moving(view)
