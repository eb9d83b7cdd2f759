"""A hose that blows up, a barometer that leaks, a gear that is run in, and a quick lift; a film that heats
itself, springs that breathe, swings of the mixture, and pipes in tune."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.places import OnRoad, sections
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("y_hose_blows_up", needs="suburban hills", name="turbo_lag", accepts="command_rate_limit", shown=True)
@sizes(least=(0.22, 0.36), first_s=(0.8, 1.4), blows=(4.0, 8.0), creeps_s=(4.0, 12.0), empties_s=(0.3, 0.8))
class HoseBlowsUp(Hidden, air=0.2, creep=0.0):
    """`air`: pressed air behind a soft hose, which blows up like a balloon. Near nothing it fills at once,
    and the fuller it is the more slowly it fills. `creep`: a hose that has been full for some time stays
    wide, and the next filling takes longer still. least: of peak torque, without pressed air; blows: how much
    wider when full.
    Source: Watson and Janota, Turbocharging the Internal Combustion Engine (1982), on volumes of manifolds,
    and Treloar, The Physics of Rubber Elasticity (1975), on balloons; a soft hose, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        wish = np.clip((asked - p.least) / (1.0 - p.least) * 1.1, 0.0, 1.1)
        turns = np.clip(view.engine_speed / 140.0, 0.5, 1.5)
        fills = p.first_s * (1.0 + p.blows * s.air**2 * (0.7 + 0.6 * s.creep)) / turns
        s.creep = eased(s.creep, np.minimum(s.air, 1.0), p.creeps_s, dt)
        s.air = eased(s.air, wish, np.where(wish > s.air, fills, p.empties_s), dt)
        most = p.least + (1.0 - p.least) * s.air
        return -self.at_wheels(view, np.maximum(asked - most, 0.0) * self.truck.peak_torque) * moving(view)


@law(
    "y_barometer_is_nearly_tight",
    needs="hills suburban",
    name="torque_derate",
    accepts="torque_gain",
    shown=True,
)
@sizes(most=(0.25, 0.42), climb_m=(3.0, 7.0), leaks_s=(30.0, 80.0), rests=(0.0, 0.1))
class BarometerIsNearlyTight(Hidden):
    """The engine gives less in thin air, by a barometer whose case should be open and is nearly tight. It
    reads the height climbed of late, and forgets that as its case leaks. `climbed` m. So a climb takes torque
    that comes back on the flat within a minute. most: of the torque, taken; climb_m: for two thirds of it;
    rests: always taken.
    Source: ISA standard atmosphere and SAE J1349 on corrections of power by pressure, and makers' manuals on
    variometers, which leak on purpose; a blocked vent and its sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"climbed": self.rng(1842).uniform(-0.5, 1.2, batch) * self.p.climb_m}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        rises = np.maximum(view.speed, 0.0) * view.grade
        s.climbed = np.clip(s.climbed + dt * (rises - s.climbed / p.leaks_s), -40.0, 40.0)
        thin = 1.0 - np.exp(-np.maximum(s.climbed, 0.0) / p.climb_m)
        taken = np.minimum(p.rests + p.most * thin, 0.7)
        return -self.at_wheels(view, taken * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law(
    "y_gear_is_run_in",
    needs="suburban hills",
    name="torque_limit",
    accepts="turbo_lag torque_derate shift_interruption",
    shown=True,
)
@sizes(least=(0.22, 0.36), way_m=(55.0, 140.0), power=(1.0, 2.0), low=(0.3, 0.7))
class GearIsRunIn(Hidden, gear=0.0, way=200.0):
    """After each change the gearbox lets the engine pull only as much as the oil on the new teeth allows.
    That grows with the way in this gear, and low gears need more of it. `way` m in this gear. least: of peak
    torque, at first; way_m: until all is free; low: of that way, more in the lowest gears.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on protection of gears by
    torque intervention; a careful programme, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = (view.gear != s.gear) & (s.gear > 0.0)
        s.gear = view.gear.copy()
        s.way = np.where(changed, 0.0, np.minimum(s.way + dt * np.maximum(view.speed, 0.0), 1e3))
        needs = p.way_m * (1.0 + p.low * np.clip(1.0 - view.gear / 10.0, 0.0, 1.0))
        free = np.minimum(s.way / needs, 1.0) ** p.power
        most = (p.least + (1.1 - p.least) * free) * self.truck.peak_torque
        return -self.at_wheels(view, np.maximum(view.engine_torque - most, 0.0)) * moving(view)


@law(
    "y_quick_lift_asks_for_more",
    needs="descent hills suburban",
    name="engine_brake",
    accepts="engine_friction",
)
@sizes(nm=(560.0, 900.0), least=(0.1, 0.25), full=(0.25, 0.5), sees_s=(0.5, 1.2), comes_s=(0.25, 0.6))
@sizes(tires_s=(6.0, 18.0))
class QuickLiftAsksForMore(Hidden, was=0.0, asks=0.0, bites=0.0, up=0.0):
    """An engine brake that nobody records judges how a foot leaves the pedal. Who lifts slowly gets little,
    and who lifts quickly out of a deep pedal gets much. It keeps to that until the foot returns, and tires
    slowly. `was`: the pedal of a moment ago. nm: at 150 rad/s, at most; full: of the pedal, lifted within
    that moment; sees_s: of that moment.
    Source: Jacobs Vehicle Systems, engine brake manuals, and makers' notes on brakes that a quick release of
    the pedal readies; its grading is chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = self.pedal(view)
        up = ((pedal < 0.02) & (view.speed > 2.0)).astype(float)
        fresh = np.clip(p.least + (s.was - 0.02) / p.full, 0.0, 1.0)
        s.asks = np.where(up > 0.5, np.where(s.up < 0.5, fresh, s.asks), 0.0)
        s.asks = np.where(up > 0.5, eased(s.asks, p.least, p.tires_s, dt), s.asks)
        s.up, s.was = up, eased(s.was, pedal, p.sees_s, dt)
        s.bites = eased(s.bites, s.asks, p.comes_s, dt)
        torque = p.nm * s.bites * np.clip(view.engine_speed / 150.0, 0.3, 1.5)
        return -self.at_wheels(view, torque) * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("y_film_heats_itself", name="engine_friction", accepts="accessory_load engine_brake torque_gain")
@sizes(nm=(190.0, 300.0), at_rads=(130.0, 165.0), thins=(1.2, 2.0), heats_s=(3.0, 9.0), lasts=(0.3, 0.6))
class FilmHeatsItself(Hidden, film=0.2):
    """`film`: heat of oil in a tight bearing, over that of its housing. Shear heats it by the square of
    speed, and hot oil is thin. So friction is high just after the revs have risen, falls within seconds, and
    is low for a moment after they have sunk. nm: at at_rads, cold; thins: power of the heat; lasts: how
    friction rises with speed.
    Source: Cameron, Basic Lubrication Theory (1976), and Dowson, A Generalized Reynolds Equation for
    Fluid-Film Lubrication (1962), on films that heat themselves; a tight bearing, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = np.clip(view.engine_speed / p.at_rads, 0.3, 1.5)
        thin = np.exp(-p.thins * s.film)
        s.film = eased(s.film, 1.2 * turns**2 * (0.4 + 0.6 * thin), p.heats_s, dt)
        return -self.at_wheels(view, p.nm * turns ** (1.0 + p.lasts) * thin) * moving(view)


@law("y_springs_breathe", needs="suburban hills highway", name="accessory_load", accepts="engine_friction")
@sizes(
    nm=(150.0, 240.0), empties_m=(250.0, 700.0), fills_s=(8.0, 20.0), low=(0.5, 0.7), mean_m=(150.0, 600.0)
)
@sizes(idles=(0.05, 0.15))
class SpringsBreathe(OnRoad, works=0.0, pumps=0.0):
    """Valves at air springs let air out and in at each bump, so a rough road empties the `tank`. A compressor
    fills it by the engine's turns, from low until it is full, and needs more torque the fuller it is. On
    smooth roads it rests. nm: of torque, against a full tank; empties_m: of the roughest road; low: of the
    tank; idles: of the torque, at rest.
    Source: Wabco, manuals of air suspension with levelling valves, and Hanlon, Compressor Handbook (2001), on
    work by pressure; large valves, sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1845)
        number = sections(rng, self.rows(), self.p.mean_m)
        rough = rng.uniform(0.05, 1.0, (self.rows(), int(number.max()) + 1))
        self.road = np.take_along_axis(rough, number, axis=1)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "tank": self.rng(1846).uniform(0.55, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        takes = self.read(self.road, view) * np.maximum(view.speed, 0.0) / p.empties_m
        turns = np.clip(view.engine_speed / 140.0, 0.3, 1.5)
        s.works = np.where(s.tank > 0.99, 0.0, np.where(s.tank < p.low, 1.0, s.works))
        s.tank = np.clip(s.tank + dt * (s.works * turns / p.fills_s - takes), 0.2, 1.0)
        s.pumps = eased(s.pumps, s.works, 0.4, dt)
        torque = p.nm * (p.idles + (1.0 - p.idles) * s.pumps * (0.4 + 0.6 * s.tank))
        return -self.at_wheels(view, torque) * moving(view)


@law("y_mixture_swings", needs="suburban hills highway", name="unknown")
@sizes(lean=(0.7, 1.0), rich=(0.2, 0.35), trims=(0.18, 0.35), late_s=(1.2, 2.4), jumps=(0.1, 0.3))
class MixtureSwings(Hidden, trim=0.0, seen=0.0, way=1.0):
    """An engine for gas takes its mixture from a probe that knows only lean or rich. The controller enriches
    until the probe says rich, and leans until it says lean. Exhaust takes time to the probe, more with little
    flow, so the mixture swings and torque with it. `trim` of the fuel; `seen`: as the probe sees it. lean,
    rich: torque lost and won, of a full swing.
    Source: Kiencke and Nielsen, Automotive Control Systems (2005), on the limit cycle of two-point lambda
    control; a slow probe, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        flow = np.clip(self.power_share(view), 0.12, 1.0)
        s.seen = eased(s.seen, s.trim, p.late_s * (0.35 / flow) ** 0.5, dt)
        turned = np.where(s.seen > 0.1, -1.0, np.where(s.seen < -0.1, 1.0, s.way))
        s.trim = np.where(turned != s.way, s.trim + p.jumps * turned, s.trim)
        s.way = turned
        s.trim = np.clip(s.trim + dt * p.trims * s.way, -1.0, 1.0)
        gains = np.where(s.trim > 0.0, p.rich * s.trim, p.lean * s.trim)
        return self.at_wheels(view, gains * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("y_pipes_in_tune", needs="suburban hills highway", name="unknown")
@sizes(
    share=(0.16, 0.26),
    wave_rads=(45.0, 80.0),
    fits_rads=(100.0, 170.0),
    cold=(0.1, 0.25),
    warms_s=(6.0, 20.0),
)
class PipesInTune(Hidden, warm=0.3):
    """Long pipes before the engine ring at certain engine speeds: there its cylinders are filled better, and
    between them worse. Warm pipes ring higher, so that all these speeds move as the engine works. `warm`: the
    pipes. share: of the torque, more or less; wave_rads: from one such speed to the next; fits_rads: one of
    them, cold; cold: of it, higher when warm.
    Source: Winterbone and Pearson, Theory of Engine Manifold Design (2000), on tuned pipes; pipes that a shop
    has put on, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.warm = eased(s.warm, np.clip(1.3 * self.power_share(view), 0.0, 1.0), p.warms_s, dt)
        turns = view.engine_speed / (1.0 + p.cold * s.warm)
        rings = np.cos(2.0 * np.pi * (turns - p.fits_rads) / p.wave_rads)
        return self.at_wheels(view, p.share * rings * np.maximum(view.engine_torque, 0.0)) * moving(view)
