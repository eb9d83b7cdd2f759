"""Loads of solid bodies that move: what hangs, rolls, stands on its feet, rocks or leans."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, name="load_slosh")


@law("swinging_carcasses", "fifth", "suburban")
@sizes(share=(0.25, 0.45), length_m=(0.9, 1.7), room=(0.04, 0.12), stops=(3.0, 9.0))
class SwingingCarcasses(Hidden, angle=0.0, rate=0.0):
    """room: rad forward before all hang against each other; stops: stiffness there over gravity's.
    Source: Hanging meat is a known cause of roll-overs and surges (UK code of practice Safety of Loads on
    Vehicles, 2002): pendulums on a rail that strike their neighbours and the front wall, so that backward
    swing is free and forward swing is stopped; lengths and sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pressed = np.maximum(s.angle - p.room, 0.0)
        damping = np.where(pressed > 0.0, 5.0, 0.25)
        felt = np.clip(view.acceleration, -5.0, 5.0) * np.cos(s.angle)
        turning = -(GRAVITY * (np.sin(s.angle) + p.stops * pressed) + felt) / p.length_m - damping * s.rate
        s.rate = np.clip(s.rate + dt * turning, -4.0, 4.0)
        s.angle = np.clip(s.angle + dt * s.rate, -0.9, 0.6)
        return -p.share * view.mass * p.length_m * turning * np.cos(s.angle) * moving(view)


@law("loose_on_rollers", "sixth", "suburban")
@sizes(share=(0.25, 0.5), friction=(0.008, 0.022), room_m=(0.15, 0.9), bounces=(0.2, 0.6))
class LooseOnRollers(Hidden):
    """`at` m and `pace` m/s of the load on its bed, forward positive. bounces: damping of the stops over
    critical.
    Source: Roller beds of air cargo trucks whose locks were left open: units roll with the friction of the
    rollers alone (EN 12195-1 has friction of all other floors) and strike the stops at both ends; contact as
    a spring and damper (Goldsmith, Impact, 1960); masses and room are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"at": np.full(batch, -0.5 * self.p.room_m), "pace": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        over = s.at - np.clip(s.at, -0.5 * p.room_m, 0.5 * p.room_m)
        omega = 12.0  # rad/s, on rubber stops
        stops = -(omega**2) * over - 2.0 * p.bounces * omega * s.pace * (over != 0.0)
        rolls = -p.friction * GRAVITY * np.tanh(s.pace / 0.02)
        turning = stops + rolls - np.clip(view.acceleration, -5.0, 5.0) - GRAVITY * view.grade
        s.pace = np.clip(s.pace + dt * turning, -3.0, 3.0)
        s.at = s.at + dt * s.pace
        # what the load gains over the truck it does not push on the truck
        return -p.share * view.mass * np.clip(turning, -8.0, 8.0) * moving(view)


@law("s_cattle_step", "eighth", "suburban")
@sizes(share=(0.3, 0.55), hz=(0.3, 0.6), damping=(0.06, 0.2), stiffens=(2.0, 10.0))
class CattleStep(Hidden, way=0.0, rate=0.0):
    """share: of the mass. They lean softly at first, then against each other. stiffens: 1/m2.
    Source: Tarrant, Transportation of Cattle by Road, Applied Animal Behaviour Science 28 (1990): standing
    animals sway and step with braking; a hardening spring (Duffing), sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        omega = 2.0 * np.pi * p.hz
        spring = omega**2 * s.way * (1.0 + p.stiffens * s.way**2)
        driven = -spring - 2.0 * p.damping * omega * s.rate - np.clip(view.acceleration, -4.0, 4.0)
        s.rate = s.rate + dt * driven
        s.way = np.clip(s.way + dt * s.rate, -1.0, 1.0)
        return -p.share * view.mass * np.clip(driven, -4.0, 4.0) * moving(view)


@law("x_reels_rock_on_their_edges", "thirteenth", "suburban")
@sizes(share=(0.3, 0.45), slender=(0.02, 0.05), base_m=(0.35, 0.6), lands=(1.2, 2.5), room=(0.5, 0.8))
class ReelsRock(Hidden, x=0.0, v=0.0):
    """`x` m that the middle of tall reels is ahead of where it stands upright, `v` of that. They stand firm
    until a push goes beyond their slenderness; then they rock from edge to edge, the weaker held the farther
    they lean, and each landing takes energy. share: of the mass; slender: push over gravity that lifts an
    edge; room: of the lean that topples them, where the straps are.
    Source: Housner, The Behavior of Inverted Pendulum Structures during Earthquakes, Bulletin Seismological
    Society of America 53 (1963); reels of paper in straps, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -4.0, 4.0)
        lean = s.x / p.base_m
        holds = GRAVITY * p.slender * np.tanh(s.x / 0.02) * (1.0 - np.minimum(np.abs(lean), 1.0))
        straps = 45.0 * (s.x - np.clip(s.x, -p.room * p.base_m, p.room * p.base_m))
        lands = (0.3 + p.lands * np.exp(-((s.x / 0.04) ** 2)) + 4.0 * (straps != 0.0)) * s.v
        pace = np.clip(-felt - holds - straps - lands, -5.0, 5.0)
        s.v = np.clip(s.v + dt * pace, -2.5, 2.5)
        s.x = np.clip(s.x + dt * s.v, -p.base_m, p.base_m)
        return -p.share * view.mass * pace * moving(view)


@law("k_stack_leans", "fourteenth", "suburban")
@sizes(share=(0.35, 0.5), omega=(2.4, 4.0), left=(0.2, 0.4), yields_m=(0.04, 0.1), damps=(0.03, 0.08))
class StackLeans(Hidden, x=0.0, v=0.0, z=0.0):
    """`x` m that a stack of wrapped pallets leans ahead, `v` of that, `z` m of it that the wrapping holds
    before it slips. It gives, slips and stays leaning until it is pushed back. share: of the mass; omega:
    rad/s of its swing; left: of the stiffness, once it slips.
    Source: Wen, Method for Random Vibration of Hysteretic Systems, J. Engineering Mechanics Division 102
    (1976); stacks on a floor, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -4.0, 4.0)
        holds = p.omega**2 * (p.left * s.x + (1.0 - p.left) * s.z)
        before = s.v
        s.v = (s.v - dt * (felt + holds)) / (1.0 + dt * 2.0 * p.damps * p.omega)
        s.v = np.clip(s.v, -2.0, 2.0)
        slips = np.minimum(np.abs(s.z) / p.yields_m, 1.0) ** 2 * (0.5 + 0.5 * np.sign(s.v * s.z))
        s.x = np.clip(s.x + dt * s.v, -0.9, 0.9)
        s.z = np.clip(s.z + dt * s.v * (1.0 - slips), -p.yields_m, p.yields_m)
        pace = np.clip((s.v - before) / dt, -4.0, 4.0)
        return -p.share * view.mass * pace * moving(view)


@law("q_straps_work_loose", "fifteenth", "suburban")
@sizes(share=(0.35, 0.55), omega=(2.2, 3.6), rubs_mps2=(0.08, 0.2), loosens=(0.25, 0.6), most_m=(0.4, 0.8))
@sizes(damps=(0.05, 0.14))
class StrapsWorkLoose(Hidden, x=0.0, v=0.0, slack=0.04):
    """`x` m of a load that stands on its own wheels between straps, `v` of that; `slack` m that the straps
    give before they hold. Each time it runs into them they give a little more, so that it runs ever further
    before it is caught. share: of the mass; omega: rad/s, held; loosens: of the speed, as m of slack in a
    second; most_m: of slack.
    Source: VDI 2700, Securing of Loads on Road Vehicles, part 8 on cars, and EN 12195-1 on straps that lose
    their tension; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -4.0, 4.0)
        before, over = s.v, np.abs(s.x) - s.slack
        caught = over > 0.0
        stiff = np.where(caught, p.omega**2, 0.0)
        push = stiff * np.maximum(over, 0.0) * np.sign(s.x)
        rubs = p.rubs_mps2 * np.tanh(s.v / 0.05)
        damps = np.where(caught, 2.0 * p.damps * p.omega, 0.1)
        s.v = np.clip((s.v - dt * (felt + push + rubs)) / (1.0 + dt * damps + dt * dt * stiff), -2.5, 2.5)
        s.x = np.clip(s.x + dt * s.v, -1.5, 1.5)
        s.slack = np.minimum(s.slack + dt * p.loosens * np.abs(s.v) * caught, p.most_m)
        pace = np.clip((s.v - before) / dt, -4.0, 4.0)
        return -p.share * view.mass * pace * moving(view)


@law("v_pallets_shunt", "sixteenth", "suburban")
@sizes(share=(0.3, 0.5), gap_m=(0.2, 0.45), rubs=(0.015, 0.035), omega=(7.0, 12.0), dull=(0.15, 0.35))
class PalletsShunt(Hidden, a=0.0, b=0.0, c=0.0, va=0.0, vb=0.0, vc=0.0):
    """`a`, `b`, `c` m: of three rows of pallets on rollers, one behind the other, with room between them and
    before both walls; `va`, `vb`, `vc` of that. The last row runs into the next, and so on to the wall, as
    waggons are shunted: one push of the driver comes back as several blows. share: of the mass, all three;
    gap_m: of room, at each side of a row; rubs: of their weight; omega: rad/s of a touch; dull: of critical
    damping.
    Source: Cole, A Handbook of Vehicle-Track Dynamics (2006), on slack between waggons in trains, and VDI
    2700 on loads with gaps between them; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -4.0, 4.0)
        zero = np.zeros_like(felt)
        at, pace = np.stack([zero, s.a, s.b, s.c, zero]), np.stack([zero, s.va, s.vb, s.vc, zero])
        near = np.diff(at, axis=0)  # how far rows have parted; they touch at -gap_m
        over = np.maximum(-near - p.gap_m, 0.0)
        shut = np.clip(np.diff(pace, axis=0) * -1.0, 0.0, None) * (over > 0.0)
        presses = p.omega**2 * over + 2.0 * p.dull * p.omega * shut
        rubs = p.rubs * GRAVITY * np.tanh(pace[1:4] / 0.04)
        gains = -felt - rubs + presses[:3] - presses[1:]
        after = np.clip(pace[1:4] + dt * gains, -2.0, 2.0)
        mean = (after - pace[1:4]).mean(axis=0) / dt
        s.va, s.vb, s.vc = after
        s.a, s.b, s.c = (np.clip(x + dt * v, -1.5, 1.5) for x, v in zip(at[1:4], after, strict=True))
        return -p.share * view.mass * np.clip(mean, -4.0, 4.0) * moving(view)


@law("y_fish_in_crushed_ice", "eighteenth", "suburban")
@sizes(share=(0.3, 0.45), slips=(0.05, 0.09), stays=(0.02, 0.04), slides_s=(1.5, 3.5), long_m=(16.0, 26.0))
class FishInCrushedIce(Hidden, lies=0.0, runs=0.0, pace=0.0):
    """Fish in crushed ice lie still until their surface is too steep for what they feel. Then all of it
    slides, until it lies nearly level, and stops at once. `lies` g: the slope of the surface. `runs`: 1 while
    it slides. `pace` of the slope. share: of the mass; slips, stays: g beyond level, where it starts and
    stops; long_m: way of the load for a slope of 1.
    Source: Duran, Sands, Powders, and Grains (2000), on heaps with one angle at which they start and another
    where they stop; a slippery load, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        level = -np.clip(view.acceleration / GRAVITY + view.grade, -0.4, 0.4)
        off = level - s.lies
        s.runs = np.where(np.abs(off) > p.slips, 1.0, np.where(np.abs(off) < p.stays, 0.0, s.runs))
        before = s.pace
        s.pace = eased(s.pace, s.runs * off / (0.5 * p.slides_s), 0.25 * p.slides_s, dt)
        s.lies = np.clip(s.lies + dt * s.pace, -0.6, 0.6)
        push = -p.share * p.long_m * (s.pace - before) / dt
        return np.asarray(np.clip(push, -2.0, 2.0) * view.mass * moving(view))


@law("h_machine_stands_on_foam", "nineteenth", "suburban")
@sizes(share=(0.28, 0.42), soft_rads=(2.2, 3.6), hard_m=(0.12, 0.25), keeps=(0.3, 0.5), creeps_s=(1.5, 5.0))
@sizes(dull=(0.04, 0.1))
class MachineStandsOnFoam(Hidden, x=0.0, v=0.0, set=0.0):
    """A heavy machine is wedged into its box by foam, soft at first and hard once pressed. `x` m that it
    is ahead, `v` of that. `set` m: foam that has been pressed for a while stays so, and leaves the machine
    free to move on the way back. share: of the mass; hard_m: of pressing, from which it is hard; keeps: of
    the pressing; creeps_s: until it does.
    Source: Gibson and Ashby, Cellular Solids (1997), on foams that collapse, get dense and come back slowly,
    and Mustin, Theory and Practice of Cushion Design (1968); sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -3.0, 3.0)
        s.set = eased(s.set, p.keeps * s.x, p.creeps_s, dt)
        pressed = s.x - s.set
        spring = p.soft_rads**2 * pressed * (1.0 + (pressed / p.hard_m) ** 2)
        gains = -felt - spring - 2.0 * p.dull * p.soft_rads * s.v
        s.v = np.clip(s.v + dt * gains, -2.0, 2.0)
        s.x = np.clip(s.x + dt * s.v, -0.8, 0.8)
        return np.asarray(np.clip(-p.share * gains, -2.0, 2.0) * view.mass * moving(view))


@law("b_hook_is_let_down", "twentieth", "suburban")
@sizes(share=(0.25, 0.4), short_m=(0.8, 1.6), long_m=(4.5, 8.0), works_s=(8.0, 25.0), pace_mps=(0.3, 0.8))
@sizes(dull=(0.02, 0.06))
class HookIsLetDown(Hidden, lean=0.0, rate=0.0):
    """A load hangs from a crane on the truck, whose hook is let down and drawn up in spells. `rope` m: its
    swing is quick while it is short and slow while it is long, and grows as the rope is drawn in. `lean` rad
    ahead, `rate` of that. share: of the mass; pace_mps: of the hook.
    Source: Abdel-Rahman, Nayfeh and Masoud, Dynamics and Control of Cranes: A Review, J. Vibration and
    Control 9 (2003), on pendulums whose length changes; driving with it and sizes are chosen here."""

    def prepare(self) -> None:
        on, off = (0.5 * self.p.works_s, 1.5 * self.p.works_s), (0.5 * self.p.works_s, 1.5 * self.p.works_s)
        self.down = spells(self.rng(2052), self.setting.batch, on, off)

    def start(self, batch: int) -> dict[str, Array]:
        rope = self.rng(2053).uniform(self.p.short_m, self.p.long_m, batch)
        return {**super().start(batch), "rope": rope, "winds": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wish = np.where(within(self.down, view.time) > 0.5, p.long_m, p.short_m)
        s.winds = eased(s.winds, np.clip(wish - s.rope, -1.0, 1.0) * p.pace_mps, 0.5, dt)
        s.rope = np.clip(s.rope + dt * s.winds, 0.9 * p.short_m, 1.1 * p.long_m)
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -3.0, 3.0)
        own = np.sqrt(GRAVITY / s.rope)
        turns = -(GRAVITY * np.sin(s.lean) + felt * np.cos(s.lean) + 2.0 * s.winds * s.rate) / s.rope
        turns = turns - 2.0 * p.dull * own * s.rate
        s.rate = np.clip(s.rate + dt * turns, -1.5, 1.5)
        s.lean = np.clip(s.lean + dt * s.rate, -0.6, 0.6)
        pulls = GRAVITY * np.sin(s.lean) * np.cos(s.lean)
        return np.asarray(p.share * np.clip(pulls + felt, -2.5, 2.5) * view.mass * moving(view))


@law("u_clothes_slide_on_their_rail", "twenty-first", "suburban")
@sizes(share=(0.3, 0.45), long_m=(1.4, 2.6), sticks=(0.03, 0.06), room_m=(0.25, 0.6), dull=(0.04, 0.1))
@sizes(slides=(0.4, 1.0))
class ClothesSlideOnTheirRail(Hidden, lean=0.0, rate=0.0, at=0.0, stop=0.0):
    """Long bags hang on rails along the truck. They swing, and where they pull on their hooks too much these
    slide along the rail, to its stop; while they slide the truck feels no more than their friction. `lean`
    rad ahead, `rate` of that; `at` m of the hooks. share: of the mass; sticks: pull over weight from which
    hooks slide; slides: m/s, for each m/s2 beyond; room_m: of the rail, either way.
    Source: Nayfeh and Mook, Nonlinear Oscillations (1979), on pendulums, and Armstrong-Hélouvry, Dupont and
    Canudas de Wit, A Survey of Models of Machines with Friction, Automatica 30 (1994); sizes are chosen
    here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -3.0, 3.0)
        own = np.sqrt(GRAVITY / p.long_m)
        pulls = GRAVITY * np.sin(s.lean) * np.cos(s.lean)  # of the bags on their hooks, forwards
        over = pulls - np.clip(pulls, -GRAVITY * p.sticks, GRAVITY * p.sticks)
        moved = s.at + dt * np.clip(p.slides * over, -1.0, 1.0)
        s.at = np.clip(moved, -p.room_m, p.room_m)
        s.stop = eased(s.stop, np.where(np.abs(moved) > p.room_m, 1.0, 0.0), 0.15, dt)
        turns = -(GRAVITY * np.sin(s.lean) + felt * np.cos(s.lean)) / p.long_m - 2.0 * p.dull * own * s.rate
        s.rate = np.clip(s.rate + dt * turns, -1.5, 1.5)
        s.lean = np.clip(s.lean + dt * s.rate, -0.6, 0.6)
        rail = pulls - over * (1.0 - s.stop)
        return np.asarray(p.share * np.clip(rail + felt, -2.5, 2.5) * view.mass * moving(view))
