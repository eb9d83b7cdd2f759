"""Two axles with play, bearings that clamp as they warm, gears that miss uphill, a lock-up that keeps on
slipping, a rotor between two shafts, torque by good conduct, and magnets that turn along."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")
BY_HAND = "trucksim volvo"  # gearboxes without a converter


@law("x_both_axles_must_touch", needs="suburban hills", name="driveline_backlash")
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


@law("x_bearings_clamp_as_they_warm", name="driveline_loss", accepts="torque_gain")
@sizes(mesh=(0.02, 0.04), clamp=(0.18, 0.3), gear_s=(20.0, 60.0), case_s=(150.0, 500.0), power=(1.2, 2.0))
class BearingsClamp(Hidden):
    """`gear`, `case`: heat of the gears and of the housing round them. Gears warm first and grow, and clamp
    their tapered bearings until the housing has followed. mesh, clamp: of the traction, the second when gears
    are a whole step hotter than their housing.
    Source: Harris and Kotzalas, Advanced Concepts of Bearing Technology (2007), on preload by expansion of
    shafts within housings; quicker heat, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(1331)
        case = rng.uniform(0.0, 0.6, batch)
        return {"case": case, "gear": case + rng.uniform(0.0, 0.3, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        power = np.abs(view.traction_force) * np.maximum(view.speed, 0.0) / self.truck.peak_power
        passes = (s.gear - s.case) / p.gear_s
        s.gear = np.clip(s.gear + dt * (1.6 * power / p.gear_s - passes), 0.0, 3.0)
        wind = 0.3 + np.clip(view.speed / 20.0, 0.0, 1.3)
        s.case = np.clip(s.case + dt * (0.3 * passes - wind * s.case / p.case_s), 0.0, 3.0)
        clamps = np.clip(s.gear - s.case, 0.0, 1.6) ** p.power
        lost = np.minimum(p.mesh + p.clamp * clamps, 0.35)
        return np.asarray(-lost * np.abs(view.traction_force) * moving(view))


@law("x_speed_runs_away_uphill", needs="hills suburban", name="shift_interruption", trucks=BY_HAND)
@sizes(
    meets_mps=(0.10, 0.25), slow_s=(0.5, 1.0), misses=(1.0, 2.5), longest_s=(1.6, 2.6), ramps_s=(0.25, 0.6)
)
class SpeedRunsAwayUphill(Hidden, gear=0.0, open=0.0, wish=0.0, share=1.0):
    """Between two gears the computer aims at the speed that the truck had when it began. `wish` m/s: what the
    truck has lost or won since. Uphill, with much load, it falls below the aim and the gear does not go in
    until the engine has been asked again. meets_mps: off, that still goes in; misses: longer, for each m/s
    that is off.
    Source: Tseng and Yu, Advanced Shifting Control of Synchronizer Mechanisms for Clutchless Automatic Manual
    Transmission in an Electric Vehicle, Mechanism and Machine Theory 84 (2015), on synchronising a moving
    target; times are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = (view.gear != s.gear) & (s.gear > 0.0) & (view.speed > 1.5)
        s.gear = view.gear.copy()
        s.open = np.where(changed, dt, np.where(s.open > 0.0, s.open + dt * (view.shifting < 0.5), 0.0))
        aside = np.minimum(np.abs(view.acceleration), 1.5) * (s.open > 0.0)
        s.wish = np.where(changed, 0.0, s.wish + dt * aside)
        needs = p.slow_s * (1.0 + p.misses * np.maximum(s.wish - p.meets_mps, 0.0))
        done = (s.open > needs) | (s.open > p.longest_s)
        s.open = np.where(done, 0.0, s.open)
        pace = np.where(s.open > 0.0, -1.0 / 0.1, 1.0 / p.ramps_s)
        s.share = np.clip(s.share + dt * pace, 0.0, 1.0)
        return np.asarray(-(1.0 - s.share) * np.maximum(view.traction_force, 0.0) * moving(view))


@law(
    "x_once_it_slips_it_slips",
    needs="hills suburban",
    name="torque_converter_slip",
    accepts="driveline_loss torque_limit",
    trucks="freightliner",
    gateable=False,
)
@sizes(sticks=(0.34, 0.5), slides=(0.6, 0.8), hot=(0.2, 0.4), heats_s=(4.0, 14.0), cools_s=(15.0, 50.0))
@sizes(catches=(0.6, 0.85), finds_s=(0.15, 0.4))
class OnceItSlips(Hidden, slips=0.0, heat=0.0, lost=0.0):
    """A lock-up clutch holds a torque while it sticks, and less once it slides, so that it goes on slipping
    until much less is asked; its own `heat` makes it slide the easier. sticks: of peak torque; slides: of
    that; hot: of it, lost when hot; catches: of what it slides with, where it sticks again.
    Source: Centea, Rahnejat and Menday, Non-Linear Multi-Body Dynamic Analysis for the Study of Clutch
    Torsional Vibrations (Judder), Applied Mathematical Modelling 25 (2001): friction that falls with slip;
    worn paper in a lock-up, sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        torque = view.engine_torque / self.truck.peak_torque
        holds = p.sticks * (1.0 - p.hot * s.heat)
        slides = p.slides * holds
        size = np.abs(torque)
        s.slips = np.where(size > holds, 1.0, np.where(size < p.catches * slides, 0.0, s.slips))
        over = np.sign(torque) * np.maximum(size - slides, 0.0) * 0.6 * s.slips
        s.lost = s.lost + dt * (over - s.lost) / p.finds_s
        s.heat = np.clip(s.heat + dt * (4.0 * np.abs(s.lost) / p.heats_s - s.heat / p.cools_s), 0.0, 1.0)
        given = np.sign(s.lost) * np.minimum(np.abs(s.lost), size)
        return -self.at_wheels(view, given * self.truck.peak_torque) * np.clip(view.speed - 1.0, 0.0, 1.0)


@law(
    "x_rotor_between_two_shafts",
    needs="suburban hills",
    name="rotating_inertia",
    accepts="mass payload_change",
)
@sizes(share=(0.16, 0.3), still=(0.28, 0.45), slips_s=(0.35, 0.9), most=(0.06, 0.11))
class RotorBetweenTwoShafts(Hidden, rotor=-99.0):
    """`rotor` m/s of a heavy rotor on the third shaft of a planetary gear, between the engine and the wheels:
    what it turns with is a difference of both, so that it weighs much in low gears, nothing in one gear, and
    has to be turned up or down at every change of gear, through a clutch that slips. share: of the mass, in
    the middle gears; still: of the highest ratio seen, where it stands; most: of the weight.
    Source: Miller, Hybrid Electric Vehicle Propulsion System Architectures of the e-CVT Type, IEEE Trans.
    Power Electronics 21 (2006): speeds of three shafts; a rotor of a generator, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "highest": np.full(batch, 12.0)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.highest = np.maximum(s.highest, np.minimum(view.ratio, 25.0))
        lever = np.clip(view.ratio / (p.still * s.highest) - 1.0, -1.0, 1.6)
        wants = lever * np.maximum(view.speed, 0.0)
        s.rotor = np.where(s.rotor < -90.0, wants, s.rotor)
        pace = (wants - s.rotor) / p.slips_s
        force = p.share * view.mass * lever * pace
        limit = p.most * weight(view)
        felt = limit * np.tanh(force / limit)
        s.rotor = s.rotor + dt * pace * np.abs(felt) / np.maximum(np.abs(force), 1.0)
        s.rotor = np.where(np.abs(force) < 1.0, s.rotor + dt * pace, s.rotor)
        return np.asarray(-felt * np.clip(view.speed - 0.3, 0.0, 1.0))


@law("x_torque_by_good_conduct", needs="suburban hills", name="torque_limit", shown=True)
@sizes(least=(0.28, 0.45), counts=(0.25, 0.5), forgets_s=(60.0, 200.0), harsh=(0.5, 0.8), gives_s=(1.0, 3.0))
class TorqueByGoodConduct(Hidden, foot=0.0, pulled=0.0, most=1.1):
    """`score`: harsh acts of late. Each kick of the pedal and each hard braking counts, calm minutes take it
    back; who has a bad score gets less of the torque. least: of peak torque, at the worst; counts: of the
    worst, for each act; harsh: of the full pedal, within half a second or so.
    Source: Toledo, Musicant and Lotan, In-Vehicle Data Recorders for Monitoring and Feedback on Drivers'
    Behavior, Transportation Research C 16 (2008): manoeuvres that are counted and weighed; here the truck
    answers them, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "score": self.rng(1332).uniform(0.2, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = self.pedal(view)
        s.foot = s.foot + dt * (pedal - s.foot) / 0.8
        kick = np.clip((pedal - s.foot) / (0.5 * p.harsh), 0.0, 1.5)
        hard = np.clip(view.brake_force / weight(view) / 0.12, 0.0, 1.5)
        acts = np.maximum(np.maximum(kick, hard) - 0.5, 0.0)
        s.score = np.clip(s.score + dt * (p.counts * acts - s.score / p.forgets_s), 0.0, 1.0)
        allows = 1.1 - (1.1 - p.least) * np.clip(1.3 * s.score - 0.15, 0.0, 1.0)
        s.most = s.most + dt * (allows - s.most) / p.gives_s
        excess = np.maximum(view.engine_torque - s.most * self.truck.peak_torque, 0.0)
        return -self.at_wheels(view, excess) * moving(view)


@law("x_magnets_turn_along", needs="suburban hills highway descent", name="unknown")
@sizes(
    drags=(0.010, 0.019), peak_mps=(7.0, 13.0), out_mps=(14.0, 18.0), back=(0.65, 0.8), warms_s=(60.0, 200.0)
)
@sizes(weakens=(0.3, 0.5), moves_s=(0.3, 1.0))
class MagnetsTurnAlong(Hidden, joined=1.0, clutch=1.0, warm=0.0):
    """A helper axle with magnets in its motor is not switched on, but it turns along and its iron drags. A
    clutch parts it above a speed, and joins it again only well below; while parted it cools, and warm magnets
    drag less. drags: of the weight; back: of out_mps; weakens: of the drag, all warm.
    Source: Mi, Slemon and Bonert, Modeling of Iron Losses of Permanent-Magnet Synchronous Motors, IEEE Trans.
    Industry Applications 39 (2003): hysteresis and eddy parts over speed; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        fast, slow = view.speed > p.out_mps, view.speed < p.back * p.out_mps
        s.joined = np.where(fast, 0.0, np.where(slow, 1.0, s.joined))
        s.clutch = s.clutch + dt * (s.joined - s.clutch) / p.moves_s
        ratio = np.maximum(view.speed, 0.0) / p.peak_mps
        iron = 0.4 + 0.6 * np.minimum(ratio, 1.8)
        s.warm = np.clip(s.warm + dt * (s.clutch * iron - s.warm) / p.warms_s, 0.0, 1.2)
        drag = p.drags * iron * (1.0 - p.weakens * s.warm) * s.clutch
        return -drag * weight(view) * moving(view)
