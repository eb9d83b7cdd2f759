"""An air meter that is slow, a catalyst that is too cold, a valve of the gas tank, exhaust valves that float,
a block that warps and a mower; water in the fuel, and servants that are shed."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.places import CELL_M, OnRoad, smooth_stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law(
    "j_air_meter_is_slow", needs="suburban hills", name="turbo_lag", accepts="command_rate_limit", shown=True
)
@sizes(least=(0.2, 0.32), still_s=(2.2, 4.0), power=(0.6, 1.0), spools_s=(0.3, 0.7), spare=(0.02, 0.08))
class AirMeterIsSlow(Hidden, air=0.3, read=0.3):
    """The controller gives no more fuel than the air that its meter shows. The meter's hot film is under a
    crust of soot: it follows the air late, and the less air passes it, the later. `air` itself comes soon.
    least: of peak torque, that is given unasked; still_s: of the meter at next to no air; power: of the air,
    by which it gets quicker; spare: more air than fuel needs.
    Source: Bruun, Hot-Wire Anemometry (1995), on response and fouling, and Bosch, Diesel-Engine Management
    (2014), on limiting smoke by the air meter; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        turns = np.clip(view.engine_speed / 140.0, 0.5, 1.4)
        s.air = eased(s.air, (0.25 + 0.75 * asked) * turns, p.spools_s, dt)
        late = p.still_s * (0.25 / np.clip(s.read, 0.15, 1.6)) ** p.power
        s.read = eased(s.read, s.air, late, dt)
        fuel = (s.read / turns - 0.25) / 0.75 + p.spare
        lacks = np.maximum(asked - np.maximum(fuel, p.least), 0.0)
        return -self.at_wheels(view, lacks * self.truck.peak_torque) * moving(view)


@law(
    "j_catalyst_is_too_cold", needs="hills suburban", name="torque_derate", accepts="torque_gain", shown=True
)
@sizes(most=(0.3, 0.46), heats_s=(30.0, 80.0), blows_s=(18.0, 45.0), needs_heat=(0.4, 0.6), wide=(0.12, 0.25))
class CatalystIsTooCold(Hidden, cut=0.0):
    """A catalyst cleans nothing while it is cold, and the controller then takes torque, so that there is less
    to clean. Hard work heats it; when the engine is turned by the wheels it pumps cold air through it, the
    more, the faster it turns. `heat` of the catalyst. most: of the torque; heats_s: at full power; blows_s:
    of cold air at 150 rad/s; needs_heat: where half is taken.
    Source: Koebel, Elsener and Kleemann, Urea-SCR, Catalysis Today 59 (2000), on the temperature below which
    nothing is cleaned; a torque that is taken for it, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "heat": self.rng(2241).uniform(0.15, 0.75, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        power = np.clip(self.power_share(view), 0.0, 1.0)
        cold_air = np.clip(view.engine_speed / 150.0, 0.0, 1.4) * (view.engine_torque < 0.0)
        gains = (1.15 * np.sqrt(power) - s.heat) * np.sqrt(0.1 + power) / p.heats_s
        s.heat = np.clip(s.heat + dt * (gains - cold_air * s.heat / p.blows_s), 0.0, 1.2)
        wish = p.most / (1.0 + np.exp(np.clip((s.heat - p.needs_heat) * 4.0 / p.wide, -30.0, 30.0)))
        s.cut = eased(s.cut, wish, 1.5, dt)
        return -self.at_wheels(view, s.cut * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law(
    "j_valve_of_the_gas_tank",
    needs="hills suburban",
    name="torque_limit",
    accepts="torque_derate",
    shown=True,
)
@sizes(flows=(0.17, 0.28), stores_s=(2.0, 5.0), knee=(0.25, 0.5), least=(0.24, 0.34))
class ValveOfTheGasTank(Hidden):
    """A gas engine's tank valve does not open wholly. Gas flows through it by the root of the difference of
    pressures, into pipes that hold a little: short pulls are served from these, long ones are limited to what
    flows. `pipes`: their pressure, 1 as in the tank. flows: of the fuel for peak power, with empty pipes;
    stores_s: of peak power, in the pipes; knee: of the pressure, below which torque is limited.
    Source: White, Fluid Mechanics (2016), on flow through orifices and filling of vessels, and makers'
    manuals on tank valves of gas trucks; a valve that sticks, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"pipes": self.rng(2242).uniform(0.5, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        allowed = p.least + (1.0 - p.least) * np.clip(s.pipes / p.knee, 0.0, 1.0) ** 1.5
        most = allowed * self.truck.peak_torque
        given = np.minimum(np.maximum(view.engine_torque, 0.0), most)
        burns = 0.03 + given * view.engine_speed / self.truck.peak_power
        flows = p.flows * np.sqrt(np.maximum(1.0 - s.pipes, 0.0) + 1e-6)
        s.pipes = np.clip(s.pipes + dt * (flows - burns) / p.stores_s, 0.0, 1.0)
        return -self.at_wheels(view, np.maximum(view.engine_torque - most, 0.0)) * moving(view)


@law("j_exhaust_valves_float", needs="descent hills suburban", name="engine_brake", accepts="engine_friction")
@sizes(nm=(520.0, 850.0), at_rads=(150.0, 190.0), floats=(0.78, 0.95), back=(0.1, 0.2), keeps=(0.3, 0.5))
@sizes(fills_s=(0.5, 1.3))
class ExhaustValvesFloat(Hidden, press=0.0, floats=0.0):
    """A flap behind the engine, of which nobody knows, shuts when the pedal is up, and gas is pressed against
    it by the square of the engine's speed. From a pressure on, weak springs no longer keep the exhaust valves
    on their seats: they float, gas goes back into the cylinders, and most of the braking is lost until the
    engine turns clearly slower. nm: of torque, at at_rads; floats: of at_rads; back: of it, lower, where they
    sit again; keeps: of the torque, with floating valves.
    Source: Jacobs Vehicle Systems' and other makers' notes on exhaust brakes and valve springs, and Heywood,
    Internal Combustion Engine Fundamentals (2018), on pumping; weak springs, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = np.clip(view.engine_speed / p.at_rads, 0.0, 1.4)
        shut = (self.pedal(view) < 0.03) & (view.engine_torque < 0.1 * self.truck.peak_torque)
        s.press = eased(s.press, shut * turns**2, np.where(shut, p.fills_s, 0.2), dt)
        back = p.floats - p.back
        wish = np.where(s.press > p.floats**2, 1.0, np.where(s.press < back**2, 0.0, np.rint(s.floats)))
        s.floats = eased(s.floats, wish, 0.3, dt)
        nm = p.nm * np.minimum(s.press, 1.3) * (1.0 - (1.0 - p.keeps) * s.floats)
        return -self.at_wheels(view, nm) * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("j_block_warps", name="engine_friction", accepts="accessory_load engine_brake torque_gain")
@sizes(nm=(240.0, 400.0), head_s=(10.0, 25.0), block_s=(70.0, 180.0), warps=(0.25, 0.45), always=(0.12, 0.25))
class BlockWarps(Hidden):
    """The head follows the load soon and the block late. While they are of unlike heat, one way or the other,
    the block is bent, the crankshaft's bearings stand out of line, and they rub by the square of that: some
    time after each change from idling to hard work and back. `head`, `block`: heat. nm: at 140 rad/s; warps:
    difference of heat, for all of nm; always: of nm.
    Source: Taylor, The Internal-Combustion Engine in Theory and Practice (1985), on distortion by heat, and
    Harris and Kotzalas, Essential Concepts of Bearing Technology (2006), on misalignment; a repaired block,
    sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(2243)
        return {"head": rng.uniform(0.1, 0.7, batch), "block": rng.uniform(0.1, 0.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.head = eased(s.head, 0.1 + 0.9 * np.clip(self.power_share(view), 0.0, 1.0), p.head_s, dt)
        s.block = eased(s.block, s.head, p.block_s, dt)
        bent = np.minimum(((s.head - s.block) / p.warps) ** 2, 1.3)
        turns = np.clip(view.engine_speed / 140.0, 0.3, 1.4) ** 0.5
        return -self.at_wheels(view, p.nm * (p.always + (1.0 - p.always) * bent) * turns) * moving(view)


@law(
    "j_mower_meets_thick_grass",
    needs="suburban hills highway",
    name="accessory_load",
    accepts="engine_friction",
)
@sizes(idle_nm=(40.0, 80.0), cuts_nm=(170.0, 290.0), slips=(0.75, 1.0), mean_m=(150.0, 500.0))
@sizes(rotor_s=(1.5, 4.0))
class MowerMeetsThickGrass(OnRoad, turns=1.0):
    """The engine drives a mower on an arm, and the verge's grass is thin and thick by turns. Cutting takes
    torque by the grass and by the way over the turns of the rotor; the rotor gives some of its swing first,
    and a belt slips above its torque. `turns` of the rotor, 1 when it is as fast as the engine has it.
    idle_nm: at 140 rad/s; cuts_nm: at the engine, in thick grass; slips: of cuts_nm, where the belt slips.
    Source: Persson, Mechanics of Cutting Plant Material (1987), on the energy by area and the fan's part; a
    mower that is also left on at speed, sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(2244), self.p
        gaps, lengths = (0.2 * p.mean_m, 0.8 * p.mean_m), (0.6 * p.mean_m, 2.0 * p.mean_m)
        stands = smooth_stretches(rng, self.rows(), gaps, lengths)
        self.grass = stands**0.5 * np.clip(1.0 + 0.4 * ou_series(rng, stands.shape, CELL_M, 25.0), 0.2, 1.9)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wish = np.clip(view.engine_speed / 140.0, 0.4, 1.5)
        feeds = np.clip(view.speed / 8.0, 0.0, 1.0)
        cuts = self.read(self.grass, view) * feeds / np.maximum(s.turns, 0.4)
        drives = np.clip(1.6 * (wish - s.turns) + cuts, 0.0, p.slips)
        s.turns = np.clip(s.turns + dt * (drives - cuts) / p.rotor_s, 0.3, 1.6)
        return -self.at_wheels(view, p.idle_nm * wish**2 + p.cuts_nm * drives) * moving(view)


@law("j_water_in_the_fuel", needs="hills suburban", name="unknown")
@sizes(most=(0.55, 0.75), reaches=(0.01, 0.025), wide=(0.01, 0.03), runs_s=(0.8, 2.0), pipe_s=(1.5, 4.0))
@sizes(clears=(0.3, 0.6))
class WaterInTheFuel(Hidden, lies=0.0, pipe=0.0):
    """Water lies on the floor of a long tank whose pipe stands behind its middle. Uphill and when the truck
    gathers speed it runs to the pipe and is drawn in with the fuel; it comes to the engine as late as fuel is
    burned, and takes torque by what it displaces. `lies`: how the floor leans, as the water follows it;
    `pipe`: water at the engine's end. most: of the torque; reaches, wide: lean over which water comes; pipe_s
    of peak power; clears: part that the separator holds back.
    Source: makers' notes on water in diesel tanks and on separators, and Bosch, Diesel-Engine Management
    (2014); a neglected tank, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration / GRAVITY + view.grade, -0.2, 0.2)
        s.lies = eased(s.lies, felt, p.runs_s, dt)
        drawn = np.clip((s.lies - p.reaches) / p.wide, 0.0, 1.0)
        burns = 0.1 + np.clip(self.power_share(view), 0.0, 1.0)
        s.pipe = eased(s.pipe, drawn, p.pipe_s / burns, dt)
        lost = p.most * s.pipe * (1.0 - p.clears * (1.0 - s.pipe))
        return -self.at_wheels(view, lost * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("j_sheds_its_servants", needs="suburban hills highway", name="unknown")
@sizes(nm=(150.0, 240.0), kicks=(0.5, 0.7), lasts_s=(6.0, 16.0), pays=(0.7, 1.0), pays_nm=(90.0, 160.0))
class ShedsItsServants(Hidden, on=0.0, shed=0.0):
    """At a firm pedal the engine drops what else it drives: generator, compressor, fan and cooling; so there
    is more for the wheels than known. What they left undone is `owed` and they catch up as soon as the pedal
    is eased; who owes too much is no longer dropped. nm: more, while dropped; kicks: pedal; lasts_s: until
    enough is owed; pays: of it, that comes back; pays_nm: at most.
    Source: Guzzella and Sciarretta, Vehicle Propulsion Systems (2013), on auxiliaries as a store, and makers'
    notes on controlled compressors and generators; a bold programme, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "owed": self.rng(2245).uniform(0.0, 0.7, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = self.pedal(view)
        s.on = np.where((pedal > p.kicks) & (s.owed < 0.5), 1.0, s.on)
        s.on = np.where((pedal < 0.8 * p.kicks) | (s.owed >= 1.0), 0.0, s.on)
        s.shed = eased(s.shed, s.on, 0.3, dt)
        back = np.where(s.on > 0.5, 0.0, np.minimum(s.owed / 0.3, 1.0)) * (pedal < p.kicks)
        paid = back * p.pays_nm / (p.nm * p.lasts_s * p.pays)
        s.owed = np.clip(s.owed + dt * (s.shed / p.lasts_s - paid), 0.0, 1.2)
        return self.at_wheels(view, p.nm * s.shed - p.pays_nm * back) * moving(view)
