"""Seventh forms in the engine; torques act at the flywheel."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.breakdown_records.air import spells, within
from deeptruck_exam.hidden import Array, Hidden, moving, wheel_force
from deeptruck_exam.proving_ground.law import Law, law
from deeptruck_model.trucks import View


@law(
    "rotor_has_energy",
    name="turbo_lag",
    source="European load response test (directive 1999/96/EC) and Watson and Janota, Turbocharging the"
    " Internal Combustion Engine (1982): the turbine's power goes into the rotor's energy, the compressor"
    " takes a power of it with the speed cubed, and a blow-off dumps the charge, not the rotor's energy,"
    " when the pedal closes",
    ranges={"spools_s": (2.0, 4.5), "without": (0.08, 0.18), "charges_s": (0.6, 1.6), "idles": (0.005, 0.03)},
    needs=("suburban", "hills"),
    accepts=("command_rate_limit",),
)
class RotorHasEnergy(Law, energy=0.1, charge=0.1):
    """After a short lift full torque is back as soon as the pipes are full; after a long one it is not."""

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        turns = np.clip(view.engine_speed / 140.0, 0.4, 1.6)
        have = p.without + (1.0 - p.without) * s.charge
        exhaust = p.idles + np.minimum(asked, have) * turns
        s.energy = np.clip(s.energy + dt * (exhaust - s.energy**1.5) / p.spools_s, 0.0, 1.5)
        dumped = asked < 0.02
        wanted = np.where(dumped, 0.0, np.minimum(s.energy, 1.0))
        s.charge += dt * (wanted - s.charge) / np.where(dumped, 0.25, p.charges_s)
        missing = np.maximum(asked - have, 0.0)
        return -wheel_force(self.setting, view, missing * self.truck.peak_torque) * moving(view)


@law(
    "turbine_inlet_kept_cool",
    name="torque_derate",
    source="Limits of exhaust temperature ahead of the turbine (Diesel-Engine Management, Bosch, on"
    " limitation of injected quantity): an integral control takes fuel while the metal is too hot and gives"
    " it back slowly",
    # limit: of the rise at full torque; takes: share of torque a second, for each unit above
    ranges={"limit": (0.12, 0.26), "metal_s": (5.0, 16.0), "takes": (0.08, 0.2), "most": (0.35, 0.55)},
    needs=("hills", "highway"),
    accepts=("torque_gain",),
)
class TurbineInletKeptCool(Law, metal=0.15, cut=0.0):
    """Low engine speed is hotter for the same torque: less air for it."""

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        torque = np.maximum(view.engine_torque, 0.0)
        load = (1.0 - s.cut) * torque / self.truck.peak_torque
        gas = load * np.clip(130.0 / np.maximum(view.engine_speed, 60.0), 0.6, 1.5) ** 0.6
        s.metal += dt * (gas - s.metal) / p.metal_s
        over = s.metal - p.limit
        change = np.where(over > 0.0, p.takes * over / p.limit, -0.012)
        s.cut = np.clip(s.cut + dt * change, 0.0, p.most)
        return -wheel_force(self.setting, view, s.cut * torque)


@law(
    "governor_with_a_soft_droop",
    name="torque_limit",
    source="ISO 3046-4, Reciprocating internal combustion engines - Speed governing: torque falls with speed"
    " along a droop, by a rack with mass and friction that overshoots; a governor of a generating set on a"
    " truck's engine, set low",
    ranges={"from_rads": (96.0, 122.0), "droop_rads": (55.0, 110.0), "rack_rads": (1.6, 4.0)},
    needs=("hills", "suburban", "highway"),
)
class GovernorWithASoftDroop(Law, rack=1.0, pace=0.0):
    """rack: the most torque it lets through, over the peak; it lags and swings."""

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        wanted = np.clip(1.0 - (view.engine_speed - p.from_rads) / p.droop_rads, 0.12, 1.0)
        pull = p.rack_rads**2 * (wanted - s.rack) - 2.0 * 0.4 * p.rack_rads * s.pace
        s.pace = s.pace + dt * pull
        s.rack = np.clip(s.rack + dt * s.pace, 0.05, 1.2)
        over = np.maximum(view.engine_torque - s.rack * self.truck.peak_torque, 0.0)
        return -wheel_force(self.setting, view, over) * moving(view)


@law(
    "oil_pump_in_high_stage",
    name="engine_friction",
    source="Oil pumps in two stages on motored benches (Heywood, Internal Combustion Engine Fundamentals, ch."
    " 13, counts them and the jets under the pistons to friction): torque with speed up to the relief"
    " valve's opening, and the high stage stays on for a while after load; a sticking stage valve",
    # torque_nm: of the high stage, relief open; low: of it, in the low stage
    ranges={"torque_nm": (110, 230), "low": (0.1, 0.35), "from_load": (0.14, 0.3), "stays_s": (6.0, 25)},
    accepts=("engine_brake", "accessory_load"),
)
class OilPumpInHighStage(Law, left=0.0, stage=0.0):
    """A truck that coasts after a climb drags more than one that has coasted for long."""

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        load = view.engine_torque / self.truck.peak_torque
        s.left = np.where(load > p.from_load, p.stays_s, np.maximum(s.left - dt, 0.0))
        s.stage += dt * ((s.left > 0.0) - s.stage) / 0.8
        turns = np.minimum(view.engine_speed / 145.0, 1.0)
        torque = p.torque_nm * (p.low + (1.0 - p.low) * s.stage) * turns
        return -wheel_force(self.setting, view, torque) * moving(view)


@law(
    "fan_clutch_on_and_off",
    name="accessory_load",
    source="SAE J1342, Test Methods for Determining Power Consumption of Engine Cooling Fan-Drive Systems: a"
    " fan behind a clutch that is on or off takes torque with speed squared; on by coolant, off well below,"
    " and for the air conditioning's pressure; a large fan",
    # torque_nm: at 200 rad/s; on: coolant, as the mean of power over the most; off: of that
    ranges={"torque_nm": (190.0, 330.0), "on": (0.16, 0.34), "off": (0.4, 0.75), "warms_s": (12.0, 35.0)},
    needs=("hills", "highway", "suburban"),
    accepts=("engine_friction",),
)
class FanClutchOnAndOff(Hidden):
    """The fan itself cools, and so does the wind of driving."""

    def prepare(self) -> None:
        rng = self.setting.rng(702)
        self.cools_cab = spells(rng, self.setting.batch, (8.0, 16.0), (25.0, 70.0))

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {"coolant": zero + 0.8 * self.p.on, "on": zero, "grips": zero.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        power = np.maximum(view.engine_torque, 0.0) * view.engine_speed / self.truck.peak_power
        wind = 1.0 + 0.3 * np.clip(view.speed / 20.0, 0.0, 1.3) + 0.9 * s.on
        s.coolant += dt * (1.3 * power - wind * s.coolant) / p.warms_s
        s.on = np.where(s.coolant > p.on, 1.0, np.where(s.coolant < p.off * p.on, 0.0, s.on))
        wanted = np.maximum(s.on, within(self.cools_cab, view.time))
        s.grips += dt * (wanted - s.grips) / 0.8
        torque = p.torque_nm * s.grips * (view.engine_speed / 200.0) ** 2
        return -wheel_force(self.setting, view, torque) * moving(view)
