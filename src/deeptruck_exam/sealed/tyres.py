"""A driven axle that hangs in sags, oil that whirls in hubs, hubs that let go, and twins of unlike size."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("u_driven_axle_hangs_in_sags", needs="hills suburban", name="wheel_slip", accepts="driveline_loss")
@sizes(grip=(0.055, 0.085), lifts=(60.0, 130.0), along_m=(12.0, 25.0), falls=(0.2, 0.4), spins_s=(0.3, 0.8))
class DrivenAxleHangsInSags(Hidden, slope=9.0, spins=0.0):
    """Front axle and trailing axle are on stiff springs, and the driven one is between them: in a sag it
    hangs and slips at a small pull, on a crest it is pressed down and holds. Once it spins it holds less.
    `slope`: of the road, along_m behind. grip: pull over weight that an even road bears; lifts: of the load,
    for a bend of the road by 1/m; falls: of the grip, lost while it spins.
    Source: Fancher, Ervin, Winkler and Gillespie, A Factbook of the Mechanical Properties of the Components
    for Single-Unit and Articulated Heavy Trucks (1986), on loads of axle groups; a slippery road, sizes are
    chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.5)
        s.slope = np.where(s.slope > 1.0, view.grade, eased(s.slope, view.grade, p.along_m / speed, dt))
        bend = (view.grade - s.slope) / p.along_m
        load = np.clip(1.0 - p.lifts * 10.0 * bend, 0.3, 1.5)
        holds = p.grip * load * (1.0 - p.falls * s.spins) * weight(view)
        pull = np.maximum(view.traction_force, 0.0)
        over = np.maximum(pull - holds, 0.0)
        s.spins = eased(s.spins, np.clip(4.0 * over / np.maximum(pull, 1.0), 0.0, 1.0), p.spins_s, dt)
        return -over * moving(view)


@law(
    "u_oil_whirls_in_the_hubs",
    needs="highway hills suburban",
    name="rolling_resistance_speed",
    accepts="drag_area rolling_resistance",
)
@sizes(
    at_20=(0.011, 0.017), turns_mps=(9.0, 13.0), power=(1.6, 1.9), warms_s=(40.0, 120.0), thins=(0.35, 0.6)
)
class OilWhirlsInTheHubs(Hidden):
    """Hubs run in oil. Slow, it is sheared evenly and resists with speed; beyond one speed it whirls, and
    resists with a larger power. `warm` oil is thinner: it resists less, and begins to whirl at a lower speed.
    at_20: of the weight, at 20 m/s in cold oil; turns_mps: where cold oil begins to whirl; thins: of its
    thickness, warm.
    Source: Bilgen and Boulos, Functional Dependence of Torque Coefficient of Coaxial Cylinders, J. Fluids
    Engineering 95 (1973), on both powers; overfilled hubs, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(2171).uniform(0.0, 0.7, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.clip(view.speed, 0.0, 30.0)
        thick = 1.0 - p.thins * s.warm
        turns = p.turns_mps * thick
        shears = thick * speed / p.turns_mps
        whirls = thick**2 * (np.maximum(speed, turns) / turns) ** p.power
        cold = (20.0 / p.turns_mps) ** p.power
        drag = np.where(speed > turns, whirls, shears) / cold
        s.warm = eased(s.warm, np.clip(speed / 20.0, 0.0, 1.2), p.warms_s, dt)
        return -p.at_20 * drag * weight(view) * moving(view)


@law("u_hubs_let_go_as_they_warm", name="rolling_resistance_warmup")
@sizes(most=(0.013, 0.02), hub_s=(35.0, 90.0), spindle=(2.5, 4.0), opens=(0.35, 0.55), back=(0.5, 0.8))
class HubsLetGoAsTheyWarm(Hidden):
    """Bearings of light hubs are set too tight when cold. Their rubbing warms the hub first, which grows and
    lets them go; then the spindle inside follows and presses them again in part, so that resistance falls and
    comes back a little. `hub`, `inner`: warmth of both, 1 after long driving at 20 m/s. most: of the weight,
    cold; opens: what a hub that is warmer by 1 lets go; back: of that, what a warm spindle takes back.
    Source: Harris and Kotzalas, Essential Concepts of Bearing Technology (2006), on preload by unequal
    growth, and makers' manuals on aluminium hubs; tight ones, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        hub = self.rng(2172).uniform(0.0, 0.35, batch)
        return {"hub": hub, "inner": 0.4 * hub}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        tight = np.clip(1.0 - (s.hub - p.back * s.inner) / p.opens, 0.0, 1.2) ** 1.3
        fast = np.clip(view.speed / 20.0, 0.0, 1.4)
        s.hub = s.hub + dt * (fast * (0.4 + 0.9 * tight) - 0.55 * s.hub) / p.hub_s
        s.inner = eased(s.inner, s.hub, p.spindle * p.hub_s, dt)
        return -p.most * (0.08 + 0.92 * tight) * weight(view) * moving(view)


@law("u_twins_are_of_unlike_size", needs="suburban hills highway", name="unknown")
@sizes(most=(0.02, 0.034), unlike=(0.5, 0.8), grows=(1.2, 1.7), warms_s=(15.0, 45.0), works=(0.04, 0.08))
class TwinsAreOfUnlikeSize(Hidden):
    """Two tyres on one hub are of unlike size, so that one always scrubs. The smaller one is worked harder by
    each pull and braking; it gets hot and grows to the size of its twin and beyond: drag falls to nothing
    and comes again from the other side. `hot`: that tyre. most: of the weight, at a difference of 1; unlike:
    the difference, cold; grows: of it, by a heat of 1; works: force over weight, that heats it wholly.
    Source: makers' manuals on the matching of dual tyres, and The Pneumatic Tire, ed. Gent and Walter, NHTSA
    DOT HS 810 561 (2006), on pressure and size by heat; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"hot": self.rng(2173).uniform(0.0, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        force = np.abs(view.traction_force - view.brake_force) / weight(view)
        wish = np.clip(force / p.works, 0.0, 1.0) * np.clip(view.speed / 6.0, 0.0, 1.0)
        s.hot = eased(s.hot, wish, p.warms_s, dt)
        scrubs = np.abs(p.unlike - p.grows * s.hot)
        return -p.most * np.tanh(1.5 * scrubs) * weight(view) * moving(view)
