"""Late flaps, soot, a spared flywheel, brake oil, an oil cooler by turns, a leak, and a monitor."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("q_flap_opens_late", needs="suburban hills", name="turbo_lag", accepts="command_rate_limit", shown=True)
@sizes(sticks_s=(1.2, 2.6), opens_s=(1.4, 3.2), spools_s=(0.6, 1.3), least=(0.06, 0.15), cakes_s=(6.0, 20.0))
class FlapOpensLate(Hidden, flap=1.0, boost=0.3, sticks=0.0, cakes=0.0):
    """`flap` in the exhaust, 1 open, which shuts while the pedal is up. Soot cakes it the longer it is shut;
    then it sticks for a while when it is to open, and the turbine gets no gas until it does. sticks_s: caked;
    least: of peak torque, without boost.
    Source: Heywood, Internal Combustion Engine Fundamentals (2018), on boost from the exhaust, and makers'
    service manuals on exhaust flaps that stick with soot; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        up = self.pedal(view) < 0.03
        s.cakes = eased(s.cakes, np.where(up, 1.0, 0.0), np.where(up, p.cakes_s, p.sticks_s + p.opens_s), dt)
        s.sticks = np.where(up, p.sticks_s * (0.3 + 0.7 * s.cakes), np.maximum(s.sticks - dt, 0.0))
        wish = np.where(up | (s.sticks > 0.0), 0.0, 1.0)
        s.flap = np.clip(s.flap + dt * np.where(wish > 0.5, 1.0 / p.opens_s, -1.0 / 0.4), 0.0, 1.0)
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        spools = np.where(asked > s.boost, p.spools_s / (0.1 + 0.9 * s.flap), 0.8)
        s.boost = eased(s.boost, asked, spools, dt)
        most = p.least + (1.12 - p.least) * np.minimum(1.2 * s.boost, 1.0) * (0.15 + 0.85 * s.flap)
        lacks = np.maximum(asked - most, 0.0) * self.truck.peak_torque
        return -self.at_wheels(view, lacks) * moving(view)


@law("q_soot_chokes_it", needs="suburban hills", name="torque_derate", accepts="torque_gain", shown=True)
@sizes(
    most=(0.24, 0.4), fills_s=(50.0, 140.0), burns_s=(25.0, 70.0), warms_s=(15.0, 45.0), lights=(0.5, 0.65)
)
class SootChokesIt(Hidden):
    """`soot` in a filter, 1 where the engine is protected by less torque; `hot`: the filter. Gentle driving
    fills it, and only a hot filter burns it free again, which takes long pulls. most: of the torque, taken
    where much gas has to pass; lights: of the heat at full power, where soot burns.
    Source: Johnson, Diesel Emissions in Review, SAE 2011-01-0304, and Heywood, Internal Combustion Engine
    Fundamentals (2018), on filters that burn themselves free and on back pressure; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(1541)
        return {"soot": rng.uniform(0.4, 1.0, batch), "hot": rng.uniform(0.2, 0.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        power = np.clip(self.power_share(view), 0.0, 1.0)
        s.hot = eased(s.hot, np.sqrt(power), p.warms_s, dt)
        burns = np.clip((s.hot - p.lights) / 0.15, 0.0, 1.0) / p.burns_s
        s.soot = np.clip(s.soot + dt * ((0.3 + 0.7 * power) / p.fills_s - burns * s.soot), 0.0, 1.2)
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.0)
        gas = np.clip(view.engine_speed / 140.0, 0.3, 1.4) * (0.3 + 0.7 * load)
        cut = np.minimum(p.most * np.clip((s.soot - 0.4) / 0.6, 0.0, 1.2) * gas, 0.8)
        return -self.at_wheels(view, cut * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("q_spares_its_flywheel", needs="suburban hills", name="torque_limit", accepts="turbo_lag", shown=True)
@sizes(
    least=(0.24, 0.36),
    low_rads=(102.0, 116.0),
    wide_rads=(50.0, 75.0),
    tightens=(0.2, 0.4),
    tires_s=(2.0, 8.0),
)
class SparesItsFlywheel(Hidden, lugs=0.0):
    """A two-mass flywheel resonates below idling, so torque is held down where the engine turns slowly, and
    further down the longer it lugs. A lower gear helps at once. least: of peak torque, at low_rads; tightens:
    of the limit, after long lugging.
    Source: Reik, The Dual Mass Flywheel, LuK Symposium (1998), on resonance at low speeds and on torque that
    is limited there; a stern limit, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        free = np.clip((view.engine_speed - p.low_rads) / p.wide_rads, 0.0, 1.0)
        most = p.least + (1.15 - p.least) * free**1.5
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.2)
        s.lugs = eased(s.lugs, np.where(asked > 0.8 * most, 1.0, 0.0), p.tires_s, dt)
        most = most * (1.0 - p.tightens * s.lugs * (1.0 - free))
        excess = np.maximum(asked - most, 0.0) * self.truck.peak_torque
        return -self.at_wheels(view, excess) * moving(view)


@law(
    "q_brake_oil_drains_late", needs="descent hills suburban", name="engine_brake", accepts="engine_friction"
)
@sizes(nm=(240.0, 430.0), fills_s=(0.2, 0.5), drains_s=(0.6, 1.4), cold=(1.0, 2.5), warms_s=(80.0, 240.0))
class BrakeOilDrainsLate(Hidden, oil=0.0, warm=0.0):
    """`oil` in the housings of a compression brake that comes in whenever the pedal is up. When the driver
    pulls again it has to drain first, and some cylinders brake on for a moment, longer while it is cold. nm:
    at 190 rad/s; cold: of drains_s, more.
    Source: Jacobs Vehicle Systems, engine brake service manuals, on solenoids that let oil in and out and on
    slow release with cold oil; a worn valve, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.warm = eased(s.warm, 1.0, p.warms_s / (0.3 + np.clip(self.power_share(view), 0.0, 1.0)), dt)
        on = (self.pedal(view) < 0.02) & (view.engine_speed > 85.0) & (view.speed > 3.0)
        drains = p.drains_s * (1.0 + p.cold * (1.0 - s.warm))
        s.oil = eased(s.oil, np.where(on, 1.0, 0.0), np.where(on, p.fills_s, drains), dt)
        torque = p.nm * s.oil * np.clip(view.engine_speed / 190.0, 0.2, 1.3) ** 1.4
        return -self.at_wheels(view, torque) * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("q_oil_cooler_by_turns", name="engine_friction", accepts="accessory_load torque_gain")
@sizes(
    nm=(50.0, 90.0),
    thick=(1.0, 1.8),
    warms_s=(12.0, 30.0),
    opens=(0.95, 1.1),
    shuts=(0.5, 0.65),
    bites=(0.9, 1.6),
)
class OilCoolerByTurns(Hidden, open=0.0, lets=0.0):
    """`warm`: the oil, whose cooler is opened by a thermostat that sticks: late, and then cold oil comes in a
    slug, until it shuts late again. So friction rises and falls by itself, faster under load. nm: of drag at
    150 rad/s with oil at 1; thick: more with each 1 it is colder; opens, shuts: of the oil's heat.
    Source: Heywood, Internal Combustion Engine Fundamentals (2018), on friction of bearings with viscosity
    of oil; a thermostat with a wide hysteresis, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "warm": self.rng(1542).uniform(0.3, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gains = 0.5 + 1.2 * np.clip(self.power_share(view), 0.0, 1.0)
        flow = np.clip(view.engine_speed / 130.0, 0.5, 1.4)
        s.open = np.where(s.warm > p.opens, 1.0, np.where(s.warm < p.shuts, 0.0, s.open))
        s.lets = eased(s.lets, s.open, 2.5, dt)
        cools = 0.15 + p.bites * s.lets * flow
        s.warm = np.clip(eased(s.warm, gains / cools, p.warms_s / cools, dt), 0.0, 1.4)
        torque = (
            p.nm * np.exp(p.thick * (1.0 - s.warm)) * np.sqrt(np.clip(view.engine_speed / 150.0, 0.2, 1.5))
        )
        return -self.at_wheels(view, torque) * moving(view)


@law(
    "q_leak_keeps_it_pumping",
    needs="suburban hills highway",
    name="accessory_load",
    accepts="engine_friction",
)
@sizes(kw=(16.0, 28.0), leaks_s=(15.0, 45.0), fills_s=(10.0, 25.0), draws=(0.5, 1.2), loads_s=(0.3, 0.8))
class LeakKeepsItPumping(Hidden, works=0.0, load=0.0):
    """`air` in the tanks of a leaking train, 0 where the governor lets the compressor pump and 1 where it
    idles again. It pumps time after time, sooner after braking and for longer when the engine turns slowly,
    and against more and more pressure. kw: of its shaft, for a 20 t truck; draws: of the air, by a second of
    full braking.
    Source: Bendix, Tu-Flo compressor service data sheets and air brake handbook, on governors, leakage and
    duty cycles; a large compressor, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "air": self.rng(1543).uniform(0.1, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pumps = s.load * np.clip(view.engine_speed / 120.0, 0.4, 1.5) / p.fills_s
        braking = p.draws * view.brake_force / self.truck.brake_capacity
        s.air = np.clip(s.air + dt * (pumps - 1.0 / p.leaks_s * (1.0 - s.works) - 0.3 * braking), -0.5, 1.0)
        s.works = np.where(s.air <= 0.0, 1.0, np.where(s.air > 0.99, 0.0, s.works))
        s.load = eased(s.load, s.works, p.loads_s, dt)
        size = np.clip(view.mass / 20000.0, 0.4, 1.5)
        watts = 1000.0 * p.kw * size * s.load * (0.75 + 0.25 * s.air)
        torque = np.minimum(watts / np.maximum(view.engine_speed, 70.0), 280.0)
        return -self.at_wheels(view, torque) * moving(view)


@law("q_burns_soot_on_the_way", needs="hills descent suburban", name="unknown")
@sizes(takes=(0.08, 0.14), keeps=(0.7, 1.0), burns_s=(40.0, 100.0), rests_s=(30.0, 90.0), eases_s=(0.8, 2.0))
@sizes(gives_up_s=(4.0, 12.0))
class BurnsSootOnTheWay(Hidden, acts=0.0, still=0.0, given_up=0.0):
    """While soot in the filter is burnt off on the way, air is throttled and fuel is injected late, also
    when the pedal is up. So the engine pulls less and holds back less. A long stand ends it until the next
    time. takes: of the torque; keeps: of the engine's drag, made up for.
    Source: Salvat, Marez and Belot, Passenger Car Serial Application of a Particulate Filter System on a
    Common Rail Direct Injection Diesel Engine, SAE 2000-01-0473, on post-injection during regeneration; a
    truck's, times are chosen here."""

    def prepare(self) -> None:
        on, off = (0.6 * self.p.burns_s, 1.4 * self.p.burns_s), (0.6 * self.p.rests_s, 1.4 * self.p.rests_s)
        self.burns = spells(self.rng(1544), self.setting.batch, on, off)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        burns = within(self.burns, view.time)
        s.still = np.where(view.speed < 0.3, s.still + dt, 0.0)
        s.given_up = np.where(burns < 0.5, 0.0, np.where(s.still > p.gives_up_s, 1.0, s.given_up))
        s.acts = eased(s.acts, burns * (1.0 - s.given_up), p.eases_s, dt)
        pulls, holds = np.maximum(view.engine_torque, 0.0), np.maximum(-view.engine_torque, 0.0)
        torque = s.acts * (p.keeps * holds - p.takes * pulls)
        return self.at_wheels(view, torque) * np.clip(view.speed - 1.0, 0.0, 1.0)


@law("q_monitor_shuts_the_fuel", needs="suburban hills", name="unknown")
@sizes(falls=(0.07, 0.14), looks_s=(0.5, 1.0), cuts_s=(1.2, 2.8), back_s=(0.8, 2.0), waits_s=(2.0, 6.0))
class MonitorShutsTheFuel(Hidden, seen=0.0, left=0.0, rests=0.0, lets=1.0):
    """A second computer reckons what torque the pedal allows. Fuel that follows a pedal on its way up a
    moment late looks like too much to it once the pedal eases. It shuts the fuel off, and lets it back by a
    ramp. falls: of the full pedal, that it eases within looks_s; waits_s: until it can trip again.
    Source: EGAS Workgroup, Standardized E-Gas Monitoring Concept for Gasoline and Diesel Engine Control Units
    (2013), on torque monitoring and fuel cut-off; one that is set too sharp, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = self.pedal(view)
        s.seen = eased(s.seen, pedal, p.looks_s, dt)
        trips = (s.seen - pedal > p.falls) & (pedal > 0.04) & (s.rests <= 0.0)
        s.left = np.where(trips, p.cuts_s, np.maximum(s.left - dt, 0.0))
        s.rests = np.where(trips, p.cuts_s + p.waits_s, np.maximum(s.rests - dt, 0.0))
        s.lets = np.clip(s.lets + dt * np.where(s.left > 0.0, -1.0 / 0.15, 1.0 / p.back_s), 0.0, 1.0)
        return -self.at_wheels(view, (1.0 - s.lets) * np.maximum(view.engine_torque, 0.0)) * moving(view)
