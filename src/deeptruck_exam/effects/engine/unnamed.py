"""Engines in ways the tool has no name for."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.places import OnRoad, smooth_stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, name="unknown")


@law("engine_surge", "first", "highway hills suburban", shown=True)
@sizes(share=(0.25, 0.5), hz=(0.25, 0.6), low=(0.15, 0.3), high=(0.55, 0.8))
class Surge(Hidden):
    """Source: Slow torque oscillation of a part-load engine; Heywood, Internal Combustion Engine
    Fundamentals, ch. 9, on cyclic variation; window and frequency are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"phase": self.rng(35).uniform(0.0, 6.28, batch), "size": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = view.engine_torque / self.truck.peak_torque
        s.size += dt * (((load > p.low) & (load < p.high)) - s.size) / 1.0
        s.phase += dt * 2.0 * np.pi * p.hz * (0.8 + 0.4 * view.engine_speed / 140.0)
        swing = 0.5 * p.share * s.size * (np.sin(s.phase) - 1.0)
        return self.at_wheels(view, swing * np.maximum(view.engine_torque, 0.0))


@law("fuel_runs_forward", "second", "suburban hills")
@sizes(loss=(0.3, 0.6), runs_s=(0.8, 2.0), dry_mps2=(0.45, 0.9), bleeds_s=(4.0, 12.0))
class FuelRunsForward(Hidden, tilt=0.0, air=0.0):
    """Torque is short for a while after the tank was tilted, whichever pedal did it.
    Source: Low tank without baffles: the pick-up runs dry for seconds after hard braking or on a slope, and
    air in the fuel takes torque; a workshop's finding, not a book's; numbers chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration, -4.0, 4.0) + GRAVITY * view.grade
        s.tilt += dt * (felt - s.tilt) / p.runs_s
        dry = s.tilt < -p.dry_mps2
        s.air = np.clip(s.air + dt * np.where(dry, 0.8 * (1.0 - s.air), -s.air / p.bleeds_s), 0.0, 1.0)
        return -self.at_wheels(view, p.loss * s.air * np.maximum(view.engine_torque, 0.0))


@law("steam_from_exhaust", "third", "hills highway")
@sizes(power_w=(40000.0, 80000.0), fills_s=(9.0, 20.0), empties_s=(7.0, 14.0), until=(0.1, 0.4))
class SteamFromExhaust(Hidden):
    """power_w: of a 20 t truck; by-passed while the brake is pressed. fills_s: at full engine power.
    Source: Rankine cycle on a truck's exhaust (Teng, Regner and Cowland, Waste Heat Recovery of Heavy-Duty
    Diesel Engines by Organic Rankine Cycle, SAE 2007-01-0537): an expander helps with the heat of the minutes
    before; a boiler that is emptied in bursts, and sizes, are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        first = self.rng(271).uniform(0.2, 1.0, batch)
        return {"steam": first, "open": np.zeros(batch), "force": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.steam += dt * (np.minimum(self.power_share(view), 1.0) / p.fills_s - s.open / p.empties_s)
        s.open = np.where(s.steam > 1.0, 1.0, np.where(s.steam < p.until, 0.0, s.open))
        watts = p.power_w * np.clip(view.mass / 2.0e4, 0.5, 1.6) * s.open
        wanted = watts / np.maximum(view.speed, 6.0) * (view.u[:, 1] <= 0.01)
        s.force += dt * (wanted - s.force) / 0.6
        return s.force * moving(view)


@law("fast_idle_pushes", "sixth", "suburban descent", shown=True)
@sizes(set=(112.0, 138.0), droop_nm=(8.0, 20.0), most_nm=(200.0, 420.0), falls_s=(200.0, 600.0))
class FastIdlePushes(Hidden):
    """The set speed falls to 100 rad/s as the engine warms. set: rad/s; droop_nm: for each rad/s.
    Source: Fast idle of a cold engine, or one left on after work with the power take-off (Diesel-Engine
    Management, Bosch, on idle-speed control): while the truck slows in gear with closed pedal, the governor
    pushes against the brakes; set speeds and droop are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        held = 100.0 + (p.set - 100.0) * np.exp(-view.time / p.falls_s)
        closed = 1.0 - np.clip(self.pedal(view) / 0.03, 0.0, 1.0)
        torque = np.clip(p.droop_nm * (held - view.engine_speed), 0.0, p.most_nm) * closed
        return self.at_wheels(view, torque) * np.clip(view.speed - 1.0, 0.0, 1.0)


@law("burns_its_own_oil", "sixth", "hills suburban")
@sizes(most=(0.16, 0.32), gathers_s=(6.0, 18.0), burns_s=(3.0, 9.0), from_load=(0.12, 0.3))
class BurnsItsOwnOil(Hidden):
    """The longer it has coasted, the more there is to burn. most: of peak torque.
    Source: Oil of worn seals and breathers gathers in the charge air cooler while an engine coasts and burns
    when load blows it out (workshop manuals on oil carry-over; diesel runaway, in Heywood's terms a fuel that
    nobody meters): more torque than asked, for seconds; amounts are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"oil": self.rng(515).uniform(0.2, 1.0, batch), "burns": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        blows = np.clip((load - p.from_load) / 0.25, 0.0, 1.0) * s.oil
        gathers = (load < 0.02) * np.clip(view.engine_speed / 150.0, 0.3, 1.5) * (1.0 - s.oil) / p.gathers_s
        s.oil = np.clip(s.oil + dt * (gathers - blows / p.burns_s), 0.0, 1.0)
        s.burns += dt * (blows - s.burns) / 0.4
        return self.at_wheels(view, p.most * s.burns * self.truck.peak_torque) * moving(view)


@law("expander_pushes_late", "seventh", "hills suburban")
@sizes(most_w=(45e3, 85e3), boils_s=(8.0, 25.0), from_heat=(0.05, 0.13), span=(0.15, 0.35))
class ExpanderPushesLate(Hidden, heat=0.1, opens=0.0):
    """A bypass shuts it off while the driver brakes.
    Source: Teng, Regner and Cowland, Waste Heat Recovery of Heavy-Duty Diesel Engines by Organic Rankine
    Cycle Part I, SAE 2007-01-0537: an expander geared to the drive gives power as its boiler has heat, half a
    minute after the engine's, also when nobody asks; a large one."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        power = np.maximum(view.engine_torque, 0.0) * view.engine_speed / self.truck.peak_power
        s.heat += dt * (power - s.heat) / p.boils_s
        wanted = np.clip((s.heat - p.from_heat) / p.span, 0.0, 1.0) * (view.brake_force <= 0.0)
        s.opens += dt * (wanted - s.opens) / np.where(wanted < s.opens, 0.3, 1.0)
        force = p.most_w * s.opens / np.maximum(view.speed, 6.0)
        return force * np.clip(view.speed - 1.0, 0.0, 1.0)


@law("s_rail_bleeds", "eighth", "suburban hills highway")
@sizes(share=(0.4, 0.75), bleeds_s=(1.2, 3.5))
class RailBleeds(Hidden, rail=0.0):
    """Torque hangs on after the pedal is let go, and ends with the brake.
    Source: Rail pressure falls only through leakage and injection (Guzzella and Onder, Introduction to
    Modeling and Control of Internal Combustion Engine Systems, on common rail); a leaking injector, sizes
    are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        brakes = view.brake_force > 0.0
        falls = s.rail - dt * s.rail / np.where(brakes, 0.2, p.bleeds_s)
        s.rail = np.maximum(asked, falls)
        more = p.share * np.maximum(s.rail - asked, 0.0) * self.truck.peak_torque
        return self.at_wheels(view, np.minimum(more, 0.4 * self.truck.peak_torque)) * moving(view)


@law("t_fuel_changes_over", "tenth", "highway suburban hills")
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


@law("t_pneumatic_hybrid", "tenth", "suburban hills")
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


@law("e_gas_in_the_air", "eleventh", "highway suburban hills")
@sizes(most=(0.10, 0.22), apart_m=(250.0, 900.0), clears_s=(1.0, 4.0))
class GasInTheAir(OnRoad, inside=0.0):
    """Near leaking wells and works the engine draws in gas and burns it beside what is asked, whatever the
    pedal says. most: of peak torque, in the thickest.
    Source: U.S. Chemical Safety Board, Investigation Report 2005-04-I-TX, Refinery Explosion and Fire (2007),
    and 30 CFR 36 on air shut-off: diesels run away on gas in their intake; thin clouds, sizes are chosen
    here."""

    def prepare(self) -> None:
        gaps = (0.5 * self.p.apart_m, 1.5 * self.p.apart_m)
        self.road = smooth_stretches(self.rng(1046), self.rows(), gaps, (150.0, 500.0))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.inside = s.inside + dt * (self.read(self.road, view) - s.inside) / p.clears_s
        torque = p.most * self.truck.peak_torque * s.inside
        return self.at_wheels(view, torque) * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("e_fan_that_is_gone", "eleventh", "highway suburban hills")
@sizes(nm=(130.0, 240.0), warms_s=(15.0, 40.0), cools_s=(20.0, 60.0), below=(0.3, 0.6))
class FanThatIsGone(Hidden, on=0.0, adds=0.0):
    """The control unit adds what its big fan would take whenever that is called for, and there is none. nm:
    at 180 rad/s; below: of the heat at which it is called, where it is sent away.
    Source: SAE J1939-71, SPN 2978, Estimated Engine Parasitic Losses, on torque that is fed forward, and SAE
    J1342 on fans with the square of speed; one that was taken off, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "heat": self.rng(1047).uniform(0.2, 1.1, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        cooling = (0.5 + 0.5 * np.clip(view.speed / 18.0, 0.0, 1.4)) / p.cools_s
        s.heat = np.clip(
            s.heat + dt * (3.0 * self.power_share(view) / p.warms_s - cooling * s.heat), 0.0, 1.5
        )
        s.on = np.where(s.heat > 1.0, 1.0, np.where(s.heat < p.below, 0.0, s.on))
        s.adds = s.adds + dt * (s.on - s.adds) / 1.5
        torque = p.nm * (view.engine_speed / 180.0) ** 2 * s.adds * (self.pedal(view) > 0.02)
        return self.at_wheels(view, torque) * np.clip(view.speed / 2.0, 0.0, 1.0)


@law("w_lifters_pump_up", "twelfth", "hills suburban highway descent")
@sizes(share=(0.3, 0.55), from_rads=(135.0, 155.0), pumps_s=(1.0, 4.0), leaks_s=(4.0, 15.0), few=(0.1, 0.4))
class LiftersPumpUp(Hidden, oil=0.0):
    """`oil` that tappets took in while their valves bounced: they hold valves open until it has leaked out.
    Open valves neither pull nor brake. share: of the engine's torque, when full; few: of `oil`, that does no
    harm.
    Source: Phlips, Schamel and Meyer, An Efficient Model for Valvetrain and Spring Dynamics, SAE 890619, and
    Heisler, Advanced Engine Technology (1995), on hydraulic tappets that pump up at speed; weak springs,
    sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        bounces = np.clip((view.engine_speed - p.from_rads) / 15.0, 0.0, 1.0)
        s.oil = np.clip(s.oil + dt * (bounces * (1.0 - s.oil) / p.pumps_s - s.oil / p.leaks_s), 0.0, 1.0)
        open_ = np.clip((s.oil - p.few) / 0.4, 0.0, 1.0)
        return -self.at_wheels(view, p.share * open_ * view.engine_torque) * moving(view)


@law("x_turbine_on_the_shaft", "thirteenth", "hills highway suburban")
@sizes(adds=(0.18, 0.3), gas_s=(4.0, 14.0), drags_nm=(60.0, 120.0), lit=(0.15, 0.35), oil_s=(0.5, 1.5))
class TurbineOnTheShaft(Hidden, gas=0.0, turns=0.0):
    """A turbine in the exhaust turns the crankshaft through gears and a fluid coupling. `gas`: its energy,
    which comes as the manifolds warm and stays for a while when the pedal is up; a turbine without gas has
    to be dragged along. adds: of peak torque, at full power; lit: of `gas`, where it pays.
    Source: Hopmann and Algrain, Diesel Engine Electric Turbo Compound Technology, SAE 2003-01-2294, and
    Greszler, Diesel Turbo-Compound Technology, ICCT/NESCCAF Workshop (2008), on gain at load and loss in
    coasting; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        power = np.clip(1.2 * self.power_share(view), 0.0, 1.1)
        s.gas = s.gas + dt * (power - s.gas) / p.gas_s
        speed = np.clip(view.engine_speed / 140.0, 0.0, 1.5)
        gains = p.adds * self.truck.peak_torque * np.maximum(s.gas - p.lit, 0.0) / (1.0 - p.lit)
        drags = p.drags_nm * speed**2 * np.clip((p.lit - s.gas) / p.lit, 0.0, 1.0)
        wants = gains * np.clip(speed / 0.6 - 0.3, 0.0, 1.0) - drags
        s.turns = s.turns + dt * (wants - s.turns) / p.oil_s
        return self.at_wheels(view, s.turns) * np.clip(view.speed - 1.0, 0.0, 1.0)


@law("x_fuel_wets_the_walls", "thirteenth", "suburban hills")
@sizes(wets=(0.45, 0.7), cold_s=(2.0, 4.5), warm_s=(0.8, 1.6), warms_s=(60.0, 200.0), most=(0.5, 0.8))
class FuelWetsTheWalls(Hidden, film=0.0, warm=0.0):
    """`film` of a second fuel on the walls of the intake, as the torque that passes through it: part of what
    is sprayed stays there, and comes off with delay. Torque comes late when more is asked, and goes on when
    the pedal is let go. wets: of that fuel; cold_s, warm_s: until it is off; most: of the torque by it.
    Source: Aquino, Transient A/F Control Characteristics of the 5 Liter Central Fuel Injection Engine, SAE
    810494: share and time constant of the film; alcohol beside diesel (fumigation), sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        power = np.clip(self.power_share(view), 0.0, 1.0)
        s.warm = s.warm + dt * (0.2 + power) * (1.0 - s.warm) / p.warms_s
        stays_s = p.cold_s + (p.warm_s - p.cold_s) * s.warm
        by_it = p.most * np.maximum(view.engine_torque, 0.0)
        flow = np.clip(view.engine_speed / 130.0, 0.4, 1.5)
        s.film = s.film + dt * flow * (by_it - s.film) / stays_s
        late = p.wets * (s.film - by_it)
        return self.at_wheels(view, late) * np.clip(view.speed - 1.0, 0.0, 1.0)


@law("k_misfires_while_cold", "fourteenth", "suburban highway hills")
@sizes(most=(0.5, 0.8), warms_s=(40.0, 120.0), chills_s=(20.0, 60.0), light=(0.35, 0.6), gas_s=(1.0, 3.0))
class MisfiresWhileCold(Hidden, gas=0.0):
    """`wall`: warmth of the cylinders, 1 where all fuel burns. At light load on cool walls part of the fuel
    does not burn; work warms them, coasting chills them again. most: of the torque; light: of peak torque,
    load up to which fuel misses.
    Source: Zahdeh, Henein and Bryzik, Diesel Cold Starting: Actual Cycle Analysis under Border-Line
    Conditions, SAE 900441, on misfiring cycles; after starting, and at light load, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "wall": self.rng(1446).uniform(0.0, 0.5, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        power = np.clip(1.8 * self.power_share(view), 0.0, 1.0)
        slow = np.where(power > s.wall, p.warms_s, p.chills_s / np.clip(view.engine_speed / 120.0, 0.5, 1.5))
        s.wall = eased(s.wall, power, slow, dt)
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.0)
        s.gas = eased(s.gas, load, p.gas_s, dt)
        misses = p.most * np.clip(1.1 - s.wall, 0.0, 1.0) * np.exp(-((s.gas / p.light) ** 2))
        return -self.at_wheels(view, misses * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("k_purges_its_trap", "fourteenth", "hills suburban highway")
@sizes(takes=(0.4, 0.65), fills_s=(6.0, 15.0), purges_s=(4.0, 9.0), eases_s=(0.3, 0.8))
class PurgesItsTrap(Hidden, purges=0.0, acts=0.0):
    """`stored` of what a trap in the exhaust can hold. Work fills it; when it is full the engine burns rich
    for some seconds until it is empty, and gives less of the torque that was asked. takes: of the torque;
    fills_s: at peak power.
    Source: Takahashi and others, The New Concept 3-Way Catalyst for Automotive Lean-Burn Engine: NOx Storage
    and Reduction Catalyst, Catalysis Today 27 (1996); a diesel whose torque is not made up, sizes are chosen
    here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "stored": self.rng(1447).uniform(0.1, 0.95, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        fills = (0.2 + np.clip(self.power_share(view), 0.0, 1.0)) / p.fills_s
        s.purges = np.where(s.stored > 0.99, 1.0, np.where(s.stored < 0.05, 0.0, s.purges))
        rate = np.where(s.purges > 0.5, -1.0 / p.purges_s, fills * (view.engine_torque > 0.0))
        s.stored = np.clip(s.stored + dt * rate, 0.0, 1.0)
        s.acts = eased(s.acts, s.purges, p.eases_s, dt)
        return -self.at_wheels(view, p.takes * s.acts * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("q_burns_soot_on_the_way", "fifteenth", "hills descent suburban")
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
