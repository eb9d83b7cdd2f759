"""A wastegate that sticks, fuel that comes back hot, a flap that warms, ash, a sprayer's pump, and lifters
that pump up."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, moving
from deeptruck_exam.effects.places import OnRoad, smooth_stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law(
    "w_wastegate_sticks_open",
    needs="suburban hills",
    name="turbo_lag",
    accepts="command_rate_limit",
    shown=True,
)
@sizes(without=(0.18, 0.32), spools_s=(0.9, 1.8), slower=(2.0, 4.0), opens=(0.75, 0.95), shuts=(0.15, 0.35))
class WastegateSticksOpen(Hidden, boost=0.0, open=0.0):
    """`boost` over the most; much of it opens the wastegate, which sticks and shuts only after the boost has
    gone. A pull that follows upon a hard one builds its boost with half of the gas. without: of peak torque,
    with none; slower: times, with an open gate; opens, shuts: boost.
    Source: Galindo, Climent, Guardiola and Domenech, Modeling the Vacuum Circuit of a Pneumatic Valve System,
    J. Dyn. Sys. Meas. Control 131 (2009), and Thomasson, Eriksson, Leufven and Andersson, Wastegate Actuator
    Modeling and Model-Based Boost Pressure Control, IFAC E-COSM (2009), on friction in actuators; sizes are
    chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        goal = np.clip((asked - p.without) / (1.0 - p.without), 0.0, 1.1)
        flow = np.clip(view.engine_speed / 140.0, 0.4, 1.3)
        pushed = np.where(s.boost > p.opens, 1.0, np.where(s.boost < p.shuts, 0.0, np.rint(s.open)))
        s.open = s.open + dt * (pushed - s.open) / 0.5
        up = flow * (0.3 + s.boost) / (p.spools_s * (1.0 + (p.slower - 1.0) * s.open))
        rises = up * np.clip((goal - s.boost) / 0.15, 0.0, 1.0)
        s.boost = s.boost + dt * (rises + np.minimum(goal - s.boost, 0.0) / 0.7)
        lacks = np.maximum(goal - s.boost, 0.0) * (1.0 - p.without) * self.truck.peak_torque
        return -self.at_wheels(view, lacks) * moving(view)


@law("w_fuel_comes_back_hot", needs="hills highway", name="torque_derate", accepts="torque_gain", shown=True)
@sizes(thins=(0.18, 0.32), cuts=(0.3, 0.45), heats_s=(20.0, 55.0), cools_s=(70.0, 200.0), feels_s=(5.0, 20.0))
class FuelComesBackHot(Hidden):
    """`tank`, `pump`: heat of fuel, 0 as the air to about 1, where torque is cut. What the injectors return
    heats a tank that is nearly empty, the wind of driving cools it; thin fuel gives less, too hot fuel is
    protected. thins: of the torque, at 1; cuts: of it, beyond.
    Source: Bosch, Diesel Engine Management (2014), on return flow and power by fuel temperature; a tank that
    is nearly empty, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        first = self.rng(1141).uniform(0.2, 0.95, batch)
        return {"tank": first, "pump": first.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wind = 0.5 + np.clip(view.speed / 20.0, 0.0, 1.3)
        turns = 0.25 * np.clip(view.engine_speed / 150.0, 0.3, 1.5)
        gains = (turns + self.power_share(view)) / p.heats_s
        s.tank = np.clip(s.tank + dt * (gains - wind * s.tank / p.cools_s), 0.0, 1.6)
        s.pump = s.pump + dt * (s.tank - s.pump) / p.feels_s
        cut = p.thins * np.clip(s.pump, 0.0, 1.2) ** 2 + p.cuts * np.clip((s.pump - 0.9) / 0.25, 0.0, 1.0)
        return -self.at_wheels(view, np.minimum(cut, 0.7) * np.maximum(view.engine_torque, 0.0)) * moving(
            view
        )


@law("w_warm_up_flap", needs="descent hills suburban", name="engine_brake", accepts="engine_friction")
@sizes(
    share=(0.35, 0.6), warms_s=(60.0, 160.0), chills_s=(120.0, 300.0), moves_s=(0.3, 0.9), shy_s=(0.3, 1.0)
)
class WarmUpFlap(Hidden, shut=0.0, closed=0.0):
    """A flap in the exhaust holds the gas back while the engine is cool and nothing is asked of it; coasting
    cools it again, and two temperatures apart it opens and shuts. share: of the engine brake's torque.
    Source: Automotive Handbook (Bosch), on exhaust flaps as warm-up aids, and Mayer, Lutz, Lammle, Wyser and
    Legerer, Engine Intake Throttling for Active Regeneration of Diesel Particle Filters, SAE 2003-01-0381, on
    heat from throttling; temperatures are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(1142)
        first = rng.uniform(0.0, 1.0, batch)
        return {**super().start(batch), "warm": first, "calls": np.where(first < 0.8, 1.0, 0.0)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wind = 0.3 + np.clip(view.speed / 20.0, 0.0, 1.3)
        gains = (0.1 + 1.4 * self.power_share(view) + 0.3 * s.closed) / p.warms_s
        s.warm = np.clip(s.warm + dt * (gains - wind * s.warm / p.chills_s), 0.0, 1.3)
        s.calls = np.where(s.warm > 1.0, 0.0, np.where(s.warm < 0.8, 1.0, s.calls))
        s.shut = np.where(self.pedal(view) < 0.02, s.shut + dt, 0.0)
        wants = s.calls * (s.shut > p.shy_s) * np.clip((view.engine_speed - 75.0) / 15.0, 0.0, 1.0)
        s.closed = s.closed + dt * (wants - s.closed) / np.where(wants > s.closed, p.moves_s, 0.2)
        turns = np.clip(view.engine_speed / 180.0, 0.0, 1.3)
        torque = p.share * self.truck.engine_brake_torque * turns * s.closed
        return -self.at_wheels(view, torque) * moving(view)


@law("w_ash_holds_the_gas_back", name="engine_friction", accepts="engine_brake accessory_load")
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


@law(
    "w_sprays_by_the_metre", needs="highway suburban hills", name="accessory_load", accepts="engine_friction"
)
@sizes(kw=(35.0, 70.0), at_mps=(9.0, 14.0), opens_s=(0.5, 1.5), apart_m=(250.0, 800.0), idles=(0.1, 0.25))
class SpraysByTheMetre(OnRoad, sprays=0.0):
    """A sprayer gives each metre of the strips that are to be treated the same, so that its pump needs power
    with a power of speed, up to its relief valve. kw: of the pump, most; at_mps: where the valve opens;
    idles: of that, between.
    Source: Akesson and Yates, Pesticide Application Equipment and Techniques, FAO Agricultural Services
    Bulletin 38 (1979), on pressure with the square of ground speed at a constant rate; de-icing sprayers of
    airports, strips and sizes are chosen here."""

    def prepare(self) -> None:
        gaps = (0.4 * self.p.apart_m, 1.6 * self.p.apart_m)
        strips = smooth_stretches(self.rng(1144), self.rows(), gaps, (200.0, 900.0))
        self.road = np.where(strips > 0.15, 1.0, 0.0)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.sprays = s.sprays + dt * (self.read(self.road, view) - s.sprays) / p.opens_s
        rate = np.clip(view.speed / p.at_mps, 0.0, 1.0) ** 2.2
        watts = 1000.0 * p.kw * (p.idles + (1.0 - p.idles) * rate * s.sprays)
        torque = np.minimum(watts / np.maximum(view.engine_speed, 70.0), 450.0)
        return -self.at_wheels(view, torque) * moving(view)


@law("w_lifters_pump_up", needs="hills suburban highway descent", name="unknown")
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
