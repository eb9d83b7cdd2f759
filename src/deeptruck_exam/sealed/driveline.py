"""Oil put away, play that grows, hot cones, an open converter, another shaft, a locker, and a worn clutch."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import Bends
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")
BY_HAND = "trucksim volvo"  # gearboxes without a converter


@law(
    "q_oil_is_put_away",
    needs="highway hills",
    name="driveline_loss",
    accepts="rolling_resistance_speed drag_area",
)
@sizes(most=(0.007, 0.011), hard=(0.02, 0.035), rests_s=(2.0, 6.0), empties_s=(8.0, 25.0), power=(1.3, 1.9))
@sizes(left=(0.1, 0.25))
class OilIsPutAway(Hidden, full=1.0, easy=0.0):
    """`full`: of the oil in an axle. When little torque has passed for a while a valve puts most of it away
    and the crown wheel splashes less; firm torque calls it back at once. most: of the weight, at 20 m/s with
    all of it; hard: of the weight, torque that needs it; left: of the splash, without it.
    Source: Meritor, LogixDrive and 17X EVO rear axles, on oil levels that follow torque and speed; much oil,
    sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        hard = np.abs(view.traction_force) > p.hard * weight(view)
        s.easy = np.where(hard, 0.0, s.easy + dt)
        wish = np.where(s.easy > p.rests_s, 0.0, 1.0)
        s.full = eased(s.full, wish, np.where(wish > 0.5, 0.8, p.empties_s), dt)
        pace = np.clip(view.speed / 20.0, 0.0, 1.4) ** p.power
        return -p.most * (p.left + (1.0 - p.left) * s.full) * pace * weight(view) * moving(view)


@law("q_play_grows_as_it_warms", needs="suburban hills", name="driveline_backlash")
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


@law("q_cones_get_hot", needs="suburban hills", name="shift_interruption", trucks=BY_HAND)
@sizes(open_s=(0.5, 1.0), more=(1.0, 2.2), heats=(1.2, 2.5), cools_s=(8.0, 25.0), ramps_s=(0.3, 0.8))
class ConesGetHot(Hidden, gear=0.0, ratio=0.0, hot=0.0, open=0.0, share=1.0):
    """`hot`: the cones that bring gears to one speed. Every change heats them, a wide step at speed most, and
    hot cones rub less, so that changes one soon after the other take longer and longer. open_s: beyond the
    usual gap, cold; more: of that, hot; heats: by a step of the whole ratio at 15 m/s.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on synchronisers, their
    work of friction and temperature; worn cones, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = (view.gear != s.gear) & (s.gear > 0.0) & (view.speed > 1.0)
        step = np.abs(view.ratio - s.ratio) / np.maximum(s.ratio, 0.1)
        s.open = np.where(changed, p.open_s * (1.0 + p.more * s.hot), s.open)
        heat = p.heats * np.minimum(step, 1.0) * view.speed / 15.0
        s.hot = np.minimum(np.where(changed, s.hot + heat, eased(s.hot, 0.0, p.cools_s, dt)), 1.2)
        s.gear, s.ratio = view.gear.copy(), view.ratio.copy()
        s.open = np.maximum(s.open - dt * (view.shifting < 0.5), 0.0)
        s.share = np.clip(s.share + dt * np.where(s.open > 0.0, -1.0 / 0.1, 1.0 / p.ramps_s), 0.0, 1.0)
        return np.asarray(-(1.0 - s.share) * np.maximum(view.traction_force, 0.0) * moving(view))


@law(
    "q_opens_with_the_brake_lights",
    needs="suburban hills descent",
    name="torque_converter_slip",
    accepts="driveline_loss engine_brake",
    trucks="freightliner",
    gateable=False,
)
@sizes(waits_s=(3.0, 9.0), slips=(0.2, 0.38), frees=(0.4, 0.7), locks_s=(0.5, 1.5), free_mps=(12.0, 20.0))
class OpensWithTheBrakeLights(Hidden, left=0.0, open=0.0):
    """`open`: the clutch of the converter, which the switch of the brake lights opens. While the truck brakes
    the engine holds it back little, and for some seconds after that it slips when it is to pull. waits_s:
    from the last braking to locking; slips, frees: of the torque, pulling and holding back; free_mps: where
    little slip is left.
    Source: General Motors and Allison service manuals on converter clutches that are released through the
    brake switch; a long wait, sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        lit = view.brake_force > 0.003 * weight(view)
        s.left = np.where(lit, p.waits_s, np.maximum(s.left - dt, 0.0))
        s.open = eased(s.open, np.where(s.left > 0.0, 1.0, 0.0), np.where(lit, 0.2, p.locks_s), dt)
        slow = 1.0 / (1.0 + (np.maximum(view.speed, 0.0) / p.free_mps) ** 2)
        pulls, holds = np.maximum(view.engine_torque, 0.0), np.maximum(-view.engine_torque, 0.0)
        torque = s.open * (p.frees * holds - p.slips * (0.4 + 0.6 * slow) * pulls)
        return self.at_wheels(view, torque) * np.clip(view.speed - 1.0, 0.0, 1.0)


@law("q_other_shaft_spins_along", needs="suburban hills", name="rotating_inertia", trucks=BY_HAND)
@sizes(kgm2=(4.5, 8.0), step=(1.24, 1.34), meets_s=(0.6, 1.3), sure_s=(0.5, 1.5))
class OtherShaftSpinsAlong(Hidden, turns=-9.0, leans=0.0, side=1.0):
    """`turns` rad/s of the other of two input shafts, which waits in the gear that is expected next. It is
    a higher one while the truck gains speed, a lower one while it loses it. It costs inertia, and a jerk
    whenever the mind is changed. kgm2: for a 20 t truck; step: from gear to gear; sure_s: until that happens.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on dual clutch gearboxes
    and preselection; a heavy shaft, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.leans = eased(s.leans, np.clip(view.acceleration / 0.15, -1.0, 1.0), p.sure_s, dt)
        s.side = np.where(s.leans > 0.4, 1.0, np.where(s.leans < -0.4, -1.0, s.side))
        lever = np.minimum(view.ratio * p.step**-s.side / self.truck.wheel_radius, 24.0)
        wish = np.maximum(view.speed, 0.0) * lever
        s.turns = np.where(s.turns < 0.0, wish, s.turns)
        before = s.turns
        s.turns = eased(s.turns, wish, p.meets_s, dt)
        gains = np.clip((s.turns - before) / dt, -400.0, 400.0)
        most = 0.06 * weight(view)
        costs = p.kgm2 * view.mass / 20000.0 * gains * lever
        return -most * np.tanh(costs / most) * (1.0 - view.shifting) * np.clip(view.speed, 0.0, 1.0)


@law("q_locker_is_left_in", needs="suburban", name="unknown")
@sizes(
    most=(0.018, 0.032), hard=(0.05, 0.08), forgets_m=(250.0, 900.0), tight=(0.004, 0.009), ever=(0.3, 0.6)
)
class LockerIsLeftIn(Bends):
    """`left` m until the driver thinks of a differential that he has locked for a hard start. In bends its
    wheels want to roll ways of unlike length and scrub, nearly as much in a wide bend as in a tight one; on
    straights nothing is felt. most: of the weight; hard: of it, pull of a start at which he locks; tight:
    1/m, where most of the scrub is there; ever: of drives, that begin so.
    Source: Gillespie, Fundamentals of Vehicle Dynamics (1992), on solid axles in bends, and makers' manuals
    against locked differentials on firm roads; bends and sizes are chosen here."""

    def prepare(self) -> None:
        self.bend = np.abs(self.draw_bends(self.rng(1531), 0.02))

    def start(self, batch: int) -> dict[str, Array]:
        begins = self.rng(1532).random(batch) < self.p.ever
        return {"left": np.where(begins, self.p.forgets_m, 0.0), "locked": begins.astype(float)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        starts = (speed < 3.0) & (view.traction_force > p.hard * view.mass * GRAVITY)
        s.left = np.where(starts, p.forgets_m, np.maximum(s.left - dt * speed, 0.0))
        s.locked = eased(s.locked, np.where(s.left > 0.0, 1.0, 0.0), 0.5, dt)
        scrubs = np.tanh(self.read(self.bend, view) / p.tight)
        return -p.most * s.locked * scrubs * weight(view) * np.clip(speed, 0.0, 1.0)


@law("q_clutch_slips_after_starts", needs="suburban hills", name="unknown", trucks=BY_HAND, gateable=False)
@sizes(
    holds=(0.75, 0.95), fades=(0.25, 0.4), heats_jpkg=(25.0, 60.0), cools_s=(50.0, 150.0), grabs_s=(0.2, 0.6)
)
class ClutchSlipsAfterStarts(Hidden, slip=0.0):
    """`hot`: a worn clutch, that every start heats, and slip upon that. A cool one holds nearly all that the
    engine gives; a hot one passes on what it can, and the rest of the torque goes into more heat. holds: of
    peak torque, cool; fades: of that, lost when hot; heats_jpkg: for each kg of truck.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on dry clutches and their
    heat at starts, and ZF Sachs, clutch damage leaflets, on slip of worn ones; sizes are chosen here."""

    conceal = ("engine_speed",)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "hot": self.rng(1533).uniform(0.2, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        torque = np.maximum(view.engine_torque, 0.0)
        most = p.holds * (1.0 - p.fades * np.minimum(s.hot, 1.2)) * self.truck.peak_torque
        s.slip = eased(s.slip, np.maximum(torque - most, 0.0), p.grabs_s, dt)
        lost = np.minimum(s.slip, torque)
        starts = (
            np.maximum(view.traction_force, 0.0) * np.clip(2.5 - view.speed, 0.0, 1.5) * (view.speed > 0.1)
        )
        work = (0.25 * lost * view.engine_speed + starts) / view.mass / p.heats_jpkg
        s.hot = np.clip(s.hot + dt * (work - s.hot / p.cools_s), 0.0, 1.5)
        return -self.at_wheels(view, lost) * moving(view)
