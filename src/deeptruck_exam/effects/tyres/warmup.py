"""Rolling resistance that falls as the tyres warm."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="rolling_resistance_warmup")


@law("rolling_resistance_warmup", "first")
@sizes(cold_gain=(0.9, 2.2), tread_s=(40.0, 90.0), carcass_s=(150.0, 420.0), split=(0.3, 0.6))
class ColdTyres(Hidden):
    """Every drive starts at its own degree of cold (a pause of unknown length).
    Source: Nielsen and Sandberg, A New Model for Rolling Resistance of Pneumatic Tires, SAE 2002-01-1200:
    loss falls as the tyre warms; two thermal bodies, as the tread warms first, are chosen here."""

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


@law("tyres_heat_themselves", "second")
@sizes(per_k=(0.025, 0.045), heat_jk=(0.15e6, 0.35e6), flat_n=(300.0, 1100.0), roll_out_m=(300.0, 1000.0))
class TyresHeatThemselves(Hidden):
    """Warming takes distance and load, not time; a truck that stands cools. heat_jk: all tyres, per 20 t of
    truck.
    Source: Mars and Luchini, An Analytical Model for the Transient Rolling Resistance Behavior of Tires, Tire
    Science and Technology 27 (1999): loss falls exponentially with temperature, which its own heat raises
    against the air; flat spots of a night's parking that roll out are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(150)
        self.first = rng.uniform(-35.0, -12.0, self.setting.batch)
        self.flat = rng.uniform(0.0, 1.0, self.setting.batch) ** 2

    def start(self, batch: int) -> dict[str, Array]:
        return {"below": self.first.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        size = weight(view) / 200000.0
        steady = self.truck.rolling_resistance * weight(view)
        loss = steady * np.exp(-p.per_k * s.below)
        speed = np.maximum(view.speed, 0.0)
        gained = (loss - steady) * speed - 60.0 * size * s.below * (1.0 + speed) ** 0.6
        s.below = np.minimum(s.below + dt * gained / (p.heat_jk * size), 0.0)
        flat = p.flat_n * size * self.flat * np.exp(-view.distance / p.roll_out_m)
        return -(loss - steady + flat) * moving(view)


@law("axle_by_axle", "third")
@sizes(warm_k=(28.0, 45.0), per_k=(0.012, 0.0185), pace_s=(110.0, 320.0))
class AxleByAxle(Hidden):
    """warm_k: above the air at 20 m/s. A slow stretch lets tyres cool again.
    Source: Wong, Theory of Ground Vehicles (2008), on rolling resistance and tyre temperature: loss in
    inverse proportion to warmth, which follows a balance that rises with speed; axles that warm at their own
    pace are chosen here."""

    def prepare(self) -> None:
        self.load = np.array([[0.25], [0.35], [0.40]])
        self.pace = self.p.pace_s * np.array([[0.6], [1.0], [1.5]])
        self.first = self.rng(250).uniform(0.0, 0.5, self.setting.batch) * self.p.warm_k

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": np.tile(self.first, (3, 1))}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        balance = p.warm_k * np.minimum(np.maximum(view.speed, 0.0) / 20.0, 1.0) ** 0.6
        s.warm += dt * (balance - s.warm) / self.pace
        growth = 1.0 / (1.0 - p.per_k * (p.warm_k - s.warm)) - 1.0
        extra = (self.load * growth).sum(axis=0) * self.truck.rolling_resistance
        return -extra * weight(view) * moving(view)


@law("warmed_by_the_way", "fourth")
@sizes(cold=(1.9, 3.4), way_m=(500.0, 1800.0), stretch=(0.45, 0.75), night_c=(-20.0, 0.0))
class WarmedByTheWay(Hidden):
    """Neither speed nor time warms these tyres, the way does; some have come a way already. cold: of the
    known resistance, at -15 C.
    Source: Rolling resistance falls over kilometres, fast at first and then ever slower, as coastdown
    practice finds (SAE J1263 and 40 CFR 1066 on warm-up); a stretched exponential of the way (Kohlrausch)
    from the temperature of the night, with ISO 28580's temperature factor; sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(370), self.setting.batch
        night = self.p.night_c + rng.uniform(0.0, 10.0, batch)
        self.cold = self.p.cold * np.clip((25.0 - night) / 40.0, 0.15, 1.0)
        self.before_m = self.p.way_m * rng.choice([0.0, 0.0, 1.0, 4.0], batch)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        way = (np.maximum(view.distance, 0.0) + self.before_m) / p.way_m
        left = np.exp(-(way**p.stretch))
        return -self.cold * left * self.truck.rolling_resistance * weight(view) * moving(view)


@law("grease_makes_way", "sixth")
@sizes(churns=(1.3, 2.6), way_m=(300.0, 1100.0), order=(0.6, 1.1), slumps_s=(25.0, 90.0))
class GreaseMakesWay(Hidden):
    """Colder air, more drag; a stop gives a part of it back. churns: of the rolling resistance, at 10
    degrees.
    Source: Lugt, Grease Lubrication in Rolling Bearings (2013), on churning and channelling: fresh or cold
    grease is churned until revolutions have pushed it aside, and slumps back while the wheels stand; a power
    of the way; hubs packed with too much of it, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"way": self.rng(509).uniform(0.0, 0.5, batch) * self.p.way_m}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.way += dt * np.where(speed < 0.3, -s.way / p.slumps_s, speed)
        stiff = np.exp(-0.018 * np.clip(self.truck.ambient_temperature - 10.0, -25.0, 25.0))
        left = p.churns * stiff * (1.0 + s.way / p.way_m) ** -p.order
        return -left * self.truck.rolling_resistance * weight(view) * moving(view)


@law("softened_by_work", "seventh")
@sizes(stiff=(1.2, 2.4), way_m=(350.0, 1300.0), order=(0.45, 0.8), works=(6.0, 20.0))
class SoftenedByWork(Hidden):
    """Hard driving warms sooner than long driving. stiff: of the rolling resistance; works: more, for pull or
    brake over the weight.
    Source: Mullins, Softening of Rubber by Deformation, Rubber Chem. Technol. 42 (1969), and the stretched
    exponential of Kohlrausch: filled rubber loses less the more it has been worked, by weight and way and by
    pull and braking, and stiffens again at rest; tyres after a cold soak."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"work": self.rng(704).uniform(0.0, 0.25, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        shear = (np.abs(view.traction_force) + view.brake_force) / weight(view)
        done = speed / p.way_m * (1.0 + p.works * np.minimum(shear, 0.3))
        s.work += dt * np.where(speed < 0.3, -s.work / 120.0, done)
        cold = 1.0 + 0.012 * np.clip(20.0 - self.truck.ambient_temperature, -15.0, 30.0)
        left = p.stiff * cold * np.exp(-(np.maximum(s.work, 0.0) ** p.order))
        return -left * self.truck.rolling_resistance * weight(view) * moving(view)


@law("s_gas_in_the_tyre_warms", "eighth")
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


@law("n_brakes_warm_the_rims", "ninth")
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


@law("t_flat_spots_round_off", "tenth")
@sizes(drags=(0.006, 0.014), glass=(0.35, 0.65), warms_s=(50.0, 140.0), rounds_s=(20.0, 70.0))
class FlatSpotsRoundOff(Hidden, warm=0.0):
    """`flat`: what standing overnight has left in the cords, other in each drive. It stays until the tyre is
    warm and then goes quickly. drags: of the weight, fully flat; glass: warmth at which cords give.
    Source: The Pneumatic Tire, ed. Gent and Walter, NHTSA DOT HS 810 561 (2006), on flat-spotting of nylon
    cords, which set below their glass transition and recover above; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(991)
        return {"flat": rng.uniform(0.35, 1.0, batch), "warm": rng.uniform(0.0, 0.25, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        goal = np.clip(np.maximum(view.speed, 0.0) / 18.0, 0.0, 1.5) ** 0.7
        s.warm = s.warm + dt * (goal - s.warm) / p.warms_s
        gives = 0.06 + 1.0 / (1.0 + np.exp(-(s.warm - p.glass) / 0.06))
        s.flat = np.clip(s.flat - dt * (view.speed > 0.3) * s.flat * gives / p.rounds_s, 0.0, 1.0)
        return -p.drags * s.flat * weight(view) * moving(view)


@law("e_inner_twin_takes_over", "eleventh")
@sizes(
    cold=(0.010, 0.018), falls=(0.7, 1.4), warms_m=(1500.0, 4500.0), cools_s=(200.0, 500.0), tilts=(0.3, 0.8)
)
class InnerTwinTakesOver(Hidden):
    """`inner`, `outer`: warmth of twin tyres, 0 cold to about 1. The warmer one is harder and carries more,
    which warms it more; the outer one has the wind. cold: of the weight, beyond warm tyres; tilts: of the
    load, for a difference of 1.
    Source: The Pneumatic Tire, ed. Gent and Walter, NHTSA DOT HS 810 561 (2006), on rolling loss with load
    and temperature, and Cebon, Handbook of Vehicle-Road Interaction (1999), on twin tyres that share a load
    by their pressures; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(1071)
        inner = 0.7 * rng.beta(0.5, 1.0, batch)  # after pauses of any length
        return {"inner": inner, "outer": inner * rng.uniform(0.5, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        tilt = np.clip(p.tilts * (s.inner - s.outer), -0.45, 0.45)
        losses = {"inner": (1.0 + tilt, 0.7), "outer": (1.0 - tilt, 1.3)}
        resists = np.zeros(len(speed))
        for name, (load, wind) in losses.items():
            warm = getattr(s, name)
            loss = load**1.2 * np.exp(-p.falls * warm)
            resists += (
                0.5 * load**1.2 * np.maximum(np.exp(-2.5 * p.falls * warm) - np.exp(-2.5 * p.falls), 0.0)
            )
            cools = wind * (0.5 + speed / 30.0) * warm / p.cools_s
            setattr(s, name, np.clip(warm + dt * (2.2 * loss * speed / p.warms_m - cools), 0.0, 1.3))
        return -p.cold * resists * weight(view) * moving(view)


@law("q_rubber_holds_crystals", "fifteenth")
@sizes(most=(0.009, 0.014), warms_s=(40.0, 110.0), at=(0.3, 0.5), melts_s=(8.0, 25.0), forms_s=(60.0, 200.0))
class RubberHoldsCrystals(Hidden):
    """`crystals` that natural rubber has grown over cold nights; they make it stiff. `warm`: the tyre, 1 as
    at 20 m/s for long. Nothing happens until it is warm enough to melt them, then they go soon; at slow
    speeds they grow again. most: of the weight, all crystals; at: of `warm`, where melting begins.
    Source: Treloar, The Physics of Rubber Elasticity (1975), on crystals of natural rubber in the cold, which
    melt well above where they form; quick ones, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(1572)
        return {"warm": rng.uniform(0.0, 0.3, batch), "crystals": rng.uniform(0.6, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pace = np.clip(view.speed / 20.0, 0.0, 1.3)
        s.warm = eased(s.warm, pace, p.warms_s, dt)
        melts = np.clip((s.warm - p.at) / 0.15, 0.0, 1.0) / p.melts_s
        forms = np.clip((p.at - s.warm) / 0.15, 0.0, 1.0) / p.forms_s
        s.crystals = np.clip(s.crystals + dt * (forms * (1.0 - s.crystals) - melts * s.crystals), 0.0, 1.0)
        return -p.most * s.crystals * (0.6 + 0.4 * pace) * weight(view) * moving(view)


@law("v_pull_warms_the_tread", "sixteenth")
@sizes(most=(0.014, 0.021), hard=(0.03, 0.05), warms_s=(12.0, 35.0), cools_s=(60.0, 180.0), rolls=(0.1, 0.25))
class PullWarmsTheTread(Hidden):
    """`warm`: the tread of winter tyres. Rolling warms it little, but each pull and each braking makes it
    creep on the road, and that heat comes with the square of the force. So a truck that has worked hard
    rolls easily, and one that has rolled along is stiff. most: of the weight, cold; hard: of the weight, the
    force that warms it wholly; rolls: of that heat, by rolling at 20 m/s.
    Source: Pacejka, Tire and Vehicle Dynamics (2012), on creep with force, and Grosch, The Relation between
    the Friction and Visco-elastic Properties of Rubber, Proc. R. Soc. A 274 (1963); sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(1672).uniform(0.0, 0.5, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.clip(view.speed / 20.0, 0.0, 1.3)
        force = (np.abs(view.traction_force) + view.brake_force) / weight(view) / p.hard
        heat = p.rolls * speed + np.minimum(force, 2.0) ** 2 * np.sqrt(speed)
        rate = heat / p.warms_s + 1.0 / p.cools_s
        s.warm = eased(s.warm, heat / p.warms_s / rate, 1.0 / rate, dt)
        return -p.most * np.exp(-2.2 * s.warm) * weight(view) * moving(view)


@law("h_filler_net_breaks", "nineteenth")
@sizes(most=(0.0065, 0.011), way_m=(500.0, 1500.0), whole_s=(40.0, 120.0), harsh=(0.5, 1.5), power=(1.0, 1.6))
class FillerNetBreaks(Hidden):
    """`net` of filler in the rubber, whole after a night, that makes it stiff. Each turn of the wheel breaks
    some of it, and pulls and brakings more; at a stand or a crawl it grows again. Heat has no part in it.
    most: of the weight, with a whole net; way_m: until two thirds are broken; whole_s: until it is whole.
    Source: Payne, The Dynamic Properties of Carbon Black-Loaded Natural Rubber, J. Applied Polymer Science 6
    (1962), on nets of filler that strain breaks and rest mends; quick mending, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"net": self.rng(1973).uniform(0.5, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        strain = 1.0 + p.harsh * np.minimum(np.abs(view.acceleration), 2.0)
        mends = (1.0 - s.net) / p.whole_s * np.exp(-speed / 4.0)
        s.net = np.clip(s.net + dt * (mends - strain * speed / p.way_m * (s.net - 0.1)), 0.0, 1.0)
        return -p.most * s.net**p.power * weight(view) * moving(view)


@law("b_passes_its_glass_transition", "twentieth")
@sizes(most=(0.01, 0.016), at=(0.35, 0.55), wide=(0.16, 0.28), warms_s=(45.0, 120.0), cools_s=(90.0, 240.0))
class PassesItsGlassTransition(Hidden):
    """Rubber that came out of deep frost is hard as glass and loses little; as it warms it passes through its
    glass transition, where it loses most, and only beyond that it runs easily. So resistance first rises on
    the way and then falls. `warm`: 1 where work and wind are even at 20 m/s. most: of the weight, in the
    transition; at, wide: its middle and its width.
    Source: Ferry, Viscoelastic Properties of Polymers (1980), on losses about the glass transition; a poor
    rubber for winter, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(2074).uniform(0.0, 0.4, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        fast = np.clip(view.speed / 20.0, 0.0, 1.4)
        loses = np.exp(-(((s.warm - p.at) / p.wide) ** 2))
        works = fast * (0.6 + 0.8 * loses) / p.warms_s
        s.warm = np.clip(s.warm + dt * (works - (0.3 + 0.7 * fast) * s.warm / p.cools_s), 0.0, 1.6)
        return -p.most * (0.12 + 0.88 * loses) * weight(view) * moving(view)
