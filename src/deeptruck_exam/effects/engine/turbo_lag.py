"""Torque that waits for air."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="turbo_lag", accepts="command_rate_limit", shown=True)


@law("turbo_lag", "first", "suburban hills")
@sizes(shaft_s=(1.5, 4.0), unboosted=(0.18, 0.32))
class TurboShaft(Hidden, shaft=0.2):
    """Source: Eriksson and Nielsen, Modeling and Control of Engines and Drivelines (2014), ch. 8: shaft
    energy from exhaust power against compressor power; the smoke limiter holds the torque to the air that is
    there."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = self.truck.peak_torque
        cap = full * (p.unboosted + (1.0 - p.unboosted) * np.minimum(s.shaft, 1.0) ** 1.5)
        delivered = np.minimum(view.engine_torque, cap)
        exhaust = np.clip(delivered / full, 0.03, 1.0) * np.clip(view.engine_speed / 140.0, 0.3, 1.6)
        s.shaft += dt * (1.1 * exhaust - s.shaft**1.5) / p.shaft_s
        s.shaft = np.maximum(s.shaft, 0.05)
        return self.at_wheels(view, delivered - view.engine_torque)


@law("boost_feeds_itself", "second", "suburban hills")
@sizes(growth=(0.9, 2.0), without=(0.2, 0.35), falls_s=(0.4, 1.2))
class BoostFeedsItself(Hidden, boost=0.1):
    """growth: 1/s at 1200 rpm; nothing for a second, then all at once.
    Source: Watson and Janota, Turbocharging the Internal Combustion Engine (1982): boost raises the exhaust
    that raises boost, so that it grows as a logistic curve, faster at high engine speed; the collapse at
    closed throttle and the rates are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = self.truck.peak_torque
        asked = np.clip((view.engine_torque / full - p.without) / (1.0 - p.without), 0.03, 1.0)
        rate = p.growth * np.clip(view.engine_speed / 125.7, 0.4, 1.8) ** 1.5
        rising = rate * s.boost * (1.0 - s.boost / asked)
        falling = (asked - s.boost) / p.falls_s
        s.boost = np.clip(s.boost + dt * np.where(asked > s.boost, rising, falling), 0.03, 1.0)
        most = full * (p.without + (1.0 - p.without) * s.boost)
        return self.at_wheels(view, np.minimum(most - view.engine_torque, 0.0))


@law("two_lags_by_cycles", "third", "suburban hills")
@sizes(rotor_s=(1.0, 2.4), without=(0.15, 0.32), falls=(1.5, 4.0))
class TwoLagsByCycles(Hidden, rotor=0.15, receiver=0.15):
    """falls: rotor_s at 1200 rpm.
    Source: Guzzella and Onder, Introduction to Modeling and Control of Internal Combustion Engine Systems
    (2010): rotor and intake receiver as two lags in a row that count engine cycles, and a smoke limit; the
    collapse in gear changes is chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = self.truck.peak_torque
        asked = np.clip(view.engine_torque / full, 0.05, 1.05) * (1.0 - view.shifting)
        rate = np.clip(view.engine_speed / 125.7, 0.4, 2.0) / p.rotor_s
        s.rotor += dt * rate * np.where(asked < s.rotor, p.falls, 1.0) * (asked - s.rotor)
        s.receiver += dt * 3.0 * rate * (s.rotor - s.receiver)
        most = full * (p.without + (1.0 - p.without) * s.receiver)
        return self.at_wheels(view, np.minimum(most - view.engine_torque, 0.0))


@law("manifold_goes_cold", "fifth", "suburban hills")
@sizes(spools_s=(1.2, 2.8), colder=(1.0, 3.0), cools_s=(6.0, 18.0), without=(0.18, 0.32))
class ManifoldGoesCold(Hidden, boost=0.2, hot=0.5):
    """The same tip-in is slower after a hill than after a gear change. spools_s: at 125 rad/s with a hot
    manifold; colder: times longer with a cold one.
    Source: Rakopoulos and Giakoumis, Diesel Engine Transient Operation (2009): the exhaust manifold takes the
    heat the turbine needs, the more the longer the engine has coasted; fuel is held to the air by a smoke
    limit; boost rises with the square of engine speed; times are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        allowed = p.without + (1.0 - p.without) * s.boost**0.8
        burnt = np.minimum(asked, allowed)
        s.hot += dt * (np.sqrt(burnt) - s.hot) / np.where(burnt > s.hot, 0.5 * p.cools_s, p.cools_s)
        s.hot = np.clip(s.hot, 0.0, 1.0)
        turns = np.clip(view.engine_speed / 125.0, 0.5, 1.7)
        slow = p.spools_s / turns**2 * (1.0 + p.colder * (1.0 - s.hot))
        wanted = np.clip((asked - p.without) / (1.0 - p.without), 0.0, 1.1) ** 1.25
        s.boost = np.clip(s.boost + dt * (wanted - s.boost) / np.where(wanted > s.boost, slow, 1.2), 0.0, 1.2)
        return -self.at_wheels(view, np.maximum(asked - allowed, 0.0) * self.truck.peak_torque) * moving(view)


@law("rotor_has_energy", "seventh", "suburban hills")
@sizes(spools_s=(2.0, 4.5), without=(0.08, 0.18), charges_s=(0.6, 1.6), idles=(0.005, 0.03))
class RotorHasEnergy(Hidden, energy=0.1, charge=0.1):
    """After a short lift full torque is back as soon as the pipes are full; after a long one it is not.
    Source: European load response test (directive 1999/96/EC) and Watson and Janota, Turbocharging the
    Internal Combustion Engine (1982): the turbine's power goes into the rotor's energy, the compressor takes
    a power of it with the speed cubed, and a blow-off dumps the charge, not the rotor's energy, when the
    pedal closes."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        turns = np.clip(view.engine_speed / 140.0, 0.4, 1.6)
        have = p.without + (1.0 - p.without) * s.charge
        exhaust = p.idles + np.minimum(asked, have) * turns
        s.energy = np.clip(s.energy + dt * (exhaust - s.energy**1.5) / p.spools_s, 0.0, 1.5)
        dumped = asked < 0.02
        wanted = np.where(dumped, 0.0, np.minimum(s.energy, 1.0))
        s.charge += dt * (wanted - s.charge) / np.where(dumped, 0.25, p.charges_s)
        missing = np.maximum(asked - have, 0.0)
        return -self.at_wheels(view, missing * self.truck.peak_torque) * moving(view)


@law("s_second_stage_waits", "eighth", "suburban hills")
@sizes(without=(0.15, 0.3), small_s=(0.6, 1.4), large_s=(2.5, 6.0), small=(0.25, 0.45))
class SecondStageWaits(Hidden, low=0.2, high=0.0):
    """small: share of full boost that the first stage can give. The second waits for the first.
    Source: Regulated two-stage turbocharging (Galindo, Serrano, Climent and Varnier, Energy Conversion and
    Management 51, 2010): a small and a large machine in a row; times are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        wanted = np.clip((asked - p.without) / (1.0 - p.without), 0.0, 1.1)
        flow = np.clip(view.engine_speed / 130.0, 0.5, 1.6)
        first = np.minimum(wanted, p.small)
        s.low = s.low + dt * (first - s.low) * flow / np.where(first > s.low, p.small_s, 0.8)
        second = np.maximum(wanted - p.small, 0.0) * np.clip(s.low / p.small, 0.0, 1.0) ** 3
        s.high = s.high + dt * (second - s.high) * flow / np.where(second > s.high, p.large_s, 0.6)
        missing = np.maximum(asked - p.without - (1.0 - p.without) * (s.low + s.high), 0.0)
        return -self.at_wheels(view, missing * self.truck.peak_torque) * moving(view)


@law("t_assist_runs_flat", "tenth", "suburban hills")
@sizes(without=(0.08, 0.2), alone_s=(3.0, 7.0), uses_s=(0.12, 0.5), charges_s=(40.0, 120.0))
class AssistRunsFlat(Hidden, spool=0.0):
    """`store`: of the capacitors. As quick as it should be until they are empty. uses_s: of full assistance.
    Source: Katrasnik, Rodman, Trenc, Hribernik and Medica, Improvement of the Dynamic Characteristic of an
    Automotive Engine by a Turbocharger Assisted by an Electric Motor, J. Eng. Gas Turbines Power 125 (2003);
    a store that is small and old, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "store": self.rng(981).uniform(0.0, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        wanted = np.clip((asked - p.without) / (1.0 - p.without), 0.0, 1.1)
        behind = wanted - s.spool
        helps = np.clip(s.store / 0.25, 0.0, 1.0)
        flow = np.clip(view.engine_speed / 130.0, 0.5, 1.6)
        up = behind * (helps / 0.25 + (1.0 - helps) * flow / p.alone_s)
        s.spool = s.spool + dt * np.where(behind > 0.0, up, behind / 0.7)
        used = helps * np.maximum(behind, 0.0) / p.uses_s
        s.store = np.clip(s.store + dt * (1.0 / p.charges_s - used), 0.0, 1.0)
        missing = np.maximum(asked - p.without - (1.0 - p.without) * s.spool, 0.0)
        return -self.at_wheels(view, missing * self.truck.peak_torque) * moving(view)


@law("e_turbo_in_cold_oil", "eleventh", "suburban hills")
@sizes(without=(0.15, 0.3), spools_s=(0.8, 1.6), stiff=(1.5, 4.0), warms_s=(60.0, 200.0), drags=(0.3, 0.7))
class TurboInColdOil(Hidden, spins=0.0):
    """`spins`: speed of the rotor, 1 at peak power; its square is the torque it allows. Oil in its bearings
    slows it, the more the colder. without: of peak torque, with none; stiff: times the warm oil, at first;
    drags: of the drive, warm.
    Source: Serrano, Olmeda, Tiseira, García-Cuevas and Lefebvre, Theoretical and Experimental Study of
    Mechanical Losses in Automotive Turbochargers, Energy 55 (2013); sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "cold": self.rng(1041).uniform(0.2, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        s.cold = s.cold - dt * s.cold * (0.4 + self.power_share(view)) / p.warms_s
        flow = np.clip(view.engine_speed / 150.0, 0.4, 1.4)
        boost = np.clip((asked - p.without) / (1.0 - p.without), 0.0, 1.1)
        goal = np.sqrt(boost)
        thick = 1.0 + p.drags * p.stiff * s.cold
        up = flow * (0.25 + goal) / (p.spools_s * thick)
        s.spins = s.spins + dt * np.where(goal > s.spins, up * np.minimum((goal - s.spins) / 0.15, 1.0), 0.0)
        s.spins = s.spins + dt * np.minimum(goal - s.spins, 0.0) * thick / (2.5 * p.spools_s)
        missing = np.maximum(asked - p.without - (1.0 - p.without) * s.spins**2, 0.0) * (asked > p.without)
        return -self.at_wheels(view, missing * self.truck.peak_torque) * moving(view)


@law("k_compressor_stalls", "fourteenth", "suburban hills")
@sizes(spools_s=(1.4, 2.8), least=(0.08, 0.16), stands=(0.25, 0.4), free_rads=(150.0, 180.0))
@sizes(falls_s=(0.25, 0.5))
class CompressorStalls(Hidden, boost=0.0, stalled=0.0):
    """`boost` over the most. An engine that turns slowly takes less air than a compressor needs for much
    boost: there the flow breaks down, boost falls to nothing and has to be built up again, time after time,
    until the engine turns faster. least: of peak torque, without boost; stands: boost that an idling engine
    bears; free_rads: from where on it bears all.
    Source: Greitzer, Surge and Rotating Stall in Axial Flow Compressors, J. Engineering for Power 98 (1976),
    on cycles of surge; a worn turbocharger, slower, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        free = np.clip((view.engine_speed - 70.0) / (p.free_rads - 70.0), 0.0, 1.0)
        bears = p.stands + (1.2 - p.stands) * free
        s.stalled = np.where(s.boost > bears, 1.0, np.where(s.boost < 0.4 * bears, 0.0, s.stalled))
        spools = p.spools_s * np.clip(130.0 / np.maximum(view.engine_speed, 60.0), 0.6, 1.8)
        slow = np.where(s.stalled > 0.5, p.falls_s, np.where(asked > s.boost, spools, 0.9))
        s.boost = eased(s.boost, asked * (1.0 - s.stalled), slow, dt)
        most = p.least + (1.12 - p.least) * np.minimum(1.05 * s.boost, 1.0)
        lacks = np.maximum(asked - most, 0.0) * self.truck.peak_torque
        return -self.at_wheels(view, lacks) * moving(view)


@law("z_big_cooler_has_to_fill", "seventeenth", "suburban hills")
@sizes(spins_s=(0.8, 1.6), fills_s=(0.9, 1.8), draws=(0.5, 0.9), at_rads=(125.0, 160.0), least=(0.2, 0.35))
class BigCoolerHasToFill(Hidden, spin=0.3, air=0.3):
    """`spin` of the turbine, `air` pressed into a cooler that was meant for a larger engine. The turbine
    fills it while the engine draws from it, the more the faster it turns. So a change down lets the
    pressure sink before the turbine can answer. draws: of the filling, at at_rads; least: of peak torque,
    without pressed air.
    Source: Eriksson, Modeling and Control of Turbocharged SI and DI Engines, Oil and Gas Science and
    Technology 62 (2007), on volumes between compressor and engine; a large one, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        flow = np.clip(view.engine_speed / p.at_rads, 0.4, 1.5)
        burns = np.minimum(asked, p.least + (1.1 - p.least) * s.air)
        s.spin = eased(s.spin, np.minimum(burns * np.sqrt(flow) * 1.15, 1.2), p.spins_s / flow, dt)
        gives = s.spin * (1.0 + p.draws) - p.draws * flow * s.air - s.air
        s.air = np.clip(s.air + dt * gives / p.fills_s, 0.0, 1.1)
        most = p.least + (1.1 - p.least) * np.minimum(1.15 * s.air, 1.0)
        return -self.at_wheels(view, np.maximum(asked - most, 0.0) * self.truck.peak_torque) * moving(view)


@law("y_hose_blows_up", "eighteenth", "suburban hills")
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


@law("h_coupling_fills_first", "nineteenth", "suburban hills")
@sizes(least=(0.24, 0.38), fills_s=(0.6, 1.3), drains_s=(1.5, 4.0), spins_s=(0.5, 1.0), slow_s=(1.0, 2.5))
class CouplingFillsFirst(Hidden, oil=0.2, spin=0.2):
    """A blower presses the air, and the crankshaft drives it through a coupling that is filled with oil when
    much is asked. `oil` in it, by a pump on the engine, so that it fills slowly at low speed; it drains when
    little is asked. `spin` of the blower, which a full coupling takes along soon and an empty one never.
    least: of peak torque, without a blower; slow_s: until its spin is lost.
    Source: Föttinger couplings in Voith, Hydrodynamics in Power Transmission, on torque by filling, and
    Watson and Janota, Turbocharging the Internal Combustion Engine (1982), on blowers; sizes are chosen
    here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        wish = np.clip((asked - p.least) / (1.0 - p.least) * 1.1, 0.0, 1.1)
        turns = np.clip(view.engine_speed / 140.0, 0.5, 1.5)
        s.oil = eased(s.oil, wish, np.where(wish > s.oil, p.fills_s / turns**1.5, p.drains_s), dt)
        takes = p.spins_s / np.maximum(s.oil, 0.15)
        s.spin = eased(s.spin, s.oil, np.where(s.oil > s.spin, takes, p.slow_s), dt)
        most = p.least + (1.0 - p.least) * s.spin
        return -self.at_wheels(view, np.maximum(asked - most, 0.0) * self.truck.peak_torque) * moving(view)


@law("h_turbine_sits_far_behind", "nineteenth", "suburban hills")
@sizes(
    least=(0.24, 0.38), fills_s=(0.35, 0.7), chills=(0.25, 0.5), warms_s=(10.0, 30.0), empties_s=(0.3, 0.7)
)
class TurbineSitsFarBehind(Hidden):
    """For want of room the turbine sits far behind the engine, at the end of long pipes. Each piece of pipe
    has to be filled by the one before it: at first nothing happens, then all at once. `pipes` (3, batch): gas
    in them, faster the more the engine works. `warm` pipes keep the gas hot, cold ones take of its work.
    least: of peak torque, without pressed air; fills_s: of one piece; chills: of the air, with cold pipes.
    Source: Watson and Janota, Turbocharging the Internal Combustion Engine (1982), on pipes before turbines,
    and makers' notes on turbines mounted at the rear; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"pipes": np.full((3, batch), 0.2), "warm": self.rng(1948).uniform(0.1, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        wish = np.clip((asked - p.least) / (1.0 - p.least) * 1.1, 0.0, 1.1)
        flow = np.clip(view.engine_speed / 140.0 * (0.4 + asked), 0.3, 1.6)
        s.warm = eased(s.warm, np.clip(1.4 * self.power_share(view), 0.0, 1.0), p.warms_s, dt)
        before = np.concatenate([wish[None], s.pipes[:-1]])
        s.pipes = eased(s.pipes, before, np.where(before > s.pipes, p.fills_s / flow, p.empties_s / 3.0), dt)
        air = s.pipes[-1] * (1.0 - p.chills * (1.0 - s.warm))
        most = p.least + (1.0 - p.least) * air
        return -self.at_wheels(view, np.maximum(asked - most, 0.0) * self.truck.peak_torque) * moving(view)
