"""Play of axles, chains and couplings behind the gearbox."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="driveline_backlash")


@law("t_chain_hangs", "tenth", "suburban hills")
@sizes(slack=(0.005, 0.012), hangs_s=(0.4, 1.0), hz=(1.2, 2.5), damping=(0.12, 0.3))
class ChainHangs(Hidden, pull=0.0, felt=0.0, rate=0.0):
    """`pull`: what the chain carries; soft while it hangs, hard once it is taut, and the axle swings behind
    it. slack: of the weight, the pull at which it is neither; hangs_s: to gather it up.
    Source: Irvine, Cable Structures (1981): the stiffness of a sagging span grows with the cube of its
    tension; chain-driven axles with a slack chain, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        taut = np.minimum(np.abs(s.pull) / (p.slack * weight(view)), 4.0)
        pace = dt * (1.0 + taut**3) / p.hangs_s
        s.pull = s.pull + (view.traction_force - s.pull) * pace / (1.0 + pace)
        omega = 2.0 * np.pi * p.hz
        s.rate = s.rate + dt * (omega**2 * (s.pull - s.felt) - 2.0 * p.damping * omega * s.rate)
        s.felt = s.felt + dt * s.rate
        most = 0.12 * weight(view)
        return np.clip(s.felt - view.traction_force, -most, most) * moving(view)


@law("w_claws_are_worn", "twelfth", "suburban hills")
@sizes(play=(0.35, 0.6), soft=(0.03, 0.07), crosses_s=(0.18, 0.4), hardens=(1.5, 4.0))
class ClawsAreWorn(Hidden, twist=0.0):
    """`twist` of a coupling with rubber between its claws, 1 at the end of soft rubber. Where the rubber is
    gone there is play, through which it is pushed against its grease by whatever pull there is. play: of the
    twist, either side; soft: pull over weight at a twist of 1; hardens: of the rubber, with its square.
    Source: Nestorides, A Handbook on Torsional Vibration (1958), on couplings whose rubber stiffens, and Kim,
    Rook and Singh, Super- and Sub-harmonic Response Calculations for a Torsional System with Clearance
    Nonlinearity Using the Harmonic Balance Method, J. Sound Vibration 281 (2005); sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = view.traction_force / weight(view)
        beyond = s.twist - np.clip(s.twist, -p.play, p.play)
        carries = p.soft * beyond * (1.0 + p.hardens * beyond**2)
        rate = np.clip((pull - carries) / p.soft, -4.0, 4.0) / p.crosses_s
        s.twist = np.clip(s.twist + dt * rate * 0.6, -2.5, 2.5)
        return np.asarray((carries - pull) * weight(view) * np.clip(view.speed, 0.0, 1.0))


@law("x_both_axles_must_touch", "thirteenth", "suburban hills")
@sizes(first=(0.5, 1.0), second=(1.4, 2.6), gathers=(8.0, 18.0), rubs_s=(0.25, 0.6), winds_s=(0.1, 0.25))
class BothAxlesMustTouch(Hidden, one=1.0, two=1.0, runs=0.0, given=0.0):
    """Two driven axles behind an open differential, each with a play of its own. `one`, `two`: -1 and 1 where
    their teeth touch; `runs`: pace through the plays. Until the second has touched the first has no more pull
    than it, which is none. first, second: length of the plays; gathers: pace won in a second, by a pull of a
    tenth of the weight.
    Source: Nordin and Gutman, Controlling Mechanical Systems with Backlash - a Survey, Automatica 38 (2002),
    and Wong, Theory of Ground Vehicles (2008), on tandem axles with an inter-axle differential; sizes are
    chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = view.traction_force
        push = np.clip(10.0 * pull / weight(view), -1.0, 1.0)
        s.runs = s.runs + dt * (p.gathers * push - s.runs / p.rubs_s)
        s.one = np.clip(s.one + dt * s.runs / p.first, -1.0, 1.0)
        s.two = np.clip(s.two + dt * s.runs / p.second, -1.0, 1.0)
        both = (s.one * np.sign(pull) > 0.98) & (s.two * np.sign(pull) > 0.98)
        s.given = s.given + dt * (both * pull - s.given) / np.where(both, p.winds_s, 0.04)
        return np.asarray((s.given - pull) * np.clip(view.speed, 0.0, 1.0))


@law("k_locker_crosses_over", "fourteenth", "suburban hills")
@sizes(way_m=(10.0, 24.0), pushes=(0.6, 1.5), winds_s=(0.15, 0.35), opens_s=(0.08, 0.15))
class LockerCrossesOver(Hidden, at=1.0, given=0.0):
    """`at`: -1 and 1 where the claws of a locking differential hold for holding back and for driving. When
    the torque turns, cams have to cross over: wheels do that as they roll, over a way, and a hard pull helps;
    until the claws have met nothing is passed on. way_m: of half the crossing; pushes: of it, in a second by
    a tenth of the weight.
    Source: Eaton, Detroit Locker and NoSPIN Differential, Owner's Manual, on the change from drive to coast;
    a worn one, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = view.traction_force
        side = np.clip(pull / (0.002 * weight(view)), -1.0, 1.0)
        hard = np.clip(10.0 * np.abs(pull) / weight(view), 0.0, 1.0)
        crosses = np.maximum(view.speed, 0.0) / p.way_m + p.pushes * hard
        s.at = np.clip(s.at + dt * side * crosses, -1.0, 1.0)
        holds = np.clip((s.at * side - 0.7) / 0.3, 0.0, 1.0)
        s.given = eased(s.given, holds * pull, np.where(holds > 0.0, p.winds_s, p.opens_s), dt)
        return np.asarray((s.given - pull) * np.clip(view.speed, 0.0, 1.0))


@law("v_play_by_the_turn", "sixteenth", "suburban hills")
@sizes(wide_s=(0.35, 0.7), uneven=(0.5, 0.9), turn_m=(6.0, 30.0), winds_s=(0.1, 0.25), hard=(0.03, 0.06))
class PlayByTheTurn(Hidden, x=0.0, turn=0.0, given=0.0):
    """`x`: -1 and 1 where the teeth of two eccentric wheels touch. Their play is wide on one side of the
    `turn` and narrow on the other. Two wheels of nearly equal count come back to the same pair of teeth
    after many turns only. So the time without torque depends on where torque turns. wide_s: across the mean
    play, with a pull of `hard` of the weight; turn_m: way of the truck, until it repeats.
    Source: Niemann and Winter, Maschinenelemente II (2003), on run-out of gears and on tooth pairs that
    meet again; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "turn": self.rng(1632).uniform(0.0, 2.0 * np.pi, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = view.traction_force
        s.turn = s.turn + 2.0 * np.pi * dt * np.maximum(view.speed, 0.0) / p.turn_m
        play = p.wide_s * (1.0 + p.uneven * np.sin(s.turn))
        push = np.sqrt(np.minimum(np.abs(pull) / weight(view) / p.hard, 4.0)) + 0.1
        s.x = np.clip(s.x + 2.0 * dt * np.sign(pull) * push / play, -1.0, 1.0)
        touches = s.x * np.sign(pull) >= 1.0
        s.given = eased(s.given, np.where(touches, pull, 0.0), np.where(touches, p.winds_s, 0.04), dt)
        return np.asarray((s.given - pull) * np.clip(view.speed, 0.0, 1.0))


@law("y_many_small_plays", "eighteenth", "suburban hills")
@sizes(narrow=(0.02, 0.04), wide=(0.16, 0.26), creeps_s=(8.0, 25.0), takes_s=(0.1, 0.3))
class ManySmallPlays(Hidden, passed=0.0):
    """Many joints, and each has a play of its own that friction holds, narrow ones and wide ones. Torque that
    turns round has to cross one after the other, so little is missing after a small change and much after a
    large one. `plays`: where each has stopped. narrow, wide: of peak torque.
    Source: Krasnosel'skii and Pokrovskii, Systems with Hysteresis (1989), on sums of plays; joints and
    sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "plays": np.zeros((5, batch))}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        peak = self.truck.peak_torque
        wide = (np.linspace(p.narrow, p.wide, 5) * peak)[:, None]
        s.plays = np.clip(s.plays, view.engine_torque - wide, view.engine_torque + wide)
        s.plays = eased(s.plays, np.broadcast_to(view.engine_torque, s.plays.shape), p.creeps_s, dt)
        s.passed = eased(s.passed, s.plays.mean(axis=0), p.takes_s, dt)
        return self.at_wheels(view, s.passed - view.engine_torque) * np.clip(view.speed, 0.0, 1.0)


@law("b_bushes_are_torn", "twentieth", "suburban hills")
@sizes(swings_rads=(5.0, 9.0), dull=(0.1, 0.25), share=(0.85, 1.0))
class BushesAreTorn(Hidden, bent=0.0, pace=0.0):
    """Rubber bushes of a torn coupling give way freely about their middle and get stiff with the cube of how
    far they are `bent`: without torque there is nothing that holds them. Each time the torque turns round it
    arrives late, and then with a swing that is the faster, the harder the pull. swings_rads: at peak torque.
    Source: Nayfeh and Mook, Nonlinear Oscillations (1979), on springs of the third power, and
    makers' notes on rubber discs of propeller shafts; torn ones, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, -0.5, 1.1)
        steps = max(1, round(dt / 0.01))
        for _ in range(steps):
            push = p.swings_rads**2 / 3.0 * (asked - s.bent**3)
            s.pace = s.pace + dt / steps * (push - 2.0 * p.dull * p.swings_rads * s.pace)
            s.bent = np.clip(s.bent + dt / steps * s.pace, -1.3, 1.3)
        lacks = np.clip(asked - s.bent**3, -0.6, 0.9) * self.truck.peak_torque
        return -p.share * self.at_wheels(view, lacks) * np.clip(view.speed, 0.0, 1.0)


@law("u_torque_rods_are_worn", "twenty-first", "suburban hills")
@sizes(crosses=(0.035, 0.06), least_s=(0.35, 0.6), share=(0.8, 1.0), returns=(0.3, 0.6), gives_s=(0.15, 0.4))
class TorqueRodsAreWorn(Hidden, at=1.0, owed=0.0):
    """The rods that hold the driven axle have torn bushes. `at`: -1 and 1 where the axle lies against its
    stops, behind and ahead. Whenever pull turns to braking, by engine or by linings, it creeps across, and
    the truck feels nothing of the force meanwhile. Then it strikes, and gives part of that back at once.
    crosses: force over weight, for which least_s are needed from the middle; returns: what the blow gives.
    Source: Fancher, Ervin, MacAdam and Winkler, Measurement and Representation of the Mechanical Properties
    of Truck Leaf Springs, SAE 800905, on axles that are wound and moved by torque; torn bushes, sizes are
    chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        force = np.clip((view.traction_force - view.brake_force) / weight(view), -0.15, 0.15)
        was = s.at
        s.at = np.clip(s.at + dt * np.clip(force / p.crosses, -1.5, 1.5) / p.least_s, -1.0, 1.0)
        free = np.clip((1.0 - np.abs(s.at)) / 0.1, 0.0, 1.0)
        lacks = p.share * free * force
        struck = (np.abs(s.at) >= 1.0) & (np.abs(was) < 1.0)
        gives = np.where(np.abs(s.at) >= 1.0, s.owed * p.returns / p.gives_s, 0.0)
        s.owed = np.where(struck, s.owed, np.where(free > 0.0, s.owed + dt * lacks, s.owed - dt * gives))
        s.owed = np.clip(s.owed, -0.06, 0.06) * np.where(free > 0.0, 1.0, np.exp(-dt / p.gives_s))
        felt = np.clip(gives, -0.06, 0.06) - lacks
        return felt * weight(view) * np.clip(view.speed, 0.0, 1.0)
