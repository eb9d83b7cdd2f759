"""Rolling resistance of tyres that cool again on the way."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, name="rolling_resistance_warmup")


@law("tread_and_rim_warm_up", "fifth")
@sizes(cold=(1.2, 2.4), tread_s=(110.0, 300.0), quenches_s=(18.0, 50.0), rains=(0.15, 0.4), rim=(0.15, 0.35))
class TreadAndRimWarmUp(Hidden):
    """`lacks`: 1 after a night in the yard, 0 warm. cold: more than warm, of the rolling resistance; rains:
    share of time.
    Source: Thermocouples in tread and rim of test trucks: the tread warms in minutes by its own work and is
    quenched by showers, the rim by the brakes (Sandberg, Heavy Truck Modeling for Fuel Consumption,
    Linköping, 2001; Oh, Kim, Kim and Han, Tire Sci. Technol. 23, 1995); loss with the power 1.5 of what is
    lacking in warmth, sizes chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(422), self.setting.batch
        self.first = rng.uniform(0.55, 1.05, (2, batch))
        shower = rng.uniform(0.0, self.setting.duration_s, batch)
        self.shower = np.stack([shower, shower + self.p.rains * self.setting.duration_s])

    def start(self, batch: int) -> dict[str, Array]:
        return {"lacks": self.first.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        wet = (self.shower[0] < view.time) & (view.time < self.shower[1])
        tread, rim = s.lacks
        works = (speed / 15.0) * (0.6 + 0.4 * tread) * tread / p.tread_s
        quench = wet * np.maximum(0.75 - tread, 0.0) * np.clip(speed / 10.0, 0.0, 1.5) / p.quenches_s
        braked = view.brake_force * speed / (weight(view) * 12.0)
        s.lacks = np.maximum(
            np.stack([tread + dt * (quench - works), rim - dt * rim * (braked + speed / 15.0 / 900.0)]), 0.0
        )
        lacking = (1.0 - p.rim) * s.lacks[0] ** 1.5 + p.rim * s.lacks[1]
        return -p.cold * lacking * self.truck.rolling_resistance * weight(view) * moving(view)


@law("w_puddles_cool_the_tyres", "twelfth")
@sizes(cold=(0.006, 0.012), warms_m=(900.0, 2600.0), cools_m=(80.0, 300.0), wet_m=(250.0, 700.0))
class PuddlesCoolTheTyres(OnRoad):
    """`warm`: of the tyres' full warmth. They warm over dry road and lose it quickly where the road is wet,
    at places that stay. cold: of the weight, more than warm.
    Source: Ejsmont, Sjogren, Swieczko-Zurek and Ronowski, Influence of Road Wetness on Tire-Pavement Rolling
    Resistance, J. Civil Engineering and Architecture 9 (2015): water's cooling is most of what it costs; wet
    lengths are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1171), self.rows(), self.p.wet_m, 0.3)

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(1172).uniform(0.0, 0.5, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wet = self.between(self.road, view)
        way = dt * np.maximum(view.speed, 0.0)
        s.warm = s.warm + way * ((1.0 - wet) * (1.0 - s.warm) / p.warms_m - wet * s.warm / p.cools_m)
        s.warm = np.clip(s.warm, 0.0, 1.0)
        return -p.cold * (1.0 - s.warm) ** 1.3 * weight(view) * moving(view)


@law("x_cold_lies_in_hollows", "thirteenth", "hills suburban descent highway")
@sizes(cold=(0.007, 0.012), deep_m=(3.0, 8.0), takes_s=(8.0, 30.0), land_m=(900.0, 2500.0), begins=(0.1, 0.5))
class ColdLiesInHollows(Hidden, height=0.0, land=0.0):
    """`rubber`: warmth of the tyres, 1 on a mild height. In a clear night cold air fills the hollows of the
    land, and tyres that roll through it follow with delay; they start colder than all of it. cold: of the
    weight, cold over mild; deep_m: of a hollow that is full of it; land_m: over which the land is felt.
    Source: Clements, Whiteman and Horel, Cold-Air-Pool Structure and Evolution in a Mountain Basin: Peter
    Sinks, Utah, J. Applied Meteorology 42 (2003), and ISO 28580 on rolling resistance over temperature;
    quicker and more rubber, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        first = self.rng(1372).uniform(0.0, 1.0, batch)
        return {**super().start(batch), "rubber": -self.p.begins * first}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.height = s.height + dt * speed * view.grade
        s.land = s.land + dt * speed * (s.height - s.land) / p.land_m
        air = np.clip(0.5 + (s.height - s.land) / p.deep_m, 0.0, 1.0)
        s.rubber = s.rubber + dt * (air - s.rubber) * (0.3 + speed / 15.0) / p.takes_s
        return -p.cold * np.exp(-1.8 * s.rubber) * weight(view) * moving(view)


@law("k_axle_comes_down_cold", "fourteenth")
@sizes(
    cold=(0.010, 0.018), warms_s=(20.0, 50.0), cools_s=(25.0, 70.0), down_s=(50.0, 120.0), up_s=(20.0, 60.0)
)
@sizes(left=(0.05, 0.2))
class AxleComesDownCold(Hidden, down=0.0):
    """`warm`: of the tyres of a lift axle. While it is up they cool in the wind, and whenever it is let down
    they cost much until they are warm again. The driver moves it as he likes. cold: of the weight, all cold;
    left: of that, warm.
    Source: Popov, Cole, Winkler and Cebon, Laboratory Measurement of Rolling Resistance in Truck Tyres under
    Dynamic Vertical Load, Proc. IMechE D 217 (2003), on warm-up of truck tyres, and makers' manuals of lift
    axles; quicker tyres, sizes are chosen here."""

    def prepare(self) -> None:
        on, off = (0.6 * self.p.down_s, 1.4 * self.p.down_s), (0.6 * self.p.up_s, 1.4 * self.p.up_s)
        self.spans = spells(self.rng(1472), self.setting.batch, on, off)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "warm": self.rng(1473).uniform(0.0, 0.4, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.down = eased(s.down, within(self.spans, view.time), 1.5, dt)
        pace = 0.2 + np.maximum(view.speed, 0.0) / 15.0
        slow = np.where(s.down > 0.5, p.warms_s, p.cools_s) / pace
        s.warm = eased(s.warm, np.where(s.down > 0.5, 1.0, 0.0), slow, dt)
        costs = p.cold * s.down * (p.left + (1.0 - p.left) * (1.0 - s.warm) ** 1.5)
        return -costs * weight(view) * moving(view)


@law("z_frost_in_the_casing", "seventeenth")
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


@law("y_warms_by_the_root_of_the_way", "eighteenth")
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


@law("u_hubs_let_go_as_they_warm", "twenty-first")
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
