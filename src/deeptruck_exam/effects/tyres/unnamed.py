"""Tyres and axles in ways the tool has no name for."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, index, moving, weight
from deeptruck_exam.effects.places import Bends, OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, name="unknown")


@law("cornering_scrub", "first", "suburban hills")
@sizes(stiffness_n=(1.2e6, 2.5e6), tandem=(3.0, 8.0), sharpest=(0.015, 0.035))
class CurveResistance(Hidden):
    """sharpest: 1/m at walking pace; drivers keep lateral acceleration below 2.5 m/s2.
    Source: Mitschke and Wallentowitz, Dynamik der Kraftfahrzeuge (2014): curve resistance with lateral force
    squared over cornering stiffness; scrub of a tandem with curvature alone is chosen here."""

    def prepare(self) -> None:
        noise = ou_series(self.rng(30), (self.setting.batch, int(self.setting.duration_s) + 2), 1.0, 6.0)
        self.bend = np.maximum(np.abs(noise) - 0.7, 0.0)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        bend = self.bend[:, index(view, self.bend)]
        curvature = np.minimum(p.sharpest * bend, 2.5 / np.maximum(view.speed, 3.0) ** 2)
        lateral = view.mass * view.speed**2 * curvature
        scrub = p.tandem * 0.7 * weight(view) * curvature * 0.08
        return -(lateral**2 / p.stiffness_n + scrub) * moving(view)


@law("tyre_pressure_loss", "first")
@sizes(gain=(0.8, 1.8), leak_m=(900.0, 2500.0), puncture_share=(0.1, 0.5))
class SlowPuncture(Hidden):
    """Source: Rolling loss with a power of pressure, as corrections in ISO 28580 take it; a leak over
    distance and the flexing of a flat tyre of a pair are chosen here."""

    def prepare(self) -> None:
        self.from_m = self.rng(34).uniform(0.0, 2.0, self.setting.batch) * 2500.0 * self.p.puncture_share

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        since = np.maximum(view.distance - self.from_m, 0.0)
        pressure = 0.12 + 0.88 * np.exp(-since / p.leak_m)
        growth = p.gain * (pressure**-0.6 - 1.0)
        return -growth * self.truck.rolling_resistance * weight(view) * moving(view)


@law("packed_wheel_arches", "third")
@sizes(most=(0.008, 0.018), packs_m=(250.0, 700.0), mean_m=(500.0, 1300.0), left=(0.0, 0.3))
class PackedWheelArches(Hidden):
    """A saw tooth over the way, other teeth in every drive.
    Source: Growth with the way and loss by chance, a renewal process (Cox, Renewal Theory, 1962): slush and
    mud pack the wheel arches until they rub, and fall off in lumps; a driver's report, not a book's; sizes
    are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(261), self.setting.batch
        self.falls = np.cumsum(rng.exponential(self.p.mean_m, (batch, 60)) + 80.0, axis=1)
        self.first = rng.uniform(0.0, 0.9, batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"packed": self.first.copy(), "fallen": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        fallen = (self.falls < view.distance[:, None]).sum(axis=1).astype(float)
        s.packed = np.where(fallen > s.fallen, p.left * s.packed, s.packed)
        s.fallen = fallen
        s.packed += dt * np.maximum(view.speed, 0.0) * (1.0 - s.packed) / p.packs_m
        return -p.most * s.packed * weight(view) * moving(view)


@law("misaligned_lift_axle", "fourth", "suburban hills highway")
@sizes(toe_deg=(1.6, 2.8), stiffness=(7.0, 12.0), share=(0.50, 0.75), down_mps=(5.0, 9.0))
@sizes(up_load=(0.34, 0.55))
class MisalignedLiftAxle(Hidden, asked=0.0, up=0.0, height=0.0):
    """While it is up the truck rolls freely. stiffness: 1/rad, of its load; share: of the weight, on the
    group with the lift axle.
    Source: Axles out of square drag by side force times toe (TMC RP 642 on total vehicle alignment; linear
    cornering stiffness, Pacejka, Tyre and Vehicle Dynamics, 2012); a lift axle that is lowered at road speed
    and raised by the traction aid when much is asked; toe and stiffness are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        s.asked += dt * (load - s.asked) / 1.5
        lower = (s.asked < 0.45 * p.up_load) & (view.speed > p.down_mps)
        s.up = np.where(s.asked > p.up_load, 1.0, np.where(lower, 0.0, s.up))
        s.height += np.clip(s.up - s.height, -dt / 6.0, dt / 3.0)
        toe = np.deg2rad(p.toe_deg)
        drag = min(p.stiffness * toe, 0.6) * np.sin(toe) * p.share * weight(view)
        return -drag * (1.0 - np.clip(1.6 * s.height, 0.0, 1.0)) * moving(view)


@law("wanders_in_its_lane", "fifth", "highway hills")
@sizes(slip_rad=(0.014, 0.026), stiffness=(6.0, 10.0), bouts_s=(12.0, 40.0), from_mps=(5.0, 9.0))
class WandersInItsLane(Hidden):
    """stiffness: of all axles over weight, 1/rad.
    Source: Steering with play and tired drivers: corrections come in bouts and drag with slip angle squared
    times cornering stiffness (Wierwille and others, Research on Vehicle-Based Driver Status Monitoring, DOT
    HS 808 247, 1994, on steering reversals; Wong, Theory of Ground Vehicles); sizes chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(474), self.setting.batch
        slots = int(self.setting.duration_s / 0.1) + 20
        fast = ou_series(rng, (batch, slots), 0.1, 0.9)
        bouts = ou_series(rng, (batch, slots), 0.1, self.p.bouts_s)
        self.slip = self.p.slip_rad * fast * np.exp(0.9 * np.clip(bouts, -2.0, 1.4))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slip = np.clip(self.slip[:, index(view, self.slip, 0.1)], -0.06, 0.06)
        fades = np.clip(view.speed / p.from_mps - 0.5, 0.0, 1.0)
        return -p.stiffness * slip**2 * fades * weight(view)


@law("liquid_in_the_tyres", "sixth", "suburban hills")
@sizes(pool=(0.010, 0.020), coats_mps=(11.0, 17.0), falls=(0.55, 0.8), settles_s=(1.0, 4.0))
class LiquidInTheTyres(Hidden, coats=0.0, pool=1.0):
    """Slow driving costs, fast driving does not; in between it depends on what was before. pool: of the
    weight; falls: of that speed.
    Source: Liquid in a turning drum lies in a pool that the wall drags round until, above a speed, it coats
    the wall and turns along; on the way down it stays there longer and then falls (Thoroddsen and Mahadevan,
    Experimental Study of Coating Flows in a Partially-Filled Horizontally Rotating Cylinder, Exp. Fluids 23,
    1997); ballasted tyres and sealant, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        fallen = view.speed < p.falls * p.coats_mps
        s.coats = np.where(view.speed > p.coats_mps, 1.0, np.where(fallen, 0.0, s.coats))
        s.pool += dt * (1.0 - s.coats - s.pool) / p.settles_s
        drags = np.sqrt(np.clip(view.speed / p.coats_mps, 0.0, 1.5))
        return -p.pool * s.pool * drags * weight(view) * moving(view)


@law("s_bearing_runs_hot", "eighth", "highway hills suburban")
@sizes(drag=(0.004, 0.008), grows=(1.0, 2.5), heats_m=(800.0, 2500.0), cools_s=(40.0, 120.0))
class BearingRunsHot(Hidden):
    """drag: of the weight, cold. Way heats it by its own drag; standing and slow ways cool it.
    Source: Takabi and Khonsari, Experimental Testing and Thermal Analysis of Ball Bearings, Tribology
    International 60 (2013): heat takes up clearance, and preload makes heat; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"heat": self.rng(835).uniform(0.0, 0.4, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        tight = 1.0 + p.grows * s.heat**2
        gains = np.maximum(view.speed, 0.0) * tight / p.heats_m
        s.heat = np.clip(s.heat + dt * (gains - s.heat / p.cools_s * 1.5), 0.0, 1.3)
        drag = np.minimum(p.drag * tight, 0.2) * view.mass * GRAVITY
        return -drag * moving(view)


@law("e_rear_steer_stays_turned", "eleventh", "suburban hills highway")
@sizes(drags=(0.010, 0.022), rubs=(0.3, 0.6), shakes_m=(250.0, 900.0), length_m=(6.0, 12.0))
class RearSteerStaysTurned(Bends, turned=0.0):
    """A steered rear axle follows a bend and is held by its rusty pivots where it was left, until shaking or
    a bend the other way brings it back; the truck drives on askew. drags: of the weight, askew by half; rubs:
    of the full angle, that friction holds.
    Source: LeBlanc, El-Gindy and Woodrooffe, Self-Steering Axles: Theory and Practice, SAE 891980: centring
    against friction decides what is left of an angle; drag with its square; sizes are chosen here."""

    def prepare(self) -> None:
        self.bend = self.draw_bends(self.rng(1073), 1.0)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = self.setting.direction * self.read(self.bend, view)
        way = dt * np.maximum(view.speed, 0.0)
        goal = np.clip(s.turned, asked - p.rubs, asked + p.rubs)
        s.turned = s.turned + np.minimum(way / p.length_m, 1.0) * (goal - s.turned)
        s.turned = s.turned - way / p.shakes_m * (s.turned - asked)
        return -p.drags * (s.turned - asked) ** 2 / 0.25 * weight(view) * moving(view)


@law("e_power_hop", "eleventh", "suburban hills")
@sizes(from_pull=(0.018, 0.035), hops=(0.4, 0.75), lost=(0.2, 0.4), hz=(1.0, 1.8), grows=(1.2, 3.0))
class PowerHop(Hidden, x=0.05, v=0.0):
    """Under a hard pull the driven axle winds up on its springs, lets go and winds up again; it dies away as
    the pull falls. `x` of its swing, a limit cycle. from_pull: over weight; hops: of the pull, at full swing;
    lost: of it, in the mean.
    Source: Zoz and Grisso, Traction and Tractor Performance, ASAE Distinguished Lecture 27 (2003), on power
    hop, and Strogatz, Nonlinear Dynamics and Chaos (2015), on limit cycles; worn torque rods of a truck,
    sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = np.maximum(view.traction_force, 0.0)
        beyond = np.clip(pull / (p.from_pull * weight(view)) - 1.0, -1.0, 1.0)
        omega = 2.0 * np.pi * p.hz * (1.0 - 0.15 * np.clip(beyond, 0.0, 1.0))
        size = s.x**2 + (s.v / omega) ** 2
        feeds = p.grows * (beyond - size)
        s.v = np.clip(s.v + dt * (-(omega**2) * s.x + feeds * s.v), -20.0, 20.0)
        s.x = np.clip(s.x + dt * s.v, -1.5, 1.5)
        kept = np.clip(0.03 / np.maximum(np.sqrt(size), 1e-6), 1.0, 3.0)  # roads never let it rest
        s.x, s.v = s.x * kept, s.v * kept
        swings = np.clip((size - 0.01) / 0.05, 0.0, 1.0)
        share = swings * (p.hops * s.x - p.lost * np.minimum(size, 1.5))
        return pull * np.clip(share, -0.95, 0.9) * moving(view)


@law("w_steers_as_it_bounces", "twelfth", "suburban hills descent")
@sizes(toe=(0.001, 0.008), dives=(0.045, 0.07), rolls=(0.0, 0.2), stiff=(6.0, 10.0), hz=(0.9, 1.4))
@sizes(share=(0.6, 0.95))
class SteersAsItBounces(Hidden, travel=0.0, pace=0.0):
    """`travel` of the front springs, 1 at 1 m/s2 of braking. Worn links turn the wheels in and out with it,
    and wheels that do not roll straight drag with the square of their angle. toe: rad at rest, either way;
    dives: rad for a travel of 1; stiff: 1/rad of their load; share: of the weight on such wheels.
    Source: Gillespie, Fundamentals of Vehicle Dynamics (1992), on steering geometry error and toe change by
    ride; trucks with several steered axles, sizes are chosen here."""

    def prepare(self) -> None:
        self.side = self.rng(1174).choice([-1.0, 1.0])

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        along = np.clip(view.acceleration + GRAVITY * view.grade, -3.0, 3.0)
        omega = 2.0 * np.pi * p.hz
        s.pace = s.pace + dt * (omega**2 * (-along - s.travel) - 0.45 * omega * s.pace)
        s.travel = np.clip(s.travel + dt * s.pace, -4.0, 4.0)
        angle = self.side * p.toe + p.dives * s.travel
        drag = p.stiff * angle**2 / (1.0 + p.rolls + (angle / 0.06) ** 2)
        return -p.share * np.minimum(drag, 0.07) * weight(view) * moving(view)


@law("x_chains_are_left_on", "thirteenth", "suburban hills descent highway")
@sizes(rolls=(0.008, 0.015), beats=(0.008, 0.016), lifts_mps=(11.0, 16.0), slack=(0.2, 0.5))
@sizes(stretches_m=(900.0, 3000.0), snow=(0.25, 0.5), stretch_m=(300.0, 1200.0))
class ChainsAreLeftOn(OnRoad, still=0.0):
    """`loose`: of the chains on driven wheels, which stretch over the way until somebody tightens them at a
    stand. Links that are rolled over cost their bending; loose ones lift off and beat the arches beyond a
    speed. On snow links sink in and cost little. rolls, beats: of the weight; slack: of `loose`, left by who
    tightens; snow: share of the road.
    Source: ONORM V 5119 on snow chains of heavy vehicles (speed, fit and tightening again), and Wong, Theory
    of Ground Vehicles (2008), on work of obstacles under tyres; sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1374), self.rows(), self.p.stretch_m, self.p.snow)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "loose": self.rng(1375).uniform(0.1, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.still = np.where(speed < 0.2, s.still + dt, 0.0)
        s.loose = np.where(s.still > 5.0, np.minimum(s.loose, p.slack), s.loose)
        s.loose = s.loose + dt * speed * (1.0 - s.loose) / p.stretches_m
        snow = 1.0 - 0.8 * self.between(self.road, view)
        lifts = np.clip((speed - p.lifts_mps * (1.3 - 0.6 * s.loose)) / 3.0, 0.0, 1.0)
        costs = p.rolls * (1.0 - 0.5 * lifts) * snow + p.beats * lifts * s.loose
        return -costs * weight(view) * np.clip(speed / 1.5, 0.0, 1.0)


@law("k_tyre_rubs_its_arch", "fourteenth", "suburban hills descent")
@sizes(most=(0.016, 0.03), room=(0.35, 0.6), squats=(0.25, 0.5), leans=(0.4, 0.7), wears_s=(60.0, 200.0))
@sizes(bumps_s=(0.6, 1.5))
class TyreRubsItsArch(Bends, worn=0.0):
    """A tyre too large for its arch touches it when springs give way: in bends, under brakes or pull, and on
    bumps. Rubbing wears the arch away and makes room. most: of the weight; room: of the travel; squats:
    travel for each m/s2 along; leans: for each m/s2 aside.
    Source: Cebon, Handbook of Vehicle-Road Interaction (1999), on travel of truck suspensions, and Archard's
    law of wear in Stachowiak and Batchelor, Engineering Tribology (2013); bends and sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1475)
        self.bend = np.abs(self.draw_bends(rng, 0.015))
        shape = (self.setting.batch, int(self.setting.duration_s / 0.1) + 20)
        self.bumps = ou_series(rng, shape, 0.1, self.p.bumps_s)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        aside = np.minimum(speed**2 * self.read(self.bend, view), 2.0)
        bumps = 0.12 * self.bumps[:, index(view, self.bumps, 0.1)] * np.clip(speed / 15.0, 0.0, 1.2)
        travel = p.squats * np.minimum(np.abs(view.acceleration), 1.5) + p.leans * aside + bumps
        rubs = np.clip(travel - p.room * (1.0 + 0.6 * s.worn), 0.0, 1.0)
        s.worn = np.clip(s.worn + dt * rubs * speed / 15.0 * (1.0 - s.worn) / p.wears_s, 0.0, 1.0)
        return -p.most * np.sqrt(rubs + 1e-4) * (rubs > 0.0) * weight(view) * np.clip(speed, 0.0, 1.0)


@law("q_tread_peels_off", "fifteenth", "highway hills")
@sizes(most=(0.018, 0.03), grows_s=(8.0, 25.0), holds_m=(300.0, 1500.0), flies=(0.7, 1.0), stays=(0.0, 0.1))
class TreadPeelsOff(Hidden, way=0.0):
    """`strip`: of a retread that has come off its casing, 1 once around. It tears the faster, the faster the
    tyre turns, beats the road and the air, and flies off in the end. The next piece holds for a while.
    most: of the weight, at 20 m/s, once around; flies: of `strip`, where it tears off; holds_m: until the
    next one begins.
    Source: NHTSA, Commercial Medium Tire Debris Study, DOT HS 811 060 (2008), on belts and treads that come
    off; times and sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(1573)
        waits = self.p.holds_m * rng.uniform(-0.3, 1.0, batch)
        return {**super().start(batch), "waits": waits, "strip": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        pace = np.minimum(speed / 20.0, 1.3)
        s.way = s.way + dt * speed
        begun = s.way > s.waits
        s.strip = np.where(begun, s.strip + dt * pace**3 * (0.15 + 0.85 * s.strip) / p.grows_s, s.strip)
        off = s.strip > p.flies
        s.strip = np.where(off, p.stays, np.minimum(s.strip, 1.0))
        s.waits = np.where(off, s.way + p.holds_m, s.waits)
        return -p.most * s.strip * pace**2 * weight(view) * moving(view)


@law("v_nuts_are_loose", "sixteenth", "suburban hills")
@sizes(most=(0.015, 0.025), notch=(0.25, 0.5), hard=(0.02, 0.04), seats_s=(6.0, 18.0), power=(1.0, 1.8))
class NutsAreLoose(Hidden, side=0.0):
    """`wobbles`: of wheels whose nuts are loose. Each time the torque turns round they shift on their studs
    and sit askew, and roll with a wobble that costs with speed; a firm pull in one direction draws them
    straight again. most: of the weight, at 15 m/s, quite askew; notch: of that, by one turn; hard: of the
    weight, a torque that counts; seats_s: under firm pull.
    Source: Bailey and Bertoch, Mechanisms of Wheel Separations, SAE 2009-01-0111, on clamp that is lost and
    wheels that shift under alternating torque; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "wobbles": self.rng(1673).uniform(0.1, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        force = (view.traction_force - view.brake_force) / weight(view)
        side = np.where(np.abs(force) > 0.4 * p.hard, np.sign(force), s.side)
        turns = (side != s.side) & (s.side != 0.0)
        s.side = side
        s.wobbles = np.where(turns, s.wobbles + p.notch * (1.0 - s.wobbles), s.wobbles)
        firm = np.clip((np.abs(force) - 0.5 * p.hard) / (0.5 * p.hard), 0.0, 2.0)
        s.wobbles = eased(s.wobbles, 0.0, p.seats_s / np.maximum(firm, 1e-3), dt)
        pace = np.minimum(np.maximum(view.speed, 0.0) / 15.0, 1.6) ** p.power
        return -p.most * s.wobbles * pace * weight(view) * moving(view)
