"""Assisted turbines, knock, cold oil, a guard, a flap, a cooled box, gas and air as second fuels."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("t_assist_runs_flat", needs="suburban hills", name="turbo_lag", accepts="command_rate_limit", shown=True)
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


@law("t_knock_takes_torque", needs="hills highway", name="torque_derate", accepts="torque_gain", shown=True)
@sizes(depth=(0.3, 0.5), bears=(0.32, 0.55), warms=(0.15, 0.4), retards_s=(3.0, 10.0), forgets_s=(20.0, 70.0))
class KnockTakesTorque(Hidden, warm=0.2, late=0.0):
    """`late`: of the ignition, 0..1; it goes back slowly where nothing knocks. bears: of peak torque without
    knock, cold; warms: less of it, hot.
    Source: Kiencke and Nielsen, Automotive Control Systems (2005), on knock control, which retards by steps
    and advances slowly; torque falls with the square of the delay; gas of a low methane number (EN 16726),
    sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        s.warm = s.warm + dt * (np.clip(1.3 * self.power_share(view), 0.0, 1.0) - s.warm) / 50.0
        knocks = np.clip((load - p.bears + p.warms * s.warm) / 0.15, 0.0, 1.0)
        rises = knocks * (1.0 - s.late) / p.retards_s
        s.late = np.clip(s.late + dt * (rises - (1.0 - knocks) * s.late / p.forgets_s), 0.0, 1.0)
        return -self.at_wheels(view, p.depth * s.late**2 * np.maximum(view.engine_torque, 0.0))


@law("t_torque_waits_for_warm_oil", needs="suburban hills", name="torque_limit", shown=True)
@sizes(cold=(0.26, 0.45), warms_s=(60.0, 180.0))
class TorqueWaitsForWarmOil(Hidden):
    """`warm`: every drive begins elsewhere between cold and half warm; work warms it. cold: of peak torque,
    the most that is let through; warms_s: of peak power.
    Source: Cold protection of heavy engines (owner's manuals on engine protection after a start; SAE
    J1939-71, SPN 175, engine oil temperature): the limit rises as the oil warms; times are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(982).uniform(0.0, 0.5, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        work = 0.15 + np.clip(self.power_share(view), 0.0, 1.1)
        s.warm = np.minimum(s.warm + dt * work / p.warms_s, 1.0)
        most = (p.cold + (1.1 - p.cold) * s.warm**1.5) * self.truck.peak_torque
        return -self.at_wheels(view, np.maximum(view.engine_torque - most, 0.0))


@law("t_overspeed_guard", needs="descent hills", name="engine_brake", accepts="engine_friction")
@sizes(from_rads=(98.0, 116.0), span_rads=(14.0, 28.0), share=(0.3, 0.6), fills_s=(0.3, 1.0))
class OverspeedGuard(Hidden, on=0.0, brakes=0.0):
    """It comes in where an engine that is pushed turns too fast, and stays until it turns slowly again.
    share: of the engine brake's torque, at 200 rad/s.
    Source: Protection against overspeed in overrun (ISO 3046-6, Reciprocating internal combustion engines -
    Overspeed protection; makers' manuals on downhill driving): a stage of the engine brake by itself, set far
    too low, speeds are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = view.engine_speed
        s.on = np.where(turns > p.from_rads, 1.0, np.where(turns < p.from_rads - p.span_rads, 0.0, s.on))
        s.on = np.where(self.pedal(view) > 0.03, 0.0, s.on)
        s.brakes = s.brakes + dt * (s.on - s.brakes) / p.fills_s
        torque = p.share * self.truck.engine_brake_torque * np.clip(turns / 200.0, 0.0, 1.2)
        return -self.at_wheels(view, torque * s.brakes) * moving(view)


@law("t_flap_is_half_shut", name="engine_friction", accepts="engine_brake accessory_load")
@sizes(nm=(80.0, 180.0), boost=(0.2, 0.6), fills_s=(1.0, 4.0), heat=(0.2, 0.6), heats_s=(25.0, 90.0))
class FlapIsHalfShut(Hidden, flow=0.0, hot=0.0):
    """Exhaust has to pass a flap that no longer opens: the faster, the fuller and the hotter, the harder. nm:
    at 150 rad/s without load.
    Source: Heywood, Internal Combustion Engine Fundamentals (1988), ch. 13, on exhaust pumping work: pressure
    before a throttle with the square of the flow and with its temperature; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        s.flow = s.flow + dt * (load - s.flow) / p.fills_s
        s.hot = s.hot + dt * (load - s.hot) / p.heats_s
        turns = np.clip(view.engine_speed / 150.0, 0.0, 1.6)
        torque = p.nm * turns**2 * (1.0 + p.boost * s.flow) ** 2 * (1.0 + p.heat * s.hot)
        return -self.at_wheels(view, np.minimum(torque, 0.3 * self.truck.peak_torque)) * moving(view)


@law("t_box_is_kept_cold", needs="hills highway suburban", name="accessory_load", accepts="engine_friction")
@sizes(nm=(90.0, 170.0), pulls_s=(18.0, 40.0), leaks_s=(35.0, 90.0), frosts_s=(60.0, 160.0))
class BoxIsKeptCold(Hidden, on=0.0, frost=0.0, thaws=0.0, runs=0.0):
    """`box`: 0 cold enough to 1 too warm. Doors warm it at stands; frost weakens the evaporator until it is
    thawed, when nothing runs.
    Source: ASHRAE Handbook, Refrigeration, on truck bodies, door openings and defrosting: a compressor on the
    engine, switched by a thermostat with a band, takes the more torque the warmer it is inside; sizes are
    chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(983)
        begin = {"box": rng.uniform(0.2, 1.3, batch), "frost": rng.uniform(0.0, 0.9, batch)}
        return {**super().start(batch), **begin}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.on = np.where(s.box >= 1.0, 1.0, np.where(s.box <= 0.0, 0.0, s.on))
        s.thaws = np.where(s.frost >= 1.0, 1.0, np.where(s.frost <= 0.0, 0.0, s.thaws))
        works = s.on * (1.0 - s.thaws)
        warms = 1.0 / p.leaks_s + 0.08 * (view.speed < 0.1)
        cools = works * (1.0 - 0.4 * s.frost) * (1.0 / p.pulls_s + 1.0 / p.leaks_s)
        s.box = np.clip(s.box + dt * (warms - cools), 0.0, 1.6)
        s.frost = np.clip(s.frost + dt * np.where(s.thaws > 0.0, -1.0 / 18.0, works / p.frosts_s), 0.0, 1.0)
        s.runs = s.runs + dt * (works - s.runs) / 0.5
        return -self.at_wheels(view, p.nm * (0.75 + 0.35 * s.box) * s.runs) * moving(view)


@law("t_fuel_changes_over", needs="highway suburban hills", name="unknown")
@sizes(gains=(0.16, 0.3), low=(0.1, 0.2), high=(0.6, 0.9), waits_s=(0.8, 3.0), dips=(0.08, 0.18))
class FuelChangesOver(Hidden, within=0.0, gas=0.0):
    """In the middle of its loads the engine burns gas beside its diesel and gives more than asked; as the
    fuels change it gives less. gains: of the torque; low, high: of peak torque; dips: of it.
    Source: Karim, Dual-Fuel Diesel Engines (2015): gas is fed between a light load, where it would not burn,
    and a heavy one, where it would knock; calibration of a conversion, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        fits = (load > p.low) & (load < p.high)
        s.within = np.clip(s.within + dt * np.where(fits, 1.0, -2.0) / p.waits_s, 0.0, 1.0)
        wanted = np.where(s.within >= 1.0, 1.0, np.where(s.within <= 0.0, 0.0, np.rint(s.gas)))
        s.gas = s.gas + np.clip(wanted - s.gas, -dt / 0.8, dt / 0.8)
        more = p.gains * s.gas * load - 4.0 * p.dips * s.gas * (1.0 - s.gas) * (load > 0.02)
        return self.at_wheels(view, more * self.truck.peak_torque) * moving(view)


@law("t_pneumatic_hybrid", needs="suburban hills", name="unknown")
@sizes(most=(0.14, 0.26), fills_s=(6.0, 16.0), empties_s=(4.0, 12.0), kick=(0.3, 0.5))
class PneumaticHybrid(Hidden, acts=0.0):
    """`tank`: its pressure over the full one. In braking the engine pumps air into it, against that pressure;
    a deep pedal lets it out again through the engine. most: of peak torque; kick: of the pedal.
    Source: Dönitz, Vasile, Onder and Guzzella, Modelling and Optimizing Two- and Four-Stroke Hybrid Pneumatic
    Engines, Proc. IMechE D 223 (2009); tank and torque are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "tank": self.rng(984).uniform(0.2, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = np.clip(view.engine_speed / 150.0, 0.3, 1.5)
        rolls = np.clip(view.speed - 1.0, 0.0, 1.0)
        pumps = (view.brake_force > 0.0) * (s.tank < 0.98) * (0.35 + 0.65 * s.tank)
        pushes = (self.pedal(view) > p.kick) * np.clip((s.tank - 0.1) / 0.3, 0.0, 1.0)
        s.acts = s.acts + dt * ((pushes - pumps) * rolls - s.acts) / 0.25
        flows = np.where(s.acts < 0.0, -s.acts / p.fills_s, -s.acts / p.empties_s)
        s.tank = np.clip(s.tank + dt * turns * flows, 0.0, 1.0)
        return self.at_wheels(view, p.most * self.truck.peak_torque * s.acts) * moving(view)
