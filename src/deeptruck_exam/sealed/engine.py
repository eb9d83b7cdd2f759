"""Vanes that choke first, a weak battery, torque for hills, a slug of oil, an iced breather, a sieve, and
teeth that are lost."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law(
    "v_vanes_choke_first", needs="suburban hills", name="turbo_lag", accepts="command_rate_limit", shown=True
)
@sizes(chokes=(0.1, 0.2), slow_s=(1.2, 2.4), flow_rads=(110.0, 150.0), shuts_s=(0.1, 0.3), opens_s=(0.8, 2.0))
@sizes(least=(0.12, 0.25))
class VanesChokeFirst(Hidden, boost=0.4, vanes=0.0):
    """`vanes` of the turbine, 1 shut. When more is asked than there is air for they shut to spin it up, and
    at first the engine has to press its gas against them: torque falls before it rises. They open again
    slowly, so a second pedal soon after the first finds them half shut. chokes: of peak torque, at
    flow_rads; slow_s: of `boost`, at flow_rads with open vanes; least: of peak torque, without boost.
    Source: Wahlström and Eriksson, Modelling Diesel Engines with a Variable-Geometry Turbocharger and Exhaust
    Gas Recirculation, J. Automobile Engineering 225 (2011), on responses that begin the wrong way; sizes are
    chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        wish = np.clip((asked - s.boost) / 0.15, 0.0, 1.0)
        s.vanes = eased(s.vanes, wish, np.where(wish > s.vanes, p.shuts_s, p.opens_s), dt)
        flow = np.clip(view.engine_speed / p.flow_rads, 0.4, 1.6)
        spools = p.slow_s / (flow * (0.35 + 0.65 * s.vanes))
        s.boost = eased(s.boost, asked, np.where(asked > s.boost, spools, 1.2), dt)
        most = p.least + (1.1 - p.least) * np.minimum(1.1 * s.boost, 1.0)
        lacks = np.maximum(asked - most, 0.0) + p.chokes * flow * s.vanes * np.minimum(asked, 0.5) * 2.0
        return -self.at_wheels(view, np.minimum(lacks, asked) * self.truck.peak_torque) * moving(view)


@law("v_battery_is_weak", needs="suburban hills", name="torque_derate", accepts="torque_gain", shown=True)
@sizes(
    most=(0.2, 0.34), cut_in_rads=(95.0, 115.0), holds_s=(5.0, 14.0), draws_s=(5.0, 14.0), lamps=(0.5, 0.8)
)
class BatteryIsWeak(Hidden):
    """`charge` of a worn battery, 1 full. Its generator gives little below cut_in_rads while lamps, heaters
    and blowers go on and off; then voltage sags, the injectors open late, and fuel is lost as by the square
    of what is missing. most: of the torque, lost with an empty one; holds_s: to fill; draws_s: to empty, with
    all that draws; lamps: of the rated current, on in the mean.
    Source: Bosch Automotive Handbook (2014), on generators' current with speed, on charge balance and on
    correction of injection times for voltage; a worn battery, sizes are chosen here."""

    def prepare(self) -> None:
        self.draws = spells(self.rng(1641), self.setting.batch, (10.0, 40.0), (8.0, 30.0))

    def start(self, batch: int) -> dict[str, Array]:
        return {"charge": self.rng(1642).uniform(0.2, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gives = np.clip((view.engine_speed - p.cut_in_rads) / 60.0, 0.0, 1.2)
        takes = p.lamps * (0.5 + 0.8 * within(self.draws, view.time))
        flow = np.where(gives > takes, (gives - takes) / p.holds_s, (gives - takes) / p.draws_s)
        s.charge = np.clip(s.charge + dt * flow, 0.0, 1.0)
        sags = np.clip((0.85 - s.charge) / 0.85, 0.0, 1.0)
        lost = p.most * (1.0 - (1.0 - sags) ** 2)
        return -self.at_wheels(view, lost * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law(
    "v_full_torque_uphill_only",
    needs="suburban highway hills",
    name="torque_limit",
    accepts="turbo_lag",
    shown=True,
)
@sizes(flat=(0.34, 0.48), at=(0.012, 0.024), wide=(0.004, 0.009), feels_s=(1.5, 4.0), weighs=(0.1, 0.25))
class FullTorqueUphillOnly(Hidden, slope=-9.0):
    """A programme that saves fuel: on the flat the engine may give part of its torque, and all of it only on
    a slope, which it feels some seconds late. It takes the truck's own pull for part of a slope. flat: of
    peak torque; at, wide: slope where half of the rest is free, and how softly; weighs: of the acceleration
    over g, taken for slope.
    Source: Volvo Trucks, I-Torque and I-See, and Scania, Eco mode, on torque that is set free by slope and
    load; a stern one, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        seems = view.grade + p.weighs * np.clip(view.acceleration, -2.0, 2.0) / 9.81
        s.slope = np.where(s.slope < -5.0, seems, eased(s.slope, seems, p.feels_s, dt))
        free = 1.0 / (1.0 + np.exp(-np.clip((s.slope - p.at) / p.wide, -30.0, 30.0)))
        most = (p.flat + (1.2 - p.flat) * free) * self.truck.peak_torque
        excess = np.maximum(view.engine_torque - most, 0.0)
        return -self.at_wheels(view, excess) * moving(view)


@law("v_slug_of_oil", needs="descent hills suburban", name="engine_brake", accepts="engine_friction")
@sizes(holds=(0.011, 0.019), over=(0.8, 1.6), settles_s=(1.0, 2.5), waits_s=(0.4, 1.2), knee_mps=(6.0, 10.0))
@sizes(refills_s=(8.0, 25.0))
class SlugOfOil(Hidden, up=0.0, oil=0.0, kept=1.0):
    """`oil` in a retarder behind the gearbox that somebody left on: it comes in whenever the pedal is up. Air
    shoots the oil of its `kept` store in as one slug, too much at first; what is too much runs off. The
    store fills slowly again, so soon after the last time it only creeps in. holds: of the weight, settled;
    over: of that, in the slug of a full store; knee_mps: above which it is the same at any speed.
    Source: Voith, Retarder VR 115 and VR 3250, on oil that air pressure moves and on accumulators that
    hasten it; one that overshoots, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        lifted = (self.pedal(view) < 0.02) & (view.speed > 2.0)
        s.up = np.where(lifted, s.up + dt, 0.0)
        on = s.up > p.waits_s
        shoots = np.where(on, s.kept, 0.0) / 0.4
        settles = np.where(on, 1.0 - s.oil, -s.oil) / np.where(on, p.settles_s, 0.5)
        s.oil = np.clip(s.oil + dt * (p.over * shoots + settles), 0.0, 1.0 + p.over)
        s.kept = np.clip(s.kept + dt * np.where(on, -shoots, (1.0 - s.kept) / p.refills_s), 0.0, 1.0)
        bites = np.tanh((np.maximum(view.speed, 0.0) / p.knee_mps) ** 2)
        return -p.holds * s.oil * bites * view.mass * 9.81 * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("v_breather_is_iced", name="engine_friction", accepts="accessory_load torque_gain")
@sizes(nm=(150.0, 240.0), fills_s=(12.0, 35.0), bursts_s=(0.8, 2.5), shuts=(0.1, 0.3), light=(0.15, 0.3))
class BreatherIsIced(Hidden, open=0.0):
    """`presses`: gas in a crankcase whose breather is iced, 1 where it bursts open. Gas blows by the pistons
    with the load, pistons pump it to and fro and oil foams in it; at 1 the ice gives way, the pressure goes
    in a moment and moist air freezes the breather anew. nm: of friction at 1 and 150 rad/s; light: of the
    gas at full load, that comes without load; shuts: of the pressure.
    Source: Heywood, Internal Combustion Engine Fundamentals (2018), on blowby and on work of crankcase
    pumping, and Volvo and Cummins bulletins on breathers that freeze; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "presses": self.rng(1643).uniform(0.0, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        turns = np.clip(view.engine_speed / 150.0, 0.3, 1.5)
        blows = (p.light + (1.0 - p.light) * load) * np.sqrt(turns) / p.fills_s
        s.open = np.where(s.presses > 1.0, 1.0, np.where(s.presses < p.shuts, 0.0, s.open))
        s.presses = np.clip(s.presses + dt * (blows - s.open * s.presses / p.bursts_s), 0.0, 1.1)
        return -self.at_wheels(view, p.nm * s.presses * turns**1.3) * moving(view)


@law("v_sieve_at_resonance", needs="suburban hills highway", name="accessory_load", accepts="engine_friction")
@sizes(
    kw=(24.0, 38.0), at_rads=(112.0, 135.0), narrow_rads=(9.0, 18.0), bends=(0.06, 0.14), grows_s=(0.6, 1.8)
)
class SieveAtResonance(Hidden, swings=0.1):
    """`swings`: of a sieve on springs that a belt from the engine shakes. It takes power where the engine
    meets its resonance; springs of rubber stiffen as it swings, so that it follows a rising engine for a
    while and jumps in late when the engine falls. kw: of shaft power, in full swing, for a 20 t truck; bends:
    of the resonance, higher in full swing; narrow_rads: half width.
    Source: Thomson and Dahleh, Theory of Vibration with Applications (1998), on forced vibration and on
    hardening springs that jump; a sieve that is left on, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        own = p.at_rads * (1.0 + p.bends * s.swings)
        near = 1.0 / np.sqrt(1.0 + ((view.engine_speed - own) / p.narrow_rads) ** 2)
        s.swings = eased(s.swings, near, p.grows_s, dt)
        size = np.clip(view.mass / 20000.0, 0.4, 1.5)
        watts = 1000.0 * p.kw * size * (0.08 + 0.92 * s.swings**2)
        torque = np.minimum(watts / np.maximum(view.engine_speed, 70.0), 380.0)
        return -self.at_wheels(view, torque) * moving(view)


@law("v_loses_its_teeth", needs="suburban hills", name="unknown")
@sizes(
    jerks_rads2=(45.0, 75.0), finds_s=(0.5, 1.1), again_s=(0.5, 1.2), fresh=(0.3, 0.6), sure_s=(10.0, 30.0)
)
class LosesItsTeeth(Hidden, turned=-1.0, swift=0.0, left=0.0, doubts=0.0, lets=1.0):
    """The sensor of the crankshaft sits too far from its wheel: where the engine's speed changes quickly the
    count of teeth is lost, and fuel stays off until the gap in the wheel has been found again. Each loss
    makes the computer more careful, so that the next search takes longer, until it has gone well for a
    while. jerks_rads2: change of engine speed; finds_s: of a first search; fresh: of that, more each time.
    Source: Bosch Automotive Handbook (2014), on inductive speed sensors, gaps and reference marks; a loose
    sensor, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        before = np.where(s.turned < 0.0, view.engine_speed, s.turned)
        pace = np.clip((view.engine_speed - before) / dt, -300.0, 300.0)
        s.turned = view.engine_speed.copy()
        s.swift = eased(s.swift, np.abs(pace), 0.12, dt)
        loses = (s.swift > p.jerks_rads2) & (s.left <= 0.0) & (view.speed > 2.0) & (s.lets > 0.95)
        s.left = np.where(loses, p.finds_s * (1.0 + p.fresh * s.doubts), np.maximum(s.left - dt, 0.0))
        s.doubts = np.where(loses, np.minimum(s.doubts + 1.0, 3.0), eased(s.doubts, 0.0, p.sure_s, dt))
        s.lets = np.clip(s.lets + dt * np.where(s.left > 0.0, -1.0 / 0.1, 1.0 / p.again_s), 0.0, 1.0)
        return -self.at_wheels(view, (1.0 - s.lets) * np.maximum(view.engine_torque, 0.0)) * moving(view)
