"""Play of the driveline, and the shuffle after it is taken up."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="driveline_backlash")


@law("driveline_backlash", "first", "suburban hills")
@sizes(gap_s=(0.15, 0.5), shuffle_hz=(1.5, 3.0), damping=(0.10, 0.25), clonk=(0.3, 0.7))
class DeadZone(Hidden, side=1.0, since=99.0, jump=0.0):
    """Source: Lagerberg and Egardt, IEEE Trans. Control Syst. Technol. 15 (2007): dead zone at torque
    reversal, then a damped shuffle of 2-4 Hz when the teeth meet."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        side = np.where(np.abs(view.traction_force) > 200.0, np.sign(view.traction_force), s.side)
        crossed = side != s.side
        s.since = np.where(crossed, 0.0, s.since + dt)
        s.side = side
        open_now = s.since < p.gap_s
        s.jump = np.where(open_now, view.traction_force, s.jump)
        t = s.since - p.gap_s
        omega = 2.0 * np.pi * p.shuffle_hz
        size = np.clip(s.jump, -0.08 * weight(view), 0.08 * weight(view))
        ring = p.clonk * size * np.exp(-p.damping * omega * t) * np.cos(omega * t)
        return np.where(open_now, -view.traction_force, np.where(t < 4.0, ring, 0.0)) * moving(view)


@law("play_is_crossed", "second", "suburban hills")
@sizes(play_rad=(0.8, 2.2), wind_up_s=(0.10, 0.35), knock=(0.3, 0.9))
class PlayIsCrossed(Hidden, side=1.0, way=0.0, rate=0.0, share=1.0, hit=0.0):
    """Time without torque is the longer the gentler the torque turns; play_rad is at the flywheel.
    Source: Nordin and Gutman, Controlling Mechanical Systems with Backlash, Automatica 38 (2002): the play is
    crossed by integrating the speed of the free side, then shafts wind up; angles of a worn heavy driveline,
    chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        side = np.where(np.abs(view.traction_force) > 50.0, np.sign(view.traction_force), s.side)
        s.way = np.where(side != s.side, p.play_rad, s.way)
        s.side = side
        free = s.way > 0.0
        push = np.abs(view.engine_torque) / self.truck.engine_inertia
        s.rate = np.where(free, s.rate + dt * np.clip(push, 4.0, 150.0), 0.0)
        before = s.way
        s.way = np.maximum(s.way - dt * s.rate, 0.0)
        meets = (before > 0.0) & (s.way == 0.0)
        s.hit = np.where(meets, s.rate, s.hit * (1.0 - dt / 0.06))
        s.share = np.where(s.way > 0.0, 0.0, s.share + dt * (1.0 - s.share) / p.wind_up_s)
        knock = p.knock * self.truck.engine_inertia * s.hit * view.ratio / self.truck.wheel_radius / 0.06
        knock = np.minimum(knock, 0.06 * 9.81 * view.mass)
        return ((s.share - 1.0) * view.traction_force + s.side * knock * (s.way == 0.0)) * moving(view)


@law("two_masses_and_play", "third", "suburban hills")
@sizes(play_rad=(0.9, 2.2), hz=(1.0, 2.0), damping=(0.04, 0.10), gentle_s=(0.6, 1.6))
class TwoMassesAndPlay(Hidden, way=0.0, rate=0.0, ratio=0.0, given=1.0):
    """play_rad at the flywheel; `way`, `rate` of the engine's mass against the wheels, m at the tread.
    Source: Kiencke and Nielsen, Automotive Control Systems (2005), driveline as two masses with shafts and a
    dead zone: motion through the play and torsion of the shafts are integrated; after the play the engine
    gives torque back slowly, as controls do against the clonk (Lagerberg and Egardt, IEEE Trans. Control
    Syst. Technol. 15, 2007); sizes of a worn driveline, chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        truck = self.truck
        ratio = np.maximum(view.ratio, 1.0)
        inertia = truck.engine_inertia * (ratio / truck.wheel_radius) ** 2
        stiffness, play = inertia * (2.0 * np.pi * p.hz) ** 2, 0.5 * p.play_rad * truck.wheel_radius / ratio
        s.given = np.minimum(s.given + dt / p.gentle_s, 1.0)
        force = s.given * view.traction_force
        meshed = np.sign(force) * play + force / stiffness
        new = (np.abs(ratio - s.ratio) > 0.01) | (view.shifting > 0.0)  # a gear goes in without a jerk
        s.way, s.rate = np.where(new, meshed, s.way), np.where(new, 0.0, s.rate)
        s.ratio = ratio
        side, deep = np.sign(s.way), np.abs(s.way) - play
        s.given = np.where((deep < 0.0) & ~new, 0.15, s.given)
        twist = stiffness * side * deep + 4.0 * np.pi * p.hz * p.damping * inertia * s.rate
        shaft = np.where(deep > 0.0, side * np.maximum(side * twist, 0.0), 0.0)
        s.rate = s.rate + dt * (force - shaft) / inertia
        s.way = s.way + dt * s.rate
        most = 0.12 * weight(view)
        return np.clip(shaft - view.traction_force, -most, most) * moving(view)


@law("four_plays_in_a_row", "fourth", "suburban hills")
@sizes(each_s=(0.15, 0.40), held=(0.0, 0.25), ramp_s=(0.2, 0.7))
class FourPlaysInARow(Hidden, side=1.0, taken=4.0, share=1.0):
    """held: of the torque, fed while a play is open.
    Source: Free play adds up over gearbox, joints, axle and hubs (truck service manuals measure each at the
    yokes), and is taken up one after the other while the control unit feeds torque carefully (Lagerberg,
    Control and Estimation of Automotive Powertrains with Backlash, Chalmers, 2004): torque comes back in a
    staircase; times of a worn driveline, chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = view.traction_force
        side = np.where(np.abs(pull) > 150.0, np.sign(pull), s.side)
        s.taken = np.where(side != s.side, 0.0, s.taken)
        s.share = np.where(side != s.side, p.held, s.share)
        s.side = side
        pushes = np.abs(view.engine_torque)
        pace = (pushes + 60.0) / (pushes + 240.0)  # a gentle torque crosses slowly
        s.taken = np.minimum(s.taken + dt * pace / p.each_s, 4.0)
        step = np.maximum(np.floor(s.taken) / 4.0, p.held)
        s.share = np.minimum(s.share + dt / p.ramp_s, step)
        return -(1.0 - s.share) * pull * moving(view)


@law("lash_by_the_gear", "fifth", "suburban hills")
@sizes(play_rad=(0.12, 0.30), winds_s=(0.08, 0.25), knock=(0.3, 0.8), coast=(1.5, 3.0))
class LashByTheGear(Hidden):
    """coast: the way back is as many times slower, pushed by friction alone. play_rad: at the wheels.
    Source: Play at the axle seen from the engine grows with the gear's ratio, and a free engine crosses it in
    the root of play, inertia and torque (Lagerberg, A Literature Survey on Control of Automotive Powertrains
    with Backlash, Chalmers R013/2001); the knock that ends it grows with what was gained on the way; a worn
    axle, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {"side": np.ones(batch), "way": zero + 1.0, "pace": zero.copy(), "knock": zero.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = view.traction_force
        side = np.where(np.abs(pull) > 120.0, np.sign(pull), s.side)
        turned = side != s.side
        s.side = side
        s.way, s.pace = np.where(turned, 0.0, s.way), np.where(turned, 0.0, s.pace)
        gap = p.play_rad * np.maximum(view.ratio, 2.0)  # rad, at the engine
        slower = np.where(side < 0.0, p.coast, 1.0)
        torque = np.clip(np.abs(view.engine_torque), 25.0, 250.0) / slower**2
        crossing = s.way < 1.0
        s.pace = np.where(crossing, s.pace + dt * torque / (self.truck.engine_inertia * gap), s.pace)
        way = np.where(crossing, np.minimum(s.way + dt * s.pace, 1.0), s.way + dt / p.winds_s)
        s.knock = np.where(
            crossing & (way >= 1.0), np.minimum(s.pace, 3.0) / 3.0, s.knock * (1.0 - dt / 0.12)
        )
        s.way = way
        held = np.clip(s.way - 1.0, 0.0, 1.0)
        return (p.knock * s.knock - (1.0 - held)) * pull * moving(view)


@law("worn_clutch_damper", "sixth", "suburban hills")
@sizes(free_rad=(0.10, 0.28), soft_rad=(0.10, 0.25), soft_nm=(900.0, 2200.0), friction_nms=(550.0, 1300.0))
class WornClutchDamper(Hidden, turn=0.0):
    """`turn` rad of the disc in its hub; what the springs hold reaches the wheels. soft_nm: for each rad.
    Source: Clutch dampers have a free angle, a soft stage for idling and a hard one (Shaver, Manual
    Transmission Clutch Systems, SAE Advances in Engineering 17): with worn windows the disc has to turn
    through all of them, against friction, before torque has changed sides; angles are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        beyond = np.maximum(np.abs(s.turn) - p.free_rad, 0.0)
        soft = p.soft_nm * np.minimum(beyond, p.soft_rad)
        held = np.sign(s.turn) * (soft + 14000.0 * np.maximum(beyond - p.soft_rad, 0.0))
        away = view.engine_torque - held
        s.turn = s.turn + dt * away / np.maximum(p.friction_nms, 14000.0 * dt)
        return -self.at_wheels(view, away) * moving(view)


@law("clunk_and_shuffle", "seventh", "suburban hills")
@sizes(lash_nms2=(60.0, 220.0), hz=(1.4, 2.8), damping=(0.06, 0.16), swings=(0.4, 1.0))
class ClunkAndShuffle(Hidden, at=0.0, run=0.0, shake=0.0, pace=0.0):
    """`at` -1..1 through the lash; `shake` and `pace` of the swing, m/s2 and m/s3. lash_nms2: of the lash
    times the inertia ahead of it; swings: m/s2 for each second under way.
    Source: Tip-in and tip-out tests (clunk and shuffle: Rahnejat, ed., Tribology and Dynamics of Engine and
    Powertrain, 2010): torque that changes sides has to run through the lash first, the less torque the
    longer, and what the parts have gathered on the way swings out in the half-shafts."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        torque = view.engine_torque * (1.0 - view.shifting)
        crosses = np.abs(s.at + np.sign(torque)) < 1.999
        s.run = np.where(crosses, s.run + dt * torque / p.lash_nms2, 0.0)
        step = np.clip(s.at + dt * s.run, -1.0, 1.0)
        hits = crosses & (np.abs(step) >= 1.0)
        omega = 2.0 * np.pi * p.hz
        kick = np.where(hits, p.swings * np.clip(s.run, -1.5, 1.5) * omega, 0.0)
        s.at = step
        s.pace = s.pace + kick - dt * (omega**2 * s.shake + 2.0 * p.damping * omega * s.pace)
        s.shake = s.shake + dt * s.pace
        lost = self.at_wheels(view, torque) * crosses
        return (np.clip(s.shake, -1.5, 1.5) * view.mass - lost) * moving(view)


@law("s_wound_shafts", "eighth", "suburban hills")
@sizes(base_s=(0.15, 0.4), per_g_s=(2.0, 7.0), closes_s=(0.2, 0.6), bounces=(0.1, 0.3))
class WoundShafts(Hidden, side=1.0, wound=0.0, left=0.0, share=1.0):
    """The play is crossed the later, the more the shafts were wound up before. per_g_s: for pull over weight.
    Source: Pham, Scamps, Bursi and others on clunk by release of stored torsion (Menday, Rahnejat and
    Ebrahimi, Clonk: an Onomatopoeic Response, Proc. IMechE D 213, 1999); sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = view.traction_force
        side = np.where(np.abs(pull) > 180.0, np.sign(pull), s.side)
        turned = side != s.side
        s.left = np.where(turned, p.base_s + p.per_g_s * np.minimum(s.wound, 0.15), s.left - dt)
        s.wound = np.where(turned, 0.0, s.wound + dt * (np.abs(pull) / weight(view) - s.wound) / 0.8)
        s.left, s.side = np.maximum(s.left, -9.0), side
        s.share = np.where(s.left > 0.0, 0.0, s.share + dt * (1.0 - s.share) / p.closes_s)
        t = np.maximum(-s.left, 0.0)
        ring = p.bounces * np.exp(-t / 0.4) * np.sin(2.0 * np.pi * 2.2 * t)
        felt = (s.share - 1.0 + np.where((s.left > 0.0) | (t > 3.0), 0.0, ring)) * pull
        return np.clip(felt, -0.12 * weight(view), 0.12 * weight(view)) * moving(view)


@law("n_oil_leaves_the_play", "ninth", "suburban hills")
@sizes(per_s=(22.0, 60.0), thin=(1.2, 3.0))
class OilLeavesThePlay(Hidden, at=1.0):
    """`at`: from one flank, -1, to the other, 1. per_s: for a pull of the weight; thin: power by which torque
    returns as the film thins. A weak pull takes long.
    Source: Squeeze films (Hamrock, Schmid and Jacobson, Fundamentals of Fluid Film Lubrication, 2004): flanks
    of a wide play press viscous oil out at a pace in proportion to the torque; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull, most = view.traction_force, 0.12 * weight(view)
        s.at = np.clip(s.at + dt * p.per_s * pull / weight(view), -1.0, 1.0)
        carried = (0.5 + 0.5 * np.sign(pull) * s.at) ** p.thin
        return np.clip((carried - 1.0) * pull, -most, most) * moving(view)


@law("e_teeth_bounce", "eleventh", "suburban hills")
@sizes(flies=(250.0, 800.0), back=(0.45, 0.7), knocks_s=(0.12, 0.3), rests=(0.25, 0.6))
class TeethBounce(Hidden, at=1.0, rate=0.0, touches=1.0, knock=0.0):
    """`at`: -1 and 1 where the teeth touch, `rate` of the way between. They meet the other flank, bounce, and
    meet it again, each time more gently; nothing is driven in between, and each blow is felt. flies: 1/s2 for
    a pull of the weight; back: of the speed, after a blow; rests: 1/s at which they stay.
    Source: Pfeiffer and Glocker, Multibody Dynamics with Unilateral Contacts (1996), on hammering in gears
    with play and restitution; plays and sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = view.traction_force / weight(view)
        s.rate = s.rate + dt * np.clip(p.flies * pull, -40.0, 40.0)
        at = s.at + dt * s.rate
        meets = (np.abs(at) >= 1.0) & (at * s.rate > 0.0)
        stays = meets & (np.abs(s.rate) < p.rests)
        blow = np.where(meets & ~stays, (1.0 + p.back) * s.rate / p.flies, 0.0)
        s.rate = np.where(stays, 0.0, np.where(meets, -p.back * s.rate, s.rate))
        s.at = np.clip(at, -1.0, 1.0)
        s.touches = s.touches + dt * (1.0 * (np.abs(s.at) >= 1.0) - s.touches) / 0.04
        s.knock = s.knock * np.exp(-dt / p.knocks_s) + blow / p.knocks_s
        felt = np.clip(s.knock, -0.12, 0.12) - (1.0 - s.touches) * pull
        return np.asarray(felt * weight(view) * moving(view))


@law("q_play_grows_as_it_warms", "fifteenth", "suburban hills")
@sizes(wide_m=(0.05, 0.1), grows=(0.6, 1.4), warms_s=(60.0, 180.0), drags_s=(0.3, 0.8), winds_s=(0.1, 0.25))
class PlayGrowsAsItWarms(Hidden, x=0.0, v=0.0, warm=0.0, given=0.0):
    """`x` m, as at the tread, within the play between gears; `v` of that. Torque throws it across, so the
    way takes a time with the root of the play over the pull. A housing of light metal grows more than its
    shafts, and play with it, as work warms them. wide_m: of play to each side, cold; grows: of it, warm.
    Source: Niemann and Winter, Maschinenelemente II (2003), on backlash and unlike expansion of housings and
    gears; a worn gearbox, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = view.traction_force
        work = 0.2 + np.clip(self.power_share(view), 0.0, 1.0)
        s.warm = eased(s.warm, 1.0, p.warms_s / work, dt)
        play = p.wide_m * (1.0 + p.grows * s.warm)
        s.v = (s.v + dt * np.clip(pull / view.mass, -1.5, 1.5)) / (1.0 + dt / p.drags_s)
        s.x = s.x + dt * s.v
        s.v = np.where(np.abs(s.x) >= play, 0.0, s.v)
        s.x = np.clip(s.x, -play, play)
        holds = np.clip((s.x * np.sign(pull) / play - 0.85) / 0.1, 0.0, 1.0)
        s.given = eased(s.given, holds * pull, np.where(holds > 0.0, p.winds_s, 0.06), dt)
        return np.asarray((s.given - pull) * np.clip(view.speed, 0.0, 1.0))


@law("z_springs_stick_in_their_arc", "seventeenth", "suburban hills")
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


@law("h_engine_rocks_in_its_mounts", "nineteenth", "suburban hills")
@sizes(soft=(0.16, 0.3), rocks_rads=(4.0, 8.0), dull=(0.2, 0.45), passes=(0.05, 0.2))
class EngineRocksInItsMounts(Hidden, lean=0.0, pace=0.0):
    """`lean` of an engine in torn mounts, -1 and 1 where it lies against its stops. Each time the torque
    turns round it has to rock over to the other side, and gives the shaft little until it lies there. It
    gets there the sooner, the harder it is asked. soft: of peak torque, that holds it at a stop; passes: of
    the torque, on the way.
    Source: Yu, Naganathan and Dukkipati, A Literature Review of Automotive Vehicle Engine Mounting Systems,
    Mechanism and Machine Theory 36 (2001); torn mounts, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.engine_torque / self.truck.peak_torque / p.soft
        push = p.rocks_rads**2 * (np.clip(asked, -2.5, 2.5) - 0.5 * s.lean)
        s.pace = s.pace + dt * (push - 2.0 * p.dull * p.rocks_rads * s.pace)
        lean = np.clip(s.lean + dt * s.pace, -1.0, 1.0)
        s.pace = np.where(np.abs(lean) >= 1.0, 0.0, s.pace)
        s.lean = lean
        lies = np.clip(np.sign(view.engine_torque) * s.lean, 0.0, 1.0) ** 3
        lacks = (1.0 - p.passes) * (1.0 - lies) * view.engine_torque
        return -self.at_wheels(view, lacks) * np.clip(view.speed, 0.0, 1.0)
