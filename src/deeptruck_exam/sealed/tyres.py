"""Slip that heats the rubber, discs that pump air, frost in a casing, and trailers that crab on a slant."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import CELL_M, OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("z_slip_melts_the_rubber", needs="suburban hills", name="wheel_slip")
@sizes(grip=(0.19, 0.28), melts=(0.35, 0.6), heats_s=(0.6, 1.6), cools_s=(4.0, 12.0), mean_m=(120.0, 450.0))
@sizes(share=(0.45, 0.7))
class SlipMeltsTheRubber(OnRoad, hot=0.0, lost=0.0):
    """`hot`: the skin of driven tyres on polished stone. Pull near their grip makes them slip, slip melts
    the rubber, and molten rubber grips less. So a spin feeds itself until the driver gives way, and cools
    in seconds. grip: of their load, cold; melts: of that, when hot.
    Source: Persson, Rubber Friction: Role of the Flash Temperature, J. Physics: Condensed Matter 18 (2006),
    on grip that falls with the heat of sliding, and Wong, Theory of Ground Vehicles (2008); sizes are
    chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1771), self.rows(), self.p.mean_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        stone, pull = self.between(self.road, view), np.maximum(view.traction_force, 0.0)
        most = 0.35 * p.grip * (1.0 - p.melts * s.hot) * weight(view)
        holds = pull / (1.0 + (pull / most) ** 4) ** 0.25
        s.lost = eased(s.lost, stone * (pull - holds), 0.25, dt)
        slides = np.clip(s.lost / (0.04 * weight(view)), 0.0, 1.5)
        s.hot = np.clip(s.hot + dt * (slides * (1.0 - s.hot) / p.heats_s - s.hot / p.cools_s), 0.0, 1.0)
        return -np.minimum(s.lost, pull) * moving(view)


@law("z_discs_pump_air", needs="highway hills suburban", name="rolling_resistance_speed", accepts="drag_area")
@sizes(at_20=(0.01, 0.015), clogs_s=(20.0, 60.0), frees=(0.02, 0.06), light_k=(200.0, 400.0), open=(0.1, 0.3))
class DiscsPumpAir(Hidden):
    """Vanes in all wheels pump air through discs and rims, and take power as fans do. `dirt` fills their
    channels on the way, down to what stays open, and a braking that shakes the wheels frees them. Hot air is
    light and costs less. at_20: of the weight, at 20 m/s, clean and cold; frees: of full braking, that
    empties them within a second; light_k: of heat, for half the cost.
    Source: Limpert, Cooling Analysis of Disc Brake Rotors, SAE 751014 (1975), on pumping by vanes of discs;
    larger fans, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"dirt": self.rng(1772).uniform(0.0, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        shakes = np.clip(view.brake_force / self.truck.brake_capacity / p.frees, 0.0, 1.5) ** 2
        fills = np.minimum(speed / 15.0, 1.5) * (1.0 - s.dirt) / p.clogs_s
        s.dirt = np.clip(s.dirt + dt * (fills - shakes * s.dirt), 0.0, 1.0)
        heat = np.clip(view.brake_temperature - self.truck.ambient_temperature, 0.0, 500.0)
        passes = 1.0 - (1.0 - p.open) * s.dirt
        cost = p.at_20 * (speed / 20.0) ** 2 * passes / (1.0 + heat / p.light_k)
        return -cost * weight(view) * moving(view)


@law("z_frost_in_the_casing", name="rolling_resistance_warmup")
@sizes(most=(0.0055, 0.0088), flex=(0.25, 0.45), melts=(0.5, 0.9), warms_s=(25.0, 70.0), edge=(0.06, 0.15))
class FrostInTheCasing(Hidden):
    """`heat` in wet casings that stood in frost. Below 0 they are stiff. From 0 on all heat goes into
    melting the ice and they stay as stiff, until within a moment they are soft. Then they are warmed on as
    any tyre. `heat` is 0 where ice begins to melt. most: of the weight, frozen; flex: of that, thawed and
    cold; melts: heat that the ice takes, over that of one warming.
    Source: Carslaw and Jaeger, Conduction of Heat in Solids (1959), on melting that holds a temperature,
    and makers' notes on water in retreaded casings; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"heat": self.rng(1773).uniform(-0.5, 0.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        warm = np.where(s.heat < 0.0, s.heat, np.maximum(s.heat - p.melts, 0.0))  # the temperature
        ice = 1.0 / (1.0 + np.exp(np.clip((s.heat - p.melts) / p.edge, -30.0, 30.0)))
        works = np.clip(view.speed / 16.0, 0.0, 1.4) * (0.6 + 0.4 * ice)
        s.heat = np.clip(s.heat + dt * (works - 0.35 * (warm + 0.5)) / p.warms_s, -1.0, 3.0)
        stiff = ice + (1.0 - ice) * p.flex * np.exp(-1.2 * np.maximum(warm, 0.0))
        return -p.most * stiff * weight(view) * moving(view)


@law("z_trailer_crabs_on_the_slant", needs="suburban hills highway", name="unknown")
@sizes(
    costs=(0.003, 0.005), long_m=(150.0, 450.0), slant=(0.3, 0.8), follows_m=(10.0, 30.0), most=(0.01, 0.016)
)
class TrailerCrabsOnTheSlant(OnRoad, angle=0.0):
    """`angle`: of a trailer to its way, over the usual one. On a road that slants to one side its axles have
    to run askew, to hold it up, and loose bushes let them do so by far. It follows the slant over some
    metres; where the slant turns round it runs straight for a moment. costs: of the weight, at the usual
    slant; slant: beside the mean one; most: of the weight.
    Source: Gillespie, Fundamentals of Vehicle Dynamics (1992), on trailers on roads that slant, and Pacejka,
    Tire and Vehicle Dynamics (2012), on side force by slip angle; sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1774), self.p
        self.road = p.slant * rng.choice([-1.0, 1.0], (self.rows(), 1)) + ou_series(
            rng, (self.rows(), 12000), CELL_M, p.long_m
        )

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed, slant = np.maximum(view.speed, 0.0), self.read(self.road, view)
        s.angle = eased(s.angle, slant, p.follows_m / np.maximum(speed, 1e-3), dt)
        askew = p.most * np.tanh(p.costs / p.most * s.angle**2)
        return -askew * weight(view) * moving(view)
