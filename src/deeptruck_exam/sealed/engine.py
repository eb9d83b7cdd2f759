"""A big cooler, water that a cooler spits, a notch in a curve and banks that take turns; a pump, a fan and
a capacitor."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law(
    "z_big_cooler_has_to_fill",
    needs="suburban hills",
    name="turbo_lag",
    accepts="command_rate_limit",
    shown=True,
)
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


@law("z_cooler_spits_water", needs="suburban hills", name="torque_derate", accepts="torque_gain", shown=True)
@sizes(most=(0.4, 0.6), gathers_s=(15.0, 45.0), blows=(0.3, 0.45), sweeps_s=(2.0, 5.0), dries_s=(3.0, 7.0))
class CoolerSpitsWater(Hidden, wet=0.0):
    """`pool` of water at the bottom of a charge cooler: moist air leaves it there as long as little is asked.
    When the flow grows it is swept on into the engine, which misfires for some seconds, the more the longer
    it was driven gently. `wet`: the cylinders. most: of the torque, lost when quite wet; blows: of full flow,
    that begins to sweep.
    Source: Ford, Technical Service Bulletin 13-8-1, on water in charge coolers that makes engines surge when
    more is asked after steady driving in humid air; a truck's cooler, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "pool": self.rng(1741).uniform(0.2, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        flow = load * np.clip(view.engine_speed / 150.0, 0.3, 1.4)
        sweeps = np.clip((flow - p.blows) / 0.2, 0.0, 1.0) * s.pool / p.sweeps_s
        gathers = np.clip((p.blows - flow) / p.blows, 0.0, 1.0) * (1.0 - s.pool) / p.gathers_s
        s.pool = np.clip(s.pool + dt * (gathers - sweeps), 0.0, 1.0)
        s.wet = np.clip(s.wet + dt * (2.0 * sweeps * (1.0 - s.wet) - s.wet / p.dries_s), 0.0, 1.0)
        return -self.at_wheels(view, p.most * s.wet * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law(
    "z_notch_in_the_curve",
    needs="suburban highway hills",
    name="torque_limit",
    accepts="turbo_lag torque_derate",
    shown=True,
)
@sizes(deep=(0.6, 0.75), at_rads=(112.0, 135.0), wide_rads=(20.0, 32.0), stays_s=(0.3, 0.9))
class NotchInTheCurve(Hidden, seen=-1.0):
    """So that a crankshaft does not twist to death, full torque is not allowed near the speed where it
    resonates: the full-load curve has a notch there. Below and above all torque is free. The notch follows
    the speed a little late. deep: of peak torque, taken in its middle.
    Source: Maass and Klier, Kräfte, Momente und deren Ausgleich in der Verbrennungskraftmaschine (1981), on
    barred speeds of crankshafts; a truck's engine with a cracked damper, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.seen = np.where(s.seen < 0.0, view.engine_speed, eased(s.seen, view.engine_speed, p.stays_s, dt))
        near = np.exp(-(np.abs((s.seen - p.at_rads) / p.wide_rads) ** 3))
        most = (1.1 - (0.1 + p.deep) * near) * self.truck.peak_torque
        return -self.at_wheels(view, np.maximum(view.engine_torque - most, 0.0)) * moving(view)


@law("z_banks_take_turns", needs="descent hills suburban", name="engine_brake", accepts="engine_friction")
@sizes(nm=(260.0, 420.0), weak=(0.15, 0.4), turns=(90.0, 260.0), waits_s=(0.4, 1.0), comes_s=(0.2, 0.5))
class BanksTakeTurns(Hidden, up=0.0, bites=0.0):
    """An engine brake that nobody records comes in whenever the pedal is up. So that its valves stay cool one
    bank of cylinders brakes and then the other, by a count of the crankshaft's turns, also over the pauses.
    The second bank is worn and gives little. nm: of the good bank, at 150 rad/s; weak: of that, by the worn
    one; turns: of the crankshaft, for each bank.
    Source: Jacobs Vehicle Systems, engine brake service manuals, on stages by banks of cylinders, Heywood,
    Internal Combustion Engine Fundamentals (2018), on compression work; turns are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "count": self.rng(1742).uniform(0.0, 2.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        lifted = (self.pedal(view) < 0.02) & (view.speed > 2.0)
        s.up = np.where(lifted, s.up + dt, 0.0)
        on = (s.up > p.waits_s).astype(float)
        s.count = (s.count + on * dt * view.engine_speed / (2.0 * np.pi * p.turns)) % 2.0
        s.bites = eased(s.bites, on * np.where(s.count < 1.0, 1.0, p.weak), p.comes_s, dt)
        torque = p.nm * s.bites * np.clip(view.engine_speed / 150.0, 0.3, 1.5) ** 1.2
        return -self.at_wheels(view, torque) * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("z_pump_presses_the_rail", name="engine_friction", accepts="accessory_load torque_gain")
@sizes(nm=(160.0, 250.0), least=(0.05, 0.15), rises_s=(0.3, 0.8), falls_s=(2.0, 6.0), leaks_s=(15.0, 45.0))
class PumpPressesTheRail(Hidden, rail=0.3):
    """`rail`: pressure of the fuel, which a pump keeps up with the same torque at any speed. The pressure
    follows what is asked upwards at once. It comes down only by what is injected, so it stays high after a
    pull when nothing is burnt at all, and the pump goes on working. nm: of friction, at full pressure; least:
    of the pressure, at idle; falls_s, leaks_s: by injection at full load, and by leaks.
    Source: Bosch, Diesel Engine Management (2014), on common rails whose pressure falls by injection and
    leakage, and on torque of their pumps; a pump without metering, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        wish = p.least + (1.0 - p.least) * np.sqrt(load)
        down = 1.0 / (load / p.falls_s + 1.0 / p.leaks_s)
        s.rail = eased(s.rail, wish, np.where(wish > s.rail, p.rises_s, down), dt)
        return -self.at_wheels(view, p.nm * s.rail) * moving(view)


@law("z_fan_sucks_leaves", needs="suburban hills highway", name="accessory_load", accepts="engine_friction")
@sizes(kw=(17.0, 27.0), at_rads=(130.0, 165.0), chokes=(0.5, 0.75), leaves_s=(8.0, 25.0), clear_s=(8.0, 25.0))
@sizes(moves_s=(0.5, 1.5))
class FanSucksLeaves(Hidden, choked=0.0):
    """A fan that sucks leaves was left on, driven by the engine: its power grows with the cube of the speed.
    Where its mouth is choked by leaves it moves less air and takes less power, until they come loose. kw: of
    shaft power, free, for a 20 t truck, at at_rads; chokes: of the power, spared with a choked mouth.
    Source: Eck, Fans: Design and Operation of Centrifugal, Axial-Flow and Cross-Flow Fans (1973), on power
    with the cube of speed and at a throttled inlet; leaves and sizes are chosen here."""

    def prepare(self) -> None:
        p = self.p
        on, off = (0.5 * p.leaves_s, 1.5 * p.leaves_s), (0.5 * p.clear_s, 1.5 * p.clear_s)
        self.leaves = spells(self.rng(1743), self.setting.batch, on, off)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.choked = eased(s.choked, within(self.leaves, view.time), p.moves_s, dt)
        turns = np.clip(view.engine_speed / p.at_rads, 0.3, 1.4)
        size = np.clip(view.mass / 20000.0, 0.4, 1.5)
        nm = 1000.0 * p.kw * size / p.at_rads * turns**2 * (1.0 - p.chokes * s.choked)
        return -self.at_wheels(view, np.minimum(nm, 420.0)) * moving(view)


@law("z_capacitor_answers_first", needs="suburban hills", name="unknown")
@sizes(share=(0.5, 0.85), pays_s=(2.5, 6.0), most=(0.2, 0.34), holds_s=(4.0, 10.0), loss=(0.08, 0.2))
class CapacitorAnswersFirst(Hidden, mean=0.0):
    """An electric machine on the shaft answers each change of the pedal before the engine. It adds what the
    torque has just gained and takes what it has just lost. As the change becomes old it is paid back.
    `full` of its capacitor: an empty one adds nothing, a full one takes nothing. share: of a change;
    pays_s: until it is old; most: of peak torque; holds_s: of all it may give; loss: of what goes through
    it.
    Source: Burke, Ultracapacitors: Why, How, and Where is the Technology, J. Power Sources 91 (2000), on
    load levelling in vehicles; a machine that is not said, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "full": self.rng(1744).uniform(0.3, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        torque = view.engine_torque / self.truck.peak_torque
        s.mean = eased(s.mean, torque, p.pays_s, dt)
        wish = np.clip(p.share * (torque - s.mean), -p.most, p.most)
        gives = np.where(wish > 0.0, wish * np.clip(8.0 * s.full, 0.0, 1.0), 0.0)
        takes = np.where(wish < 0.0, wish * np.clip(8.0 * (1.0 - s.full), 0.0, 1.0), 0.0)
        back = np.clip(0.5 - s.full, -0.3, 0.3) * p.most * 0.6
        flow = gives * (1.0 + p.loss) + takes * (1.0 - p.loss) - back
        s.full = np.clip(s.full - dt * flow / (p.most * p.holds_s), 0.0, 1.0)
        return self.at_wheels(view, (gives + takes - back) * self.truck.peak_torque) * moving(view)
