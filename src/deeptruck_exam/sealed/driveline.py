"""Pressure kept for a kick, springs that stick, gears kept out by rough roads, and oil out of its balance;
a rotor with gears, silicone, and rubber tracks."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, sections
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("z_pressed_for_the_last_kick", needs="hills suburban", name="driveline_loss", accepts="torque_gain")
@sizes(nm=(200.0, 320.0), least=(0.02, 0.1), keeps_s=(4.0, 12.0), at_rads=(120.0, 160.0), power=(0.3, 0.8))
class PressedForTheLastKick(Hidden, kick=0.3):
    """`kick`: the highest torque of late, over the peak. A gearbox presses its plates and belts for that, and
    its pump works against this pressure also when nothing is asked any more. It is let down slowly. nm: at
    the engine, pressed for full torque; least: of that, always; keeps_s: until the pressure is let down.
    Source: ZF and Allison, main pressure that is modulated by torque, and Bonsen, Efficiency Optimization of
    the Push-Belt CVT by Variator Slip Control (2006), on losses by much clamping; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asks = np.clip(np.abs(view.engine_torque) / self.truck.peak_torque, 0.0, 1.0)
        s.kick = np.where(asks > s.kick, eased(s.kick, asks, 0.15, dt), eased(s.kick, asks, p.keeps_s, dt))
        turns = np.clip(view.engine_speed / p.at_rads, 0.4, 1.6) ** p.power
        return -self.at_wheels(view, p.nm * (p.least + (1.0 - p.least) * s.kick) * turns) * moving(view)


@law("z_springs_stick_in_their_arc", needs="suburban hills", name="driveline_backlash")
@sizes(wide=(0.06, 0.12), at_rads=(120.0, 160.0), loose_s=(0.15, 0.4), slips=(0.05, 0.15))
class SpringsStickInTheirArc(Hidden, held=0.0):
    """`held`: torque of the long springs in a flywheel. The faster it turns, the harder they lie in their arc
    and stick there, so torque has to change by a wide step before anything moves behind them. What is held
    creeps slowly. wide: of peak torque, to either side, at at_rads; loose_s: until what is beyond has come;
    slips: of what is held, lost in a second.
    Source: Reik, Fidlin and Seebacher, Gute Schwingungen, böse Schwingungen, VDI Berichte 2077 (2009), and
    LuK, The Dual Mass Flywheel, on arc springs whose friction grows with speed; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = np.clip(view.engine_speed / p.at_rads, 0.4, 1.4)
        wide = p.wide * turns**2 * self.truck.peak_torque
        near = np.clip(s.held, view.engine_torque - wide, view.engine_torque + wide)
        s.held = eased(s.held, near, p.loose_s, dt)
        s.held = eased(s.held, view.engine_torque, 1.0 / p.slips, dt)
        return self.at_wheels(view, s.held - view.engine_torque) * np.clip(view.speed, 0.0, 1.0)


@law("z_rough_roads_keep_it_out", needs="suburban hills", name="shift_interruption", accepts="torque_limit")
@sizes(least_s=(0.2, 0.4), more_s=(0.8, 1.6), power=(1.0, 2.0), ramps_s=(0.5, 1.1), mean_m=(150.0, 600.0))
class RoughRoadsKeepItOut(OnRoad, gear=0.0, left=0.0, gives=1.0):
    """Wheels that jump on a rough road shake the gearbox, and its control waits for a calm moment before it
    lets teeth meet. So a change takes the longer, the rougher the road and the faster the truck; on smooth
    roads it takes its usual time. least_s, more_s: without torque, on a smooth road and on a rough one more;
    power: of that with roughness.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on synchronising with a
    driveline that shakes, and ISO 8608 on classes of roughness; sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1731)
        number = sections(rng, self.rows(), self.p.mean_m)
        rough = rng.uniform(0.0, 1.0, (self.rows(), int(number.max()) + 1))
        self.road = np.take_along_axis(rough, number, axis=1)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        begins = (view.gear != s.gear) & (s.gear > 0.0) & (view.speed > 0.5)
        s.gear = view.gear.copy()
        shakes = self.read(self.road, view) ** p.power * np.clip(view.speed / 10.0, 0.2, 1.5)
        s.left = np.where(begins, p.least_s + p.more_s * shakes, np.maximum(s.left - dt, 0.0))
        s.gives = np.clip(s.gives + dt * np.where(s.left > 0.0, -1.0 / 0.12, 1.0 / p.ramps_s), 0.0, 1.0)
        return -(1.0 - s.gives) * np.maximum(view.traction_force, 0.0) * moving(view)


@law(
    "z_oil_flies_out_of_balance",
    needs="suburban hills highway",
    name="torque_converter_slip",
    accepts="driveline_loss",
    trucks="freightliner",
    gateable=False,
)
@sizes(holds=(0.9, 1.15), off_rads=(195.0, 225.0), soft=(0.08, 0.18), frees=(0.4, 0.7), heats_s=(3.0, 9.0))
class OilFliesOutOfBalance(Hidden, glazed=0.0):
    """The oil behind a lock-up clutch's piston flies outwards with the turning engine and presses against it.
    So the clutch holds less torque, the faster the engine turns, by the square. What is more slips away, and
    the slip leaves its plates hot and weaker for a while. holds: of peak torque, at rest; off_rads: where
    nothing is held; frees: of the torque that holds back, lost above half of that.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on clutch pistons, their
    rotating oil and how it is balanced; a leaking balance, sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        peak = self.truck.peak_torque
        turns = np.clip(view.engine_speed / p.off_rads, 0.0, 1.0) ** 2
        holds = np.maximum(p.holds * (1.0 - turns) * (1.0 - 0.3 * s.glazed), 0.12) * peak
        pulls, back = np.maximum(view.engine_torque, 0.0), np.maximum(-view.engine_torque, 0.0)
        over = pulls - holds
        slips = 0.5 * (over + np.sqrt(over**2 + (p.soft * peak) ** 2)) * np.minimum(pulls / (0.2 * peak), 1.0)
        slips = np.clip(slips, 0.0, 0.45 * pulls)
        s.glazed = eased(s.glazed, np.clip(slips / (0.15 * peak), 0.0, 1.0), p.heats_s, dt)
        lets = p.frees * np.clip(2.0 * turns - 0.4, 0.0, 1.0) * back
        return self.at_wheels(view, lets - slips) * np.clip(view.speed - 1.0, 0.0, 1.0)


@law(
    "z_rotor_changes_its_gear", needs="suburban hills", name="rotating_inertia", accepts="mass payload_change"
)
@sizes(low=(0.14, 0.24), ratio=(0.35, 0.6), up_mps=(10.0, 14.0), down=(0.6, 0.85), takes_s=(1.2, 3.0))
class RotorChangesItsGear(Hidden, spin=-1.0, felt=0.0, high=0.0):
    """`spin` m/s of a heavy rotor that the wheels drive through two gears of its own. Below one speed it runs
    fast and is felt as a large mass, above that it runs slowly and is felt as a small one. As it changes
    gear it first pushes the truck, and takes that back when it changes down. low: of the truck's mass, as
    felt in the fast gear; ratio: of the slow gear over it; down: of up_mps.
    Source: Genta, Kinetic Energy Storage (1985), on flywheels behind gears that are changed, and Srivastava,
    Goering and Rohrbach, Engineering Principles of Agricultural Machines (1993); sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        fresh, down = s.spin < 0.0, speed < p.down * p.up_mps
        s.high = np.where(speed > p.up_mps, 1.0, np.where(down, 0.0, s.high))
        ratio = np.where(s.high > 0.5, p.ratio, 1.0)
        wish = ratio * speed
        after = np.where(fresh, wish, eased(s.spin, wish, np.where(s.high > 0.5, 0.5, 0.25) * p.takes_s, dt))
        gains = np.where(fresh, 0.0, np.clip((after - s.spin) / dt, -2.5, 2.5))
        s.spin = np.where(fresh, wish, s.spin + dt * gains)
        s.felt = eased(s.felt, ratio * gains, 0.1, dt)
        return -p.low * view.mass * s.felt * moving(view)


@law("z_silicone_humps", needs="suburban highway hills", name="unknown")
@sizes(most=(0.0022, 0.0036), hump=(4.0, 5.5), heats_s=(8.0, 20.0), cools_s=(12.0, 35.0), ends=(0.35, 0.6))
@sizes(thins=(0.3, 0.6), power=(0.5, 0.8))
class SiliconeHumps(Hidden, locks=0.0, humps=0.0):
    """`hot`: silicone between the plates of a coupling that joins two axles with unlike tyres. Their slip
    shears it all the time, and it thins as it warms. At 1 it fills its housing, presses the plates together
    and drags far more, until it has cooled. most: of the weight, cold, at 15 m/s; hump: times that, pressed;
    ends: of `hot`; thins: of the drag, lost when hot.
    Source: Taureg and Horst, Induced Torque Amplification in Viscous Couplings, SAE 900557 (1990), on the
    hump; tyres of two makes, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "hot": self.rng(1732).uniform(0.1, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slip = np.clip(view.speed / 15.0, 0.0, 1.7)
        s.locks = np.where(s.hot > 1.0, 1.0, np.where(s.hot < p.ends, 0.0, s.locks))
        s.humps = eased(s.humps, s.locks, 1.2, dt)
        work = slip ** (1.0 + p.power) * (1.0 - s.humps) + 0.1 * s.humps
        s.hot = np.clip(s.hot + dt * (1.6 * work / p.heats_s - s.hot / p.cools_s), 0.0, 1.2)
        drag = (1.0 - p.thins * np.minimum(s.hot, 1.0)) * (1.0 + (p.hump - 1.0) * s.humps)
        return -p.most * drag * slip**p.power * weight(view) * moving(view)


@law("z_rubber_tracks", needs="suburban hills", name="unknown")
@sizes(
    bends=(0.08, 0.15), stiff=(0.001, 0.003), flaps=(0.01, 0.016), from_mps=(6.0, 10.0), slack=(0.015, 0.035)
)
@sizes(warms_s=(30.0, 90.0))
class RubberTracks(Hidden, tight=0.0, flap=0.0):
    """`tight`: pull over weight in rubber tracks in place of the driven wheels. Tight rubber is hard to bend
    round its wheels, so that each pull and push costs a share of itself. A slack track flaps above a speed,
    and `flap` takes time to grow and to die. `warm` rubber bends more easily. bends: of the pull; stiff,
    flaps: of the weight; slack: of it, the pull that ends flapping.
    Source: Wong, Theory of Ground Vehicles (2008), on internal losses of tracks by tension and speed, and
    Mattracks, conversions of trucks to rubber tracks; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "warm": self.rng(1733).uniform(0.0, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        pull = np.clip(np.abs(view.traction_force) / weight(view), 0.0, 0.15)
        s.tight = eased(s.tight, pull, 0.3, dt)
        s.warm = eased(s.warm, np.clip(speed / 15.0, 0.0, 1.2), p.warms_s, dt)
        slack = np.clip(1.0 - s.tight / p.slack, 0.0, 1.0)
        s.flap = eased(s.flap, slack * np.clip((speed - p.from_mps) / 5.0, 0.0, 1.0), 0.8, dt)
        cost = (p.stiff + p.bends * s.tight) * (1.0 - 0.4 * np.minimum(s.warm, 1.0)) + p.flaps * s.flap
        return -cost * weight(view) * moving(view)
