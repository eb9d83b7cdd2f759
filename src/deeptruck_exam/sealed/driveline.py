"""A sliding joint that sticks, plays that drift apart in bends, shafts that have to be still, a lock-up by
turns and grain that clings in its drum; a foot that rests on the clutch."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, index, moving, weight
from deeptruck_exam.effects.places import Bends
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series, spells, within
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("j_sliding_joint_sticks", needs="suburban hills", name="driveline_loss", accepts="torque_gain")
@sizes(most=(0.13, 0.21), moves=(0.012, 0.03), holds=(0.5, 0.9), even_m=(150.0, 500.0), always=(0.25, 0.4))
class SlidingJointSticks(Hidden, length=0.0, seat=0.0):
    """The shaft to the axle has to become longer and shorter as springs give, but its splines are dry: the
    more torque they carry, the more firmly they stick. What they hold back presses along the shaft on its
    bearings, which take torque for it; where little torque goes through, the splines slip and are at ease.
    `length`: what the springs ask for, over gravity; `seat`: where the splines are. most: of the pull; moves:
    of length, that bearings feel wholly; even_m: way that shakes the splines to their place.
    Source: Schmelz, Seherr-Thoss and Aucktor, Universal Joints and Driveshafts (2006), on axial forces of
    sliding splines; dry ones, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration / GRAVITY + view.grade, -0.2, 0.2)
        s.length = eased(s.length, felt, 0.4, dt)
        pull = np.abs(view.traction_force) / weight(view)
        sticks = p.moves * np.clip(pull / 0.06, 0.05, 1.5) * p.holds
        s.seat = np.clip(s.seat, s.length - sticks, s.length + sticks)
        s.seat = eased(s.seat, s.length, p.even_m / np.maximum(view.speed, 0.3), dt)
        presses = np.clip(np.abs(s.length - s.seat) / (p.moves * p.holds), 0.0, 1.5)
        share = p.most * (p.always + (1.0 - p.always) * presses)
        return -share * np.abs(view.traction_force) * moving(view)


@law("j_plays_drift_in_bends", needs="suburban hills", name="driveline_backlash")
@sizes(least_s=(0.22, 0.4), drifts=(0.4, 0.9), bends_s=(4.0, 12.0), crosses=(0.035, 0.06), share=(0.85, 1.0))
class PlaysDriftInBends(Hidden, inner=1.0, outer=1.0, given=0.0):
    """The splines of both hubs have play, and the differential gives neither wheel more than the other takes.
    In a bend one wheel runs ahead and the other falls back, so that their plays are crossed by turns, and
    where little is pulled one opens by itself. `inner`, `outer`: -1 and 1 where the splines touch. least_s:
    for a play, at a force of crosses over weight; drifts: of a play each second, in a usual bend at 10 m/s.
    Source: Nordin and Gutman, Controlling Mechanical Systems with Backlash - a Survey, Automatica 38 (2002),
    and Gillespie, Fundamentals of Vehicle Dynamics (1992), on differentials; worn hubs, sizes are chosen
    here."""

    def prepare(self) -> None:
        shape = (self.setting.batch, int(self.setting.duration_s) + 3)
        self.bend = np.clip(ou_series(self.rng(2231), shape, 1.0, self.p.bends_s), -2.0, 2.0)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        force = view.traction_force / weight(view)
        presses = np.clip(force / p.crosses, -1.5, 1.5) / p.least_s
        runs = p.drifts * self.bend[:, index(view, self.bend)] * np.clip(view.speed / 10.0, 0.0, 1.2)
        s.inner = np.clip(s.inner + dt * (presses - runs), -1.0, 1.0)
        s.outer = np.clip(s.outer + dt * (presses + runs), -1.0, 1.0)
        side = np.sign(force)
        both = np.clip((np.minimum(s.inner * side, s.outer * side) - 0.9) / 0.1, 0.0, 1.0)
        s.given = eased(s.given, both * force, np.where(both > 0.5, 0.12, 0.04), dt)
        felt = p.share * np.clip(s.given - force, -0.15, 0.15)
        return felt * weight(view) * np.clip(view.speed, 0.0, 1.0)


@law(
    "j_waits_until_shafts_are_still",
    needs="suburban hills",
    name="shift_interruption",
    accepts="torque_limit",
)
@sizes(dies_s=(0.45, 0.8), still=(0.05, 0.12), cut=(0.85, 1.0), loose_s=(6.0, 15.0), back_s=(0.1, 0.3))
class WaitsUntilShaftsAreStill(Hidden, pulled=0.0, loose=0.0, left=0.0, open=0.0, was=0.0):
    """When a gear is in, the controller waits until the shafts swing no more. They swing by the pull that was
    let go for the change, and die away by a constant share, so that the wait goes with the logarithm of it.
    Changes in quick succession find them swinging. `pulled`: of the most, before the change; `loose`: swing
    that is left of the change before. dies_s: of the swing; still: of the pull, that is let pass.
    Source: Pettersson and Nielsen, Gear Shifting by Engine Control, IEEE Trans. Control Systems Technology 8
    (2000), on driveline oscillations after a change; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        shifts = view.shifting > 0.5
        share = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.0)
        s.pulled = np.where(shifts | (s.left > 0.0), s.pulled, eased(s.pulled, share, 0.4, dt))
        s.loose = eased(s.loose, 0.0, p.loose_s, dt)
        closes = (s.was > 0.5) & ~shifts & (view.speed > 0.5)
        swing = s.pulled + 0.6 * s.loose
        wait = p.dies_s * np.log1p(swing / p.still)
        s.left = np.where(closes, wait, np.maximum(s.left - dt, 0.0))
        s.loose = np.where(closes, np.clip(swing, 0.0, 1.5), s.loose)
        s.was = view.shifting.copy()
        s.open = np.where(s.left > 0.0, 1.0, eased(s.open, 0.0, p.back_s, dt))
        return -p.cut * s.open * np.maximum(view.traction_force, 0.0) * moving(view)


@law(
    "j_locks_after_so_many_turns",
    needs="suburban hills",
    name="torque_converter_slip",
    accepts="driveline_loss",
    trucks="freightliner",
    gateable=False,
)
@sizes(way_m=(45.0, 120.0), slips=(0.3, 0.5), at_rads=(120.0, 160.0), lifts_s=(0.5, 1.5))
class LocksAfterSoManyTurns(Hidden, turned=0.0, gear=0.0, lifted=0.0):
    """An old controller counts the turns of the output shaft since the last change of gear, and locks the
    converter after so many. A lift of the foot for a moment sets the count back, too. So it is long open at
    low speed and shut soon at high speed. `turned`: of the count. way_m: on the road, for the count; slips:
    at peak torque and at_rads; lifts_s: of a lift, that counts.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on lock-up control and
    slip by torque over the square of speed; sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = np.abs(view.gear - s.gear) > 0.5
        s.gear = np.where(changed, view.gear, s.gear)
        s.lifted = np.where(self.pedal(view) < 0.03, s.lifted + dt, 0.0)
        back = changed | (s.lifted > p.lifts_s)
        s.turned = np.where(back, 0.0, np.minimum(s.turned + dt * np.maximum(view.speed, 0.0) / p.way_m, 1.2))
        open_by = np.clip((1.0 - s.turned) / 0.06, 0.0, 1.0)
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        turns = (p.at_rads / np.maximum(view.engine_speed, 60.0)) ** 2
        slip = np.minimum(p.slips * np.sqrt(load * turns), 0.7)
        return -self.at_wheels(view, open_by * slip * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law(
    "j_grain_clings_in_its_drum",
    needs="suburban hills",
    name="rotating_inertia",
    accepts="mass payload_change",
)
@sizes(grain=(0.32, 0.5), grips_mps2=(0.12, 0.3), clings_mps=(7.0, 12.0), rubs_s=(0.4, 1.0), falls=(0.3, 0.6))
class GrainClingsInItsDrum(Hidden, rim=-1.0):
    """The wheels drive a drum with grain in it. Grain slides on the wall, and takes hold of it with a force
    that goes by its weight at low speed and by the square of its own speed when it is pressed outwards: slow,
    it is left behind and tumbles; fast, it goes round with the drum as one body. `rim` m/s of the grain as at
    the road. grain: of the mass; grips_mps2: at low speed; clings_mps: where pressing is as large as weight;
    falls: of the low grip, by which tumbling slows it.
    Source: Mellmann, The Transverse Motion of Solids in Rotating Cylinders, Powder Technology 118 (2001), on
    slipping, cascading and centrifuging; a drum on a truck, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.rim = np.where(s.rim < 0.0, speed, s.rim)
        most = p.grips_mps2 * (1.0 + (s.rim / p.clings_mps) ** 2)
        takes = np.clip((speed - s.rim) / p.rubs_s, -most, most)
        tumbles = p.falls * p.grips_mps2 * np.exp(-((s.rim / p.clings_mps) ** 2)) * np.clip(s.rim, 0.0, 1.0)
        s.rim = np.maximum(s.rim + dt * (takes - tumbles), 0.0)
        return -p.grain * takes * view.mass * moving(view)


@law("j_foot_rests_on_the_clutch", needs="suburban hills", name="unknown")
@sizes(holds=(0.4, 0.58), spells_s=(8.0, 25.0), warms_s=(8.0, 22.0), fades=(0.2, 0.4), bites=(0.1, 0.2))
class FootRestsOnTheClutch(Bends, slip=0.0):
    """A driver rests his foot on the clutch pedal at times, most in bends, where he braces himself. The plate
    then holds but a part of the torque and slips above it; what slips makes it `hot`, and hot it holds less.
    It bites again only at a lower torque. holds: of peak torque, cold; fades: of that, hot; bites: of peak
    torque, below it.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on the torque that
    clutches hold and how it fades by heat; a driver's bad habit, sizes are chosen here."""

    def prepare(self) -> None:
        self.bend = self.draw_bends(self.rng(2232), 1.0)
        on = (0.5 * self.p.spells_s, 1.5 * self.p.spells_s)
        self.rests = spells(self.rng(2233), self.setting.batch, on, (0.4 * on[0], 0.7 * on[1]))

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "hot": self.rng(2234).uniform(0.0, 0.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        braced = np.clip(np.abs(self.read(self.bend, view)) * 1.5, 0.0, 1.0)
        rests = np.maximum(within(self.rests, view.time), braced)
        most = p.holds * (1.0 - p.fades * np.minimum(s.hot, 1.0)) - p.bites * s.slip
        share = np.maximum(view.engine_torque, 0.0) / self.truck.peak_torque
        over = np.maximum(share - most, 0.0) * rests
        s.slip = eased(s.slip, (over > 0.0).astype(float), 0.3, dt)
        heats = np.minimum(6.0 * over, 1.5)
        s.hot = np.clip(s.hot + dt * (heats - 0.5 * s.hot) / p.warms_s, 0.0, 1.2)
        return -self.at_wheels(view, over * self.truck.peak_torque) * moving(view)
