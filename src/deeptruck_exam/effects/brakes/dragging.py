"""Brakes that hold when nobody brakes."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, index, moving, weight
from deeptruck_exam.effects.places import Bends
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, name="dragging_brake")
MANY = 97  # throws of dice for each drive


@law("dragging_brake", "first", "suburban descent")
@sizes(floor_n=(300.0, 900.0), stuck_n=(900.0, 3000.0), ease_s=(12.0, 45.0), swell=(0.1, 0.5))
class DraggingBrake(Hidden, stuck=0.0, heat=0.0):
    """Source: Residual shoe force of a sticking S-cam (Limpert, Brake Design and Safety, describes air brake
    adjustment); the decay after each application and the swelling with heat are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        applied = np.clip(view.brake_force / 2.0e4, 0.0, 1.0)
        s.stuck = np.maximum(s.stuck * (1.0 - dt / p.ease_s), p.stuck_n * applied)
        drag = (p.floor_n + s.stuck) * (1.0 + p.swell * s.heat)
        s.heat += dt * (drag * view.speed / 4.0e6 - s.heat / 200.0)
        return -drag * moving(view)


@law("spring_brakes_creep", "second", "suburban descent")
@sizes(hold_bar=(5.6, 6.4), per_bar_n=(2200.0, 4500.0), use_bar=(0.10, 0.25), refill_s=(20.0, 45.0))
class SpringBrakesCreep(Hidden):
    """Every application draws air; the faster the engine turns, the sooner the shoes let go. use_bar: for
    each second of firm braking.
    Source: Spring brakes apply when their air falls short (Limpert, Brake Design and Safety, on spring
    brakes; FMVSS 121 S5.1 on the compressor's build-up with engine speed); leak and numbers are chosen
    here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"air": self.rng(104).uniform(4.8, 6.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        used = p.use_bar * np.clip(view.brake_force / 2.5e4, 0.0, 1.5)
        refill = np.clip(view.engine_speed / 130.0, 0.4, 1.6) * (7.5 - s.air) / p.refill_s
        s.air = np.clip(s.air + dt * (refill - used - 0.012), 3.5, 7.5)
        short = np.maximum(p.hold_bar - s.air, 0.0)
        return -p.per_bar_n * np.minimum(short, 1.5) * moving(view)


@law("leaks_into_the_chambers", "sixth", "suburban descent hills")
@sizes(force=(0.011, 0.023), gathers_s=(4.0, 12.0), seated_s=(2.0, 9.0), opens=(0.1, 0.4))
class LeaksIntoTheChambers(Hidden):
    """The longer nobody has braked, the more it drags. force: of the weight; seated_s: the mean; no two
    applications seat it alike; opens: of the leak, below which the chamber's spring holds the shoes off.
    Source: The recall of 2013 of Bendix ATR-6 traction relay valves, which leaked inside in the cold and let
    brakes drag: air gathers in the chambers while nobody brakes, and every application blows it off and seats
    the valve for a while (Limpert, Brake Design and Safety, on relay and quick release valves); times and
    forces are chosen here."""

    def prepare(self) -> None:
        dice = self.rng(504).exponential(1.0, (self.setting.batch, 128))
        self.seated = self.p.seated_s * np.clip(dice, 0.2, 3.0)

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {"air": zero, "since": zero.copy(), "count": np.zeros(batch, int)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        braked = view.brake_force > 0.004 * weight(view)
        s.count = (s.count + (braked & (s.since > 0.0))) % 128
        s.since = np.where(braked, 0.0, s.since + dt)
        tight = self.seated[np.arange(len(s.count)), s.count]
        s.air += dt * np.where(braked, -s.air / 0.3, (s.since > tight) * (1.0 - s.air) / p.gathers_s)
        pressed = np.maximum(s.air - p.opens, 0.0) / (1.0 - p.opens)
        return -p.force * pressed * weight(view) * moving(view)


@law("held_back_by_the_release_valve", "seventh", "suburban descent hills")
@sizes(kept=(0.010, 0.024), opens_per_s=(0.05, 0.16), bleeds_s=(10.0, 40.0))
class HeldBackByTheReleaseValve(Hidden, was=0.0, pace=0.0, kept=0.0):
    """What counts is how fast the last part of a brake force went, not how large it was. kept: of the weight;
    opens_per_s: of the weight and second, release that opens it well.
    Source: FMVSS 121 S5.3.4 on release times, and Limpert, Brake Design and Safety, on quick release valves:
    one opens only against a difference of pressure, so that a brake let go gently keeps some air, and one let
    go at once does not; the rest leaves through a bleed."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        force = view.brake_force / weight(view)
        s.pace += dt * (np.maximum(s.was - force, 0.0) / dt - s.pace) / 0.5
        presses = force > 0.004
        stays = p.kept * np.exp(-s.pace / p.opens_per_s)
        s.kept = np.where(presses, stays, s.kept * (1.0 - dt / p.bleeds_s))
        s.was = force
        return -s.kept * weight(view) * ~presses * moving(view)


@law("n_fluid_is_trapped", "ninth", "suburban descent hills")
@sizes(most=(0.014, 0.026), heats_jpkg=(50.0, 180.0), feeds=(0.4, 1.1), cools_s=(25.0, 80.0))
class FluidIsTrapped(Hidden, hot=0.0):
    """most: of the weight; feeds: how far its own drag keeps it hot, over what it loses at 15 m/s.
    Source: Limpert, Brake Design and Safety, on compensating ports: where one stays shut, fluid that warms
    cannot go back and holds the brakes on, which warms it more; rates and sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        braked = view.brake_force * speed / (p.heats_jpkg * view.mass)
        itself = p.feeds * s.hot * speed / 15.0 / p.cools_s
        cools = s.hot * (0.5 + 0.5 * speed / 15.0) / p.cools_s
        s.hot = np.clip(s.hot + dt * ((braked + itself) * (1.0 - s.hot) - cools), 0.0, 1.0)
        return -p.most * s.hot * weight(view) * moving(view)


@law("e_cable_is_too_short", "eleventh", "suburban descent")
@sizes(drags=(0.008, 0.016), tight=(0.1, 0.5), squats=(0.5, 1.1), bumps=(0.3, 0.6), grows_jpkg=(150.0, 500.0))
class CableIsTooShort(Hidden, travel=0.0, pace=0.0, grown=0.0):
    """`travel` of the axle pulls the cable of the parking brake: by pull, slope and bumps, on springs. The
    drag warms the drum, which grows away from its shoes. drags: of the weight, for a travel of 1; tight: at
    rest; squats: for 1 m/s2 along the frame; grows_jpkg: work for each kg of truck.
    Source: Gillespie, Fundamentals of Vehicle Dynamics (1992), on squat and bounce, and Limpert, Brake Design
    and Safety, on cables of parking brakes; sizes are chosen here."""

    def prepare(self) -> None:
        shape = (self.setting.batch, int(self.setting.duration_s / 0.1) + 20)
        self.bumps = ou_series(self.rng(1012), shape, 0.1, 0.8)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        along = np.clip(view.acceleration + GRAVITY * view.grade, -2.5, 2.5)
        rough = p.bumps * self.bumps[:, index(view, self.bumps, 0.1)] * np.clip(view.speed / 12.0, 0.0, 1.5)
        omega = 2.0 * np.pi * 1.2
        s.pace = s.pace + dt * (omega**2 * (p.squats * along + rough - s.travel) - 0.7 * omega * s.pace)
        s.travel = np.clip(s.travel + dt * s.pace, -3.0, 3.0)
        pulls = np.clip(p.tight + s.travel - s.grown, 0.0, 2.0)
        work = p.drags * GRAVITY * pulls * np.maximum(view.speed, 0.0)
        s.grown = np.clip(s.grown + dt * (work / p.grows_jpkg - s.grown / 150.0), 0.0, 1.0)
        return -p.drags * pulls * weight(view) * moving(view)


@law("w_bends_knock_it_off", "twelfth", "suburban descent hills")
@sizes(drags=(0.007, 0.015), sets=(0.02, 0.06), knocks=(0.15, 0.5), eases_m=(900.0, 3000.0))
class BendsKnockItOff(Bends, near=0.5):
    """`near`: 1 where the pads lie on the disc with all of `drags`. Each braking sets them there; hubs that
    bend under the side force of a curve push them away, and smooth straights hardly do. drags: of the weight;
    sets: brake over weight at which they are set in a second; knocks: 1/m, at 1 m/s2 aside.
    Source: Breuer and Bill, Brake Technology Handbook (SAE, 2008), on residual torque and knock-back of pads
    by elastic hubs; pins that rust, bends and sizes are chosen here."""

    def prepare(self) -> None:
        self.bend = self.draw_bends(self.rng(1113), 0.02)

    def start(self, batch: int) -> dict[str, Array]:
        return {"near": self.rng(1114).uniform(0.2, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        aside = np.minimum(speed**2 * np.abs(self.read(self.bend, view)), 2.5)
        set_per_s = np.minimum(view.brake_force / weight(view) / p.sets, 2.0)
        away = speed * (p.knocks * 0.02 * aside**2 + 1.0 / p.eases_m)
        s.near = np.clip(s.near + dt * (set_per_s * (1.0 - s.near) - away * s.near), 0.0, 1.0)
        return -p.drags * s.near * weight(view) * moving(view)


@law("x_iron_stays_magnetic", "thirteenth", "suburban descent hills")
@sizes(most=(0.016, 0.028), peak_mps=(5.0, 11.0), full=(0.04, 0.1), shakes_m=(300.0, 1200.0))
@sizes(turns=(0.3, 0.7))
class IronStaysMagnetic(Hidden):
    """`kept`: magnetism of a retarder's iron, of the most. Each braking drives a current that leaves its
    mark, a hard one a strong mark, a gentle one wipes part of it out; shaking over the way loosens it. The
    rotor then turns in a field that nobody asked for. most: of the weight; full: brake over weight that
    saturates; turns: of `kept` that a gentle current wipes out, in a second.
    Source: Bozorth, Ferromagnetism (1951), on remanence and minor loops, and Wouterse, IEE Proc. B 138
    (1991), on eddy torque over speed; a retarder on the brake pedal, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"kept": self.rng(1312).uniform(0.2, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        current = np.clip(view.brake_force / weight(view) / p.full, 0.0, 1.3)
        marks = np.tanh(1.5 * current)
        grows = 3.0 * np.maximum(marks - s.kept, 0.0) * (current > 0.02)
        wipes = p.turns * s.kept * np.where((current > 0.02) & (marks < 0.6 * s.kept), 1.0, 0.0)
        speed = np.maximum(view.speed, 0.0)
        s.kept = np.clip(s.kept + dt * (grows - wipes - speed * s.kept / p.shakes_m), 0.0, 1.0)
        slip = speed / p.peak_mps
        return -p.most * s.kept * weight(view) * 2.0 * slip / (1.0 + slip**2) * moving(view)


@law("k_foot_rests_on_the_pedal", "fourteenth", "suburban descent hills")
@sizes(most=(0.012, 0.022), stays_s=(25.0, 90.0), tense_s=(6.0, 20.0), kicks=(0.55, 0.8), lifts_s=(3.0, 8.0))
class FootRestsOnThePedal(Hidden):
    """`rests`: a left foot that stays on the brake pedal after it has braked, lighter and lighter, below what
    the switch of the pedal tells; a driver who treads on the accelerator firmly takes it away. How tense he
    is comes and goes. most: of the weight; kicks: of the full pedal, that takes the foot away.
    Source: AAMVA, Model Commercial Driver License Manual, against riding the brakes; times and sizes are
    chosen here."""

    def prepare(self) -> None:
        shape = (self.setting.batch, int(self.setting.duration_s / 0.5) + 20)
        self.tense = 0.65 + 0.35 * np.tanh(ou_series(self.rng(1411), shape, 0.5, self.p.tense_s))

    def start(self, batch: int) -> dict[str, Array]:
        return {"rests": self.rng(1412).uniform(0.2, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        brakes = np.clip(view.brake_force / weight(view) / 0.02, 0.0, 1.0)
        kicked = self.pedal(view) > p.kicks
        wish = np.where(brakes > 0.3, 1.0, 0.0)
        s.rests = eased(
            s.rests, wish, np.where(brakes > 0.3, 0.8, np.where(kicked, p.lifts_s, p.stays_s)), dt
        )
        tense = self.tense[:, index(view, self.tense, 0.5)]
        return -p.most * s.rests * tense * (1.0 - brakes) * weight(view) * moving(view)


@law("q_hand_brake_half_released", "fifteenth", "suburban", accepts="rolling_resistance")
@sizes(
    most=(0.016, 0.03), often=(0.6, 0.85), heats_jpkg=(40.0, 120.0), cools_s=(30.0, 90.0), softens=(1.0, 2.5)
)
@sizes(rests_s=(1.5, 3.0))
class HandBrakeHalfReleased(Hidden, still=0.0, hot=0.0):
    """`pulls`: of a hand brake behind the gearbox, that was set at a stand and not quite let off. Each stand
    leaves something else, often nothing. Its small drum grows hot in a moment and then holds less. most: of
    the weight, cold; often: of stands, after which something is left; softens: of the grip, when hot.
    Source: Limpert, Brake Design and Safety, on parking brakes at the driveshaft, and AAMVA, Model Commercial
    Driver License Manual, on releasing the parking brake; sizes are chosen here."""

    def prepare(self) -> None:
        dice = self.rng(1512).random((self.setting.batch, MANY))
        self.leaves = np.where(dice < self.p.often, 0.35 + 0.65 * dice / self.p.often, 0.0)

    def start(self, batch: int) -> dict[str, Array]:
        first = np.resize(self.leaves[:, 0], batch)
        return {**super().start(batch), "pulls": first, "stands": np.ones(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        before, s.still = s.still, np.where(view.speed < 0.2, s.still + dt, 0.0)
        sets = (before <= p.rests_s) & (s.still > p.rests_s)
        row = np.arange(len(view.speed)) % len(self.leaves)
        s.pulls = np.where(sets, self.leaves[row, s.stands.astype(int)], s.pulls)
        s.stands = np.where(sets, (s.stands + 1.0) % MANY, s.stands)
        holds = p.most * s.pulls / (1.0 + p.softens * s.hot)
        work = 9.81 * holds * np.maximum(view.speed, 0.0) / p.heats_jpkg
        s.hot = np.clip(s.hot + dt * (work - s.hot / p.cools_s), 0.0, 3.0)
        return -holds * weight(view) * moving(view)


@law("z_pendulum_brakes_the_trailer", "seventeenth", "suburban hills")
@sizes(most=(0.012, 0.02), least=(0.001, 0.003), tips=(0.012, 0.03), full=(0.05, 0.1), swings_rads=(1.5, 3.5))
@sizes(dull=(0.15, 0.4))
class PendulumBrakesTheTrailer(Hidden, angle=0.0, pace=0.0):
    """`angle` of a pendulum in a box that brakes a trailer by magnets. It should hang still until the driver
    brakes. Worn, it tips forwards as soon as the truck loses speed by itself or the road goes down, swings
    after each change, and never lets go wholly. most, least: of the weight, full and always; tips, full: g
    of slowing or slope, where it begins and where it brakes wholly.
    Source: Tekonsha and Hayes, electric brake controllers with pendulums, installation guides on levelling
    them, and Limpert, Brake Design and Safety; a worn one, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        leans = -(view.acceleration / GRAVITY + view.grade)
        push = p.swings_rads**2 * (np.clip(leans, -0.3, 0.3) - s.angle)
        s.pace = s.pace + dt * (push - 2.0 * p.dull * p.swings_rads * s.pace)
        s.angle = np.clip(s.angle + dt * s.pace, -0.3, 0.3)
        opens = np.clip((s.angle - p.tips) / (p.full - p.tips), 0.0, 1.0)
        return -(p.least + (p.most - p.least) * opens**1.3) * weight(view) * moving(view)


@law("h_disc_buckles", "nineteenth", "suburban hills descent")
@sizes(
    most=(0.009, 0.015), warm_jpkg=(25.0, 60.0), evens_s=(15.0, 40.0), buckles=(0.2, 0.4), jumps_s=(1.0, 3.0)
)
class DiscBuckles(Hidden, outside=0.0):
    """`outside`: heat of a disc's rim over that of its hub. Where that is too much the disc buckles and waves
    between its pads, also when nobody brakes. `wave` of the disc, which comes within seconds once it can, and
    goes as the heat evens out. most: of the weight, with a wave of 1; warm_jpkg: work of brakes for a rim
    heat of 1; buckles: heat at which it begins.
    Source: Timoshenko and Gere, Theory of Elastic Stability (1961), on plates with hot rims, and Limpert,
    Brake Design and Safety (1999), on discs that warp; thin discs, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "wave": self.rng(1913).uniform(0.05, 0.7, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        work = view.brake_force * np.maximum(view.speed, 0.0) / view.mass
        rubs = 0.25 * s.wave**2 * np.clip(view.speed / 15.0, 0.0, 1.5)
        s.outside = np.clip(s.outside + dt * (work / p.warm_jpkg + (rubs - s.outside) / p.evens_s), 0.0, 2.0)
        over = np.clip((s.outside - p.buckles) / p.buckles, -0.4, 1.0)
        s.wave = np.clip(s.wave + dt * (over - s.wave**2) * s.wave / p.jumps_s, 0.03, 1.2)
        return -p.most * np.maximum(s.wave - 0.03, 0.0) * weight(view) * moving(view)


@law("b_seals_slip_on_their_pistons", "twentieth", "suburban hills descent")
@sizes(most=(0.01, 0.017), gives=(0.025, 0.06), shakes_m=(150.0, 500.0), rough=(0.5, 1.5))
class SealsSlipOnTheirPistons(Hidden):
    """The seal of a piston bends with it and draws it back by that much. Beyond it the piston slips through:
    after a firm braking the pads stay at their disc, and a light one leaves them as they are. Only the way
    shakes them off. `slipped` of full braking, that the seal has let through. most: of the weight; gives: of
    full braking, that the seal can draw back.
    Source: Breuer and Bill, Brake Technology Handbook (SAE, 2008), on roll-back of seals, and Visintin,
    Differential Models of Hysteresis (1994), on play; stiff seals, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"slipped": self.p.gives * self.rng(2012).uniform(0.0, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        s.slipped = np.clip(s.slipped, asked - p.gives, asked + p.gives)
        harsh = 1.0 + p.rough * np.minimum(np.abs(view.acceleration), 2.0)
        off = 1.0 - dt * harsh * np.maximum(view.speed, 0.0) / p.shakes_m
        s.slipped = np.maximum(s.slipped, 0.0) * off
        touches = np.clip((s.slipped - asked) / p.gives, 0.0, 1.0)
        return -p.most * np.sqrt(touches + 1e-9) * weight(view) * moving(view)
