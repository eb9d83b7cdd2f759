"""Friction and pumping that gas brings: pipes, filters, rings, crankcases."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="engine_friction", accepts="engine_brake accessory_load")


@law("boundary_and_pumping", "second")
@sizes(rings_nm=(40.0, 110.0), pumping_nm=(60.0, 170.0), gas=(0.01, 0.04))
class BoundaryAndPumping(Hidden):
    """pumping_nm at 1800 rpm; gas: of the torque delivered.
    Source: Patton, Nitschke and Heywood, Development and Evaluation of a Friction Model, SAE 890836: ring
    friction in the boundary regime with 1 + 1000/rpm, pumping through intake and exhaust with speed squared,
    gas loading with cylinder pressure; sizes of a scuffed engine with a clogged filter."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        rpm = np.maximum(view.engine_speed, 55.0) * 30.0 / np.pi
        rings = p.rings_nm * (1.0 + 1000.0 / rpm)
        pumping = p.pumping_nm * (rpm / 1800.0) ** 2
        torque = rings + pumping + p.gas * np.maximum(view.engine_torque, 0.0)
        return -self.at_wheels(view, torque) * moving(view)


@law("t_flap_is_half_shut", "tenth")
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


@law("w_ash_holds_the_gas_back", "twelfth")
@sizes(nm=(70.0, 150.0), fills_s=(60.0, 200.0), burns_s=(15.0, 50.0), ash=(0.25, 0.5), power=(1.3, 2.0))
class AshHoldsTheGasBack(Hidden):
    """`soot` on a filter that ash has half filled: easy work lays it on, hard work burns it off. The engine
    pumps against what is left, with the flow. nm: at 150 rad/s, all soot; ash: of that, always.
    Source: Konstandopoulos, Skaperdas and Masoudi, Microstructural Properties of Soot Deposits in Diesel
    Particulate Traps, SAE 2002-01-1015, on pressure drop by soot, and Heywood, Internal Combustion Engine
    Fundamentals (1988), on pumping work; a trap that is overdue, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"soot": self.rng(1143).uniform(0.1, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        power = self.power_share(view)
        lays = (0.3 + power) / p.fills_s * (1.0 - s.soot)
        burns = s.soot * np.clip((power - 0.45) / 0.3, 0.0, 1.0) / p.burns_s
        s.soot = np.clip(s.soot + dt * (lays - burns), 0.0, 1.0)
        flow = np.clip(view.engine_speed / 150.0, 0.2, 1.6) * (0.7 + 0.5 * power)
        torque = p.nm * (p.ash + (1.0 - p.ash) * s.soot) * flow**p.power
        return -self.at_wheels(view, torque) * moving(view)


@law("k_rings_flutter", "fourteenth")
@sizes(nm=(120.0, 220.0), from_rads=(88.0, 106.0), loads=(0.3, 0.6), settles_s=(0.8, 2.5), wide=(0.08, 0.2))
class RingsFlutter(Hidden, flutter=0.0):
    """`flutter` of piston rings: above a speed their weight lifts them from their grooves wherever no gas
    presses them down, and they settle again late. Gas that passes and oil that is pumped cost torque. nm: at
    150 rad/s; loads: of from_rads, higher at full load.
    Source: Curtis, Piston Ring Dynamics and Its Influence on the Power Cylinder Performance, SAE 810935, on
    ring lift against gas pressure; worn grooves, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.0)
        bears = p.from_rads * (1.0 + p.loads * load) * (1.0 - 0.08 * s.flutter)
        wish = np.clip((view.engine_speed / bears - 1.0) / p.wide, 0.0, 1.0)
        s.flutter = eased(s.flutter, wish, np.where(wish > s.flutter, 0.3, p.settles_s), dt)
        torque = p.nm * s.flutter * np.clip(view.engine_speed / 150.0, 0.0, 1.5) ** 2
        return -self.at_wheels(view, torque) * moving(view)


@law("v_breather_is_iced", "sixteenth", accepts="accessory_load torque_gain")
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
