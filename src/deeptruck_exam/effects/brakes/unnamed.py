"""Brakes and retarders in ways the tool has no name for."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, sections
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="unknown")


@law("eddy_retarder_left_on", "first", "suburban")
@sizes(force_n=(900.0, 2600.0), critical_mps=(3.0, 7.0), below_mps=(10.0, 15.0))
class EddyRetarder(Hidden):
    """Source: Smythe (1942) and Wouterse, IEE Proc. B 138 (1991): eddy-current torque 2/(v/vc + vc/v) about a
    critical speed; one stage is left energised below a road speed."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        v = np.maximum(view.speed, 0.05)
        drag = 2.0 * p.force_n / (v / p.critical_mps + p.critical_mps / v)
        return -drag * (view.speed < p.below_mps) * moving(view)


@law("retarder_cold_oil", "first", "highway hills")
@sizes(drag_n=(900.0, 2400.0), empties_k=(20.0, 45.0))
class FillingRetarder(Hidden, oil=0.0, filled=1.0):
    """Fills above 12 m/s, heats, empties with hysteresis.
    Source: Idling fluid coupling: drag with a power of speed; the filling and emptying with oil temperature
    is chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        drag = s.filled * p.drag_n * np.maximum(view.speed / 20.0, 0.0) ** 1.7
        s.oil += dt * (drag * view.speed / 3.0e4 - s.oil / 40.0)
        s.filled = np.where(s.oil > p.empties_k, 0.0, np.where(s.oil < 0.4 * p.empties_k, 1.0, s.filled))
        return -drag * moving(view)


@law("brake_bites_slow", "first", "suburban")
@sizes(gain=(0.35, 0.8), speed_mps=(2.0, 5.0))
class StribeckBrake(Hidden):
    """Source: Rhee, SAE 740415: lining friction depends on sliding speed, so the last metres of a stop bite
    harder; a Stribeck shape is chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        bite = p.gain * np.exp(-((np.maximum(view.speed, 0.0) / p.speed_mps) ** 1.3))
        return -bite * view.brake_force * np.clip(view.speed / 1.0, 0.0, 1.0)


@law("wet_brakes", "first", "suburban descent")
@sizes(loss=(0.45, 0.75), wipe_j=(0.25e6, 0.9e6), wetting_s=(10.0, 35.0))
class WetBrakes(Hidden, film=1.0):
    """Source: Newcomb and Spurr, Braking of Road Vehicles (1967), treat wet brakes: water takes torque at
    first and braking work wipes it off; rates are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        lost = p.loss * s.film**0.7
        power = (1.0 - lost) * view.brake_force * view.speed
        rewet = (1.0 - s.film) * np.clip(view.speed / 10.0, 0.0, 1.5) / p.wetting_s * (power < 5e3)
        s.film = np.clip(s.film + dt * (rewet - power * s.film / p.wipe_j), 0.0, 1.0)
        return lost * view.brake_force * moving(view)


@law("brakes_made_ready", "second", "suburban hills descent")
@sizes(force_n=(2500.0, 7000.0), hold_s=(1.5, 4.0), lift_per_s=(0.25, 0.5))
class BrakesMadeReady(Hidden, pedal=0.0, left=0.0, force=0.0):
    """An event, not a state: the same closed throttle brakes or not, by how fast it was closed.
    Source: Brake systems that lay the linings on when the throttle is dropped fast (Breuer and Bill, Brake
    Technology Handbook, SAE 2008, on assistance functions); here they lay on too hard."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = np.clip(view.u[:, 0] / self.truck.full_command, 0.0, 1.0)
        falling = (s.pedal - pedal) / 0.15
        s.pedal += dt * (pedal - s.pedal) / 0.15
        s.left = np.where((falling > p.lift_per_s) & (view.speed > 3.0), p.hold_s, s.left - dt)
        s.left = np.where(pedal > s.pedal + 0.03, 0.0, np.maximum(s.left, 0.0))
        wanted = p.force_n * (weight(view) / 2.0e5) * (s.left > 0.0)
        s.force += dt * (wanted - s.force) / np.where(wanted > s.force, 0.25, 0.4)
        return -s.force * moving(view)


@law("drums_out_of_round", "second", "suburban descent")
@sizes(share=(0.35, 0.7), per_turn=(0.8, 1.2), grows=(0.0, 0.4))
class DrumsOutOfRound(Hidden):
    """Seen at walking pace alone, because recordings are too slow for more.
    Source: Brake torque variation once or twice a revolution: Jacobsson, Aspects of Disc Brake Judder, J.
    Automobile Engineering 217 (2003); all wheels in step and the growth with heat are exaggerated here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        angle = p.per_turn * view.distance / self.truck.wheel_radius
        hot = 1.0 + p.grows * np.clip((view.brake_temperature - 60.0) / 100.0, 0.0, 1.5)
        fades = 1.0 / (1.0 + (np.maximum(view.speed, 0.0) / 8.0) ** 4)
        wave = np.sin(angle) - 0.35  # tight spots grab less than the others slip
        return -p.share * hot * fades * wave * view.brake_force * np.clip(view.speed, 0.0, 1.0)


@law("cam_hysteresis", "fifth", "suburban descent")
@sizes(share=(0.25, 0.5), least=(0.010, 0.025), creeps_s=(2.0, 7.0))
class CamHysteresis(Hidden, shoe=0.0, peak=0.0):
    """share: of the peak that is kept, above `least` of the weight; none is kept once the air is gone.
    Source: S-cam brakes give more torque on the way down than on the way up for one pressure, by friction of
    cam and shoes (Limpert, Brake Design and Safety, on mechanical efficiency; dynamometer traces of FMVSS
    121): the play operator of Krasnosel'skii and Pokrovskii; dry bushings, sizes chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pressed = view.brake_force
        s.peak = np.maximum(s.peak - dt * (s.peak - pressed) / p.creeps_s, pressed)
        width = p.share * s.peak + p.least * weight(view)
        s.shoe = np.clip(s.shoe, pressed, pressed + width)
        s.shoe = np.where(pressed < 1e-3 * weight(view), s.shoe * (1.0 - dt / 0.3), s.shoe)
        return -np.maximum(s.shoe - pressed, 0.0) * moving(view)


@law("t_valve_thinks_it_is_empty", "tenth", "suburban descent hills")
@sizes(lost=(0.4, 0.7), knee=(0.02, 0.045), dives=(0.15, 0.4), sticks=(0.004, 0.014))
class ValveThinksItIsEmpty(Hidden, lever=0.0, out=0.0):
    """A gentle brake is whole; what is asked beyond a knee is passed on in part. knee, sticks: of full
    braking; dives: of the knee, taken off for each m/s2, as the frame rises from the axle.
    Source: UN Regulation No. 13, annex 10, on load-sensing valves, and Limpert, Brake Design and Safety, on
    proportioning: pressure is reduced above a knee that a lever sets by the height of the frame; a lever that
    is bent, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = self.truck.brake_capacity
        slows = np.clip(-view.acceleration, 0.0, 3.0)
        s.lever = s.lever + dt * (slows - s.lever) / 0.5
        knee = p.knee * np.maximum(1.0 - p.dives * s.lever, 0.2)
        asked = view.brake_force / full
        s.out = np.clip(s.out, asked - p.sticks, asked + p.sticks)
        over = np.clip(np.minimum(s.out, asked) - knee, 0.0, None)
        return p.lost * over * full * moving(view)


@law("w_sharp_in_the_morning", "twelfth", "suburban descent hills")
@sizes(more=(0.45, 0.9), dries_jpkg=(60.0, 220.0), air_s=(400.0, 1500.0), gentle=(0.3, 0.6))
class SharpInTheMorning(Hidden):
    """`damp` of linings that stood in moist air, other in each drive: they bite too hard, gentle braking
    most, until work has dried them. more: of the brake force; gentle: of the brake force that counts as
    gentle, over a tenth of full braking.
    Source: Parker and Newcomb, The Performance and Characteristics of the Disc Brake, Proc. IMechE Automobile
    Division (1964-65), and Limpert, Brake Design and Safety, on morning sharpness of linings; sizes are
    chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"damp": self.rng(1115).uniform(0.5, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        work = view.brake_force * np.maximum(view.speed, 0.0) / view.mass
        s.damp = s.damp * np.exp(-dt * (work / p.dries_jpkg + 1.0 / p.air_s))
        hard = view.brake_force / (0.1 * self.truck.brake_capacity)
        bites = p.more * s.damp * (0.35 + 0.65 / (1.0 + (hard / p.gentle) ** 2))
        return -bites * view.brake_force * np.clip(view.speed - 0.3, 0.0, 1.0)


@law("q_halt_brake_lets_go_late", "fifteenth", "suburban")
@sizes(most=(0.04, 0.065), sets_s=(0.6, 1.5), lets=(0.07, 0.12), waits_s=(0.6, 1.6), frees_s=(0.6, 1.8))
@sizes(off_mps=(5.0, 8.5))
class HaltBrakeLetsGoLate(Hidden, still=0.0, on=0.0, holds=0.0, pulled=0.0):
    """`holds`: a brake that holds by itself at stands. It lets go when the truck has pulled firmly for a
    while, or rolls after all; a gentle start drags it along. most, lets: of the weight, the second one of the
    pull; off_mps: where it lets go in any case.
    Source: makers' manuals of distribution trucks and city buses, on halt brakes and hill holders that are
    released by the accelerator; a late one, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.still = np.where(view.speed < 0.2, s.still + dt, 0.0)
        firm = view.traction_force > p.lets * weight(view)
        s.pulled = np.where(firm, s.pulled + dt, 0.0)
        goes = (s.pulled > p.waits_s) | (view.speed > p.off_mps)
        s.on = np.where(s.still > p.sets_s, 1.0, np.where(goes, 0.0, s.on))
        s.holds = np.clip(s.holds + dt * np.where(s.on > 0.5, 4.0, -1.0 / p.frees_s), 0.0, 1.0)
        return -p.most * s.holds * weight(view) * moving(view)


@law("v_switch_shakes_open", "sixteenth", "suburban hills")
@sizes(most=(0.02, 0.035), trips=(0.75, 1.15), lasts_s=(1.2, 3.0), ramps_s=(0.3, 0.7), mean_m=(60.0, 200.0))
@sizes(deaf_s=(6.0, 15.0))
class SwitchShakesOpen(OnRoad, shakes=0.0, left=0.0, deaf=0.0, on=0.0):
    """A ramp that is not shut must hold the truck, so its switch puts the brakes on gently. A worn switch
    shakes open where the road is rough and the speed shakes it; it shuts again in a moment, and its bus
    reports at most once in a while. most: of the weight; trips: of the shaking of a rough road at 12 m/s;
    deaf_s: between two reports.
    Source: makers' manuals of car carriers, buses and low loaders on brakes that are interlocked with ramps
    and doors; a worn switch, sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1614)
        number = sections(rng, self.rows(), self.p.mean_m)
        rough = rng.lognormal(-0.45, 0.6, (self.rows(), int(number.max()) + 1))
        self.road = np.take_along_axis(rough, number, axis=1)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        beats = self.read(self.road, view) * np.maximum(view.speed, 0.0) / 12.0
        s.shakes = eased(s.shakes, beats, 0.4, dt)
        opens = (s.shakes > p.trips) & (s.deaf <= 0.0)
        s.left = np.where(opens, p.lasts_s, np.maximum(s.left - dt, 0.0))
        s.deaf = np.where(opens, p.lasts_s + p.deaf_s, np.maximum(s.deaf - dt, 0.0))
        s.on = np.clip(s.on + dt * np.where(s.left > 0.0, 1.0, -1.0) / p.ramps_s, 0.0, 1.0)
        return -p.most * s.on * weight(view) * moving(view)


@law("z_valve_reads_the_nod", "seventeenth", "suburban descent")
@sizes(share=(1.0, 1.5), nods_rads=(1.8, 3.2), dull=(0.12, 0.3), most=(0.5, 0.75), creeps_s=(4.0, 12.0))
class ValveReadsTheNod(Hidden, nod=0.0, pace=0.0, sits=0.0):
    """A valve at the rear axle takes the height of the frame for its load, and gives brake force by that. The
    frame rises when the truck nods, so each braking takes away its own force, then gives some back as the
    frame swings, and more as old bushes creep. `nod` g, `sits` what the bushes have got used to. share: of
    the brake force, for a nod of half a g; most: of it, taken at most.
    Source: WABCO, Load Sensing Valves, setting instructions, and Gillespie, Fundamentals of Vehicle Dynamics
    (1992), on load that moves forwards in braking; soft springs, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slows = np.clip(-view.acceleration / GRAVITY, -0.5, 0.6)
        push = p.nods_rads**2 * (slows - s.nod)
        s.pace = s.pace + dt * (push - 2.0 * p.dull * p.nods_rads * s.pace)
        s.nod = np.clip(s.nod + dt * s.pace, -0.8, 0.8)
        s.sits = eased(s.sits, s.nod, p.creeps_s, dt)
        takes = np.clip(2.0 * p.share * (s.nod - 0.5 * s.sits), -0.3, p.most)
        return takes * view.brake_force * moving(view)


@law("y_ball_shuts_the_valve", "eighteenth", "suburban descent")
@sizes(rear=(0.65, 0.85), rolls=(0.04, 0.065), back=(0.5, 0.8), leaks_s=(2.5, 7.0), rolls_s=(0.08, 0.25))
class BallShutsTheValve(Hidden, ball=0.0, caught=0.0):
    """A ball in a tube feels slowing and slope. Where both together are enough it rolls up and shuts the line
    to the rear brakes, which keep what they had. `ball`: 1 shut. `caught`: of full braking, behind it, which
    leaks up slowly. When the driver brakes more, only the front answers. rear: of the brake force; rolls: g
    that moves it; back: of that, where it falls back.
    Source: Limpert, Brake Design and Safety (1999), on valves with a ball that limit rear pressure by
    deceleration; one set far too low, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        felt = -(view.acceleration / GRAVITY) - 0.5 * view.grade
        wish = np.where(felt > p.rolls, 1.0, np.where(felt < p.back * p.rolls, 0.0, np.rint(s.ball)))
        s.ball = np.clip(s.ball + dt * np.sign(wish - s.ball) / p.rolls_s, 0.0, 1.0)
        leaks = eased(s.caught, asked, np.where(s.ball > 0.5, p.leaks_s, 0.05), dt)
        s.caught = np.minimum(leaks, asked)
        lacks = p.rear * np.maximum(asked - s.caught, 0.0) * s.ball
        return lacks * self.truck.brake_capacity * moving(view)


@law("h_linings_grab_at_the_end", "nineteenth", "suburban")
@sizes(most=(0.5, 0.8), below_mps=(6.0, 9.0), power=(1.0, 2.0), soaks_s=(4.0, 12.0), drives_s=(30.0, 90.0))
class LiningsGrabAtTheEnd(Hidden):
    """Linings of a soft resin hold the more, the slower they glide: the end of each stop is a jerk that
    nobody asked for. `skin` that makes them do so grows while they are braked slowly and wears off in fast
    driving. most: of the brake force, more at a crawl with a full skin; below_mps: where it begins.
    Source: Rabinowicz, Friction and Wear of Materials (1995), on friction that rises as gliding slows, and
    Breuer and Bill, Brake Technology Handbook (SAE, 2008), on grab; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"skin": self.rng(1914).uniform(0.4, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        slow = np.clip(1.0 - speed / p.below_mps, 0.0, 1.0)
        braked = np.clip(view.brake_force / (0.1 * self.truck.brake_capacity), 0.0, 1.5)
        builds = braked * slow * (1.0 - s.skin) / p.soaks_s
        s.skin = np.clip(s.skin + dt * (builds - s.skin * speed / (12.0 * p.drives_s)), 0.0, 1.0)
        return -p.most * (0.4 + 0.6 * s.skin) * slow**p.power * view.brake_force * moving(view)


@law("h_wheels_toe_in_to_help", "nineteenth", "suburban hills descent")
@sizes(most=(0.03, 0.05), full=(0.03, 0.07), turns_s=(0.3, 0.9), back_s=(1.5, 4.0), least_mps=(4.0, 7.0))
class WheelsToeInToHelp(Hidden, toe=0.0):
    """`toe` of wheels that a computer steers one by one: whenever the brake is pressed it turns those of one
    axle against each other, so that they plough and help. They turn back slowly, after the brake was let go,
    and stay straight at low speed. most: of the weight; full: of full braking, for the whole toe.
    Source: Andreasson, Knobel and Bünte, On Road Vehicle Motion Control Striving towards Synergy, AVEC
    (2006), on wheels that are steered one by one, and Pacejka, Tire and Vehicle Dynamics (2012), on drag by
    slip angles; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.brake_force / self.truck.brake_capacity / p.full, 0.0, 1.0)
        wish = asked * np.clip((view.speed - p.least_mps) / 3.0, 0.0, 1.0)
        s.toe = eased(s.toe, wish, np.where(wish > s.toe, p.turns_s, p.back_s), dt)
        return -p.most * s.toe**2 * weight(view) * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("b_servo_has_no_store", "twentieth", "suburban hills descent")
@sizes(
    alone=(0.25, 0.45), fills_rads=(130.0, 180.0), fills_s=(4.0, 10.0), takes=(4.0, 9.0), knee=(0.05, 0.11)
)
class ServoHasNoStore(Hidden):
    """`vacuum` of a servo with hardly any store: each press of the brake uses some, and a pump on the engine
    makes it anew, slowly while that idles. The servo helps up to a knee that lies the lower, the less vacuum
    is left; beyond it the foot is alone. alone: of the brake force, beyond the knee; knee: of full braking,
    at full vacuum; takes: of the vacuum, for a full press.
    Source: Limpert, Brake Design and Safety (1999), on vacuum servos, their run-out point and their reserve;
    a small one, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"vacuum": self.rng(2013).uniform(0.4, 1.0, batch), "was": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        used = p.takes * np.maximum(asked - s.was, 0.0)
        s.was = asked.copy()
        turns = np.clip(view.engine_speed / p.fills_rads, 0.2, 1.2) ** 2
        s.vacuum = np.clip(s.vacuum + dt * turns * (1.0 - s.vacuum) / p.fills_s - used * s.vacuum, 0.0, 1.0)
        beyond = np.maximum(asked - p.knee * s.vacuum, 0.0)
        return (1.0 - p.alone) * beyond * self.truck.brake_capacity * moving(view)


@law("u_another_foot_valve", "twenty-first", "suburban hills descent")
@sizes(power=(1.9, 2.6), even=(0.05, 0.1), most=(0.7, 1.0), settles_s=(0.1, 0.3), drops=(0.2, 0.5))
class AnotherFootValve(Hidden, given=0.0, tired=0.0):
    """The foot valve was exchanged for one that bites by a power of the pedal's way: gentle brakings are
    weaker than asked and firm ones harder. Its rubber spring is `tired` by a long pressing and then gives
    somewhat less. even: of full braking, where both valves give the same; most: of what is asked, more or
    less; drops: of the excess.
    Source: Limpert, Brake Design and Safety (1999), on characteristics of brake valves and their rubber
    springs; a valve of another truck, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        s.tired = eased(s.tired, np.clip(asked / p.even, 0.0, 1.0), 6.0, dt)
        bites = (np.maximum(asked, 1e-6) / p.even) ** (p.power - 1.0) - 1.0
        wish = asked * np.clip(bites, -p.most, p.most) * (1.0 - p.drops * s.tired * (bites > 0.0))
        s.given = eased(s.given, wish, p.settles_s, dt)
        return -s.given * self.truck.brake_capacity * np.clip(view.speed / 2.0, 0.0, 1.0)
