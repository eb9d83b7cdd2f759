"""Pedals and their links. The tool has no name for these."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import (
    GRAVITY,
    Array,
    Hidden,
    Sizes,
    State,
    TorqueFilter,
    eased,
    index,
    moving,
)
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, name="unknown")


@law("worn_linkage", "fourth", "suburban hills highway")
@sizes(play=(0.14, 0.30))
class LinkagePlay(TorqueFilter):
    """The lever follows the pedal when its play is used up, and stays where it is in between.
    Source: Lost motion in the throttle linkage of mechanically governed diesels, in every workshop manual;
    the play operator of Krasnosel'skii and Pokrovskii, Systems with Hysteresis (1989); play chosen here."""

    def begin(self, s: State, u: Array) -> None:
        s.rod = u[:, 0].copy()

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        half = 0.5 * p.play * self.full
        s.rod = np.clip(s.rod, pedal - half, pedal + half)
        # a closed pedal reaches the stop, which pulls the lever home over half a second
        s.rod = np.where(pedal <= 0.002 * half, s.rod * (1.0 - dt / 0.5), s.rod)
        return np.asarray(np.maximum(s.rod, 0.0))


@law("connector_drops_out", "fourth", "suburban hills highway")
@sizes(every_s=(9.0, 22.0), lasts_s=(0.5, 1.6), burst=(0.3, 0.6))
class ConnectorDropsOut(Hidden):
    """burst: the chance that one failure is followed by another at once.
    Source: Intermittent pedal sensors (service bulletins on idle validation; fretting of connectors:
    Swingler, McBride and Maul, IEEE Trans. Compon. Packag. Technol. 23, 2000): the engine falls to idle for
    about a second, in bursts, the more the truck shakes; odds are chosen here."""

    def prepare(self) -> None:
        self.dice = self.rng(381).random((self.setting.batch, int(self.setting.duration_s / 0.1) + 20))

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {"left": zero, "given": np.ones(batch), "bad": zero.copy(), "seen": np.full(1, -1)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = index(view, self.dice, 0.1)
        if at != s.seen[0]:
            s.seen[0] = at
            shakes = np.clip(view.speed / 14.0, 0.2, 1.6)
            chance = 0.1 / p.every_s * shakes + 0.1 / 3.0 * p.burst * (s.bad > 0.0)
            s.left = np.where((self.dice[:, at] < chance) & (s.left <= 0.0), p.lasts_s, s.left)
        s.left = np.maximum(s.left - dt, 0.0)
        s.bad = np.where(s.left > 0.0, 3.0, np.maximum(s.bad - dt, 0.0))
        lost = s.left > 0.0
        s.given += dt * (np.where(lost, 0.0, 1.0) - s.given) / np.where(lost, 0.06, 0.35)
        return -self.at_wheels(view, (1.0 - s.given) * np.maximum(view.engine_torque, 0.0))


@law("pedal_sticks_where_it_rests", "sixth", "suburban hills highway")
@sizes(sticks=(0.16, 0.34), sets_s=(1.5, 5.0), same=(0.03, 0.06), creeps_s=(3.0, 9.0))
class PedalSticksWhereItRests(Hidden, stuck=0.0, rests=0.0):
    """stuck: share of the command that the engine still gets; `rests` s near one place.
    Source: Sticking pedals recalled in January 2010 (NHTSA; NASA Engineering and Safety Center, Technical
    Support to NHTSA on Unintended Acceleration, 2011): a pedal held in one place for a while comes back late
    or not at all, until it is moved far or the driver brakes; forces and times are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = self.pedal(view)
        below = s.stuck - asked
        s.rests = np.where(np.abs(below) < p.same, s.rests + dt, np.maximum(s.rests - dt, 0.0))
        breaks = (below > p.sticks * (1.0 - np.exp(-s.rests / p.sets_s))) | (view.u[:, 1] > 0.0)
        s.rests = np.where(breaks & (below > p.same), 0.0, s.rests)
        creeps = asked + below * (1.0 - dt / p.creeps_s)
        s.stuck = np.where((below < 0.0) | breaks, asked, creeps)
        more = np.minimum(np.maximum(s.stuck - asked, 0.0), 0.5)
        return self.at_wheels(view, more * self.truck.peak_torque) * moving(view)


@law("s_pedal_map", "eighth", "suburban hills highway", shown=True)
@sizes(bends=(0.12, 0.28), at=(0.3, 0.6), changes_s=(4.0, 15.0))
class PedalMap(Hidden, mode=0.0):
    """Brisk driving earns a sharp pedal, calm driving a dull one. bends: of peak torque.
    Source: Pedal maps adapted to the driver's style (Kiencke and Nielsen, Automotive Control Systems, 2005,
    on drive modes): less torque at part pedal, more with the style; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = self.pedal(view)
        s.mode = s.mode + dt * ((pedal > p.at) - s.mode) / p.changes_s
        bend = p.bends * (2.5 * s.mode - 1.0) * np.sin(np.pi * pedal)
        return self.at_wheels(view, bend * self.truck.peak_torque) * moving(view)


@law("t_second_pair_of_pedals", "tenth", "suburban hills")
@sizes(mps2=(0.35, 0.8), lasts_s=(1.2, 3.0), every_s=(12.0, 30.0), foot_s=(0.2, 0.5))
class SecondPairOfPedals(Hidden, foot=0.0):
    """A teacher brakes in passing when the pupil does not, harder the faster they go; only the pupil's pedals
    are recorded. mps2: at 12 m/s.
    Source: Dual controls of vehicles for driving instruction (Directive 2006/126/EC on driving licences, and
    national rules for instructors' pedals); how often and how hard is chosen here."""

    def prepare(self) -> None:
        p, rng, batch = self.p, self.rng(962), self.setting.batch
        lasts, every = (0.6 * p.lasts_s, 1.4 * p.lasts_s), (0.5 * p.every_s, 1.5 * p.every_s)
        self.steps_in = spells(rng, batch, lasts, every)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wants = within(self.steps_in, view.time) * (view.brake_force <= 0.0) * (view.speed > 3.0)
        s.foot = s.foot + dt * (wants - s.foot) / p.foot_s
        hard = p.mps2 * np.sqrt(np.clip(view.speed / 12.0, 0.0, 2.0))
        return -s.foot * hard * view.mass * moving(view)


@law("v_wipers_soften_the_pedal", "sixteenth", "suburban hills highway")
@sizes(bends=(0.45, 0.9), rain_s=(15.0, 50.0), dry_s=(15.0, 50.0), eases_s=(1.5, 4.0), waits_s=(3.0, 8.0))
class WipersSoftenThePedal(Hidden, soft=0.0, wipes=0.0):
    """While wipers run the engine takes its pedal by a softer curve, so that less comes of a light pedal and
    all of a full one. A shower has to last a while before the computer believes it, and its end likewise.
    bends: power that the curve has beyond 1.
    Source: makers' manuals on rain modes that soften the pedal and on rain sensors of wipers; showers, sizes
    are chosen here."""

    def prepare(self) -> None:
        on, off = (0.6 * self.p.rain_s, 1.4 * self.p.rain_s), (0.6 * self.p.dry_s, 1.4 * self.p.dry_s)
        self.rain = spells(self.rng(1621), self.setting.batch, on, off)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.wipes = np.clip(s.wipes + dt * (2.0 * within(self.rain, view.time) - 1.0) / p.waits_s, 0.0, 1.0)
        wish = np.where(s.wipes > 0.99, 1.0, np.where(s.wipes < 0.01, 0.0, np.round(s.soft)))
        s.soft = eased(s.soft, wish, p.eases_s, dt)
        pedal = np.clip(self.pedal(view), 0.02, 1.0)
        lacks = 1.0 - pedal ** (p.bends * s.soft)
        return -self.at_wheels(view, lacks * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("z_learns_where_the_pedal_rests", "seventeenth", "suburban hills highway")
@sizes(believes=(0.7, 0.9), up_s=(15.0, 40.0), down_s=(1.0, 4.0), most=(0.2, 0.35))
class LearnsWhereThePedalRests(Hidden):
    """`rest`: where the computer believes the pedal to be when no foot is on it. It takes the lowest of
    late for that. So a foot that has long been on the pedal becomes the new zero, and only the way above it
    counts. A lifted foot teaches it better in seconds. believes: of a steady pedal, that it takes for rest;
    most: of the pedal's way.
    Source: Bosch Automotive Handbook (2014), on accelerator pedal modules and the learning of their
    released position; one that learns too fast, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"rest": self.rng(1723).uniform(0.02, 0.5, batch) * self.p.most}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = np.clip(self.pedal(view), 0.0, 1.0)
        wish = np.minimum(p.believes * pedal, p.most)
        s.rest = eased(s.rest, wish, np.where(wish > s.rest, p.up_s, p.down_s), dt)
        counts = np.clip((pedal - s.rest) / (1.0 - s.rest), 0.0, 1.0)
        lacks = 1.0 - counts / np.maximum(pedal, 0.02)
        return -self.at_wheels(view, np.clip(lacks, 0.0, 1.0) * np.maximum(view.engine_torque, 0.0)) * moving(
            view
        )


@law("y_cab_tugs_at_its_cable", "eighteenth", "suburban hills")
@sizes(per_g=(2.0, 4.0), rocks_rads=(1.1, 2.2), dull=(0.08, 0.2), most=(0.15, 0.25), slack=(0.004, 0.012))
class CabTugsAtItsCable(Hidden, lean=0.0, pace=0.0):
    """The pedal stands in a cab on soft springs, and a cable goes from there to the engine on the frame.
    `lean` g of the cab: pulling leans it back and slackens the cable, braking and lifting tightens it. So the
    engine's torque swings after each change. per_g: of the pedal's way; slack: g of lean that does nothing.
    Source: Lemerle, Boulanger and Poirot, A Simplified Method to Design Suspended Cabs, J. Sound and
    Vibration 253 (2002), on modes of cabs; the cable and its sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration / GRAVITY + view.grade, -0.3, 0.3)
        push = p.rocks_rads**2 * (felt - s.lean)
        s.pace = s.pace + dt * (push - 2.0 * p.dull * p.rocks_rads * s.pace)
        s.lean = np.clip(s.lean + dt * s.pace, -0.4, 0.4)
        beyond = np.sign(s.lean) * np.maximum(np.abs(s.lean) - p.slack, 0.0)
        pedal = self.pedal(view)
        tugs = np.clip(-p.per_g * beyond, -p.most, p.most) * np.minimum(pedal / 0.1, 1.0)
        tugs = np.clip(tugs, -pedal, 1.0 - pedal)
        return self.at_wheels(view, tugs * self.truck.peak_torque) * moving(view)


@law("h_pedal_asks_for_a_pull", "nineteenth", "suburban hills highway")
@sizes(gain=(0.4, 0.8), most=(0.25, 0.4), thinks=(0.75, 1.0), late_s=(0.5, 1.4), eases_s=(0.4, 1.0))
class PedalAsksForAPull(Hidden, misses=0.0, given=0.0):
    """The pedal is taken for a wish of acceleration on a level road. A loop adds torque where the truck gains
    less than that, as uphill or loaded, and takes torque where it gains more. `misses` m/s2, as the loop sees
    it, somewhat late. gain: of what is missed; most: of peak torque; thinks: of the mass, that it believes.
    Source: Kiencke and Nielsen, Automotive Control Systems (2005), on driveline control by a wanted
    acceleration; the loop and its sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = self.pedal(view)
        wheels = pedal * self.truck.peak_torque * view.ratio / self.truck.wheel_radius
        expects = (wheels - view.drag_force) / (
            p.thinks * view.mass
        ) - self.truck.rolling_resistance * GRAVITY
        s.misses = eased(s.misses, np.clip(expects - view.acceleration, -2.0, 2.0), p.late_s, dt)
        per_mps2 = view.mass * self.truck.wheel_radius / np.maximum(view.ratio, 1.0) / self.truck.peak_torque
        wish = np.clip(p.gain * s.misses * per_mps2, -p.most, p.most) * np.clip(pedal / 0.08, 0.0, 1.0)
        s.given = eased(s.given, np.clip(wish, -pedal, 1.0 - pedal), p.eases_s, dt)
        return self.at_wheels(view, s.given * self.truck.peak_torque) * moving(view)


@law("b_pedal_asks_for_power", "twentieth", "suburban hills highway")
@sizes(blend=(0.5, 0.9), at_rads=(120.0, 150.0), most=(0.3, 0.5), late_s=(0.2, 0.7), fades_s=(2.0, 8.0))
class PedalAsksForPower(Hidden, given=0.0, blended=0.5):
    """The pedal is taken for a share of power and not of torque: the engine gives more than was known while
    it turns slowly and less while it turns fast. After each change of gear the programme comes back bit by
    bit. blend: of the programme, over the usual one; at_rads: where both ask for the same; most: of peak
    torque.
    Source: Guzzella and Sciarretta, Vehicle Propulsion Systems (2013), on what a pedal may ask for; the
    programme and its sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = self.pedal(view)
        s.blended = np.where(view.shifting > 0.5, 0.0, eased(s.blended, p.blend, p.fades_s, dt))
        turns = np.clip(p.at_rads / np.maximum(view.engine_speed, 60.0), 0.5, 2.0)
        wish = np.clip(s.blended * pedal * (turns - 1.0), -p.most, p.most)
        s.given = eased(s.given, np.clip(wish, -pedal, 1.0 - pedal), p.late_s, dt)
        return self.at_wheels(view, s.given * self.truck.peak_torque) * moving(view)


@law("u_shunting_mode_stays_in", "twenty-first", "suburban")
@sizes(power=(1.2, 1.5), out_mps=(5.0, 8.0), least=(0.06, 0.14), leaves_s=(0.8, 2.5), kick=(0.85, 0.95))
class ShuntingModeStaysIn(Hidden, mode=0.0, soft=0.0):
    """A mode for shunting softens the pedal after each stand, so that one can creep to a ramp: a power of the
    pedal is given. It should go out at walking pace, and stays in until the truck is much faster or the pedal
    is pressed to the floor. out_mps: where it goes out; kick: pedal that ends it.
    Source: makers' manuals of automated gearboxes on modes for manoeuvring and their pedal maps; a mode that
    stays in, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = self.pedal(view)
        ends = (view.speed > p.out_mps) | (pedal > p.kick)
        s.mode = np.where(view.speed < 0.4, 1.0, np.where(ends, 0.0, s.mode))
        s.soft = eased(s.soft, s.mode, np.where(s.mode > s.soft, 0.2, p.leaves_s), dt)
        gives = np.maximum(pedal**p.power, np.minimum(pedal, p.least))
        lacks = s.soft * (pedal - gives) * self.truck.peak_torque
        lacks = np.minimum(lacks, np.maximum(view.engine_torque, 0.0))
        return -self.at_wheels(view, lacks) * moving(view)
