"""Pitted flanks, play by the turn, torque that eases ahead of changes, and rough roads for a converter;
weights that fly out, a shaft that shudders, and pistons that touch their ring."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, sections
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law(
    "v_coast_flanks_are_pitted", needs="hills suburban descent", name="driveline_loss", accepts="torque_gain"
)
@sizes(coasts=(0.5, 0.9), pulls=(0.2, 0.32), film_mps=(7.0, 14.0), heats=(0.6, 1.4), warms_s=(20.0, 60.0))
class CoastFlanksArePitted(Hidden):
    """`thin`: the oil in an axle, by the work that is lost in it. Its coast flanks are pitted, so that it
    takes more of the torque when the truck pushes than when the engine pulls. A film parts the flanks the
    better, the faster they run and the thicker the oil. coasts, pulls: of the torque, without a film;
    film_mps: where a third of that is left, with cold oil; heats: of film_mps, more when warm.
    Source: Niemann and Winter, Maschinenelemente II (2003), on pitting, and on losses with the thickness of
    the film; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"thin": self.rng(1631).uniform(0.0, 0.7, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pulls, holds = np.maximum(view.traction_force, 0.0), np.maximum(-view.traction_force, 0.0)
        work = np.clip(np.abs(view.traction_force) / weight(view) / 0.05, 0.0, 1.2)
        s.thin = eased(s.thin, work, p.warms_s, dt)
        bare = np.exp(-np.maximum(view.speed, 0.0) / (p.film_mps * (1.0 + p.heats * s.thin)))
        return -(p.pulls * pulls + p.coasts * holds) * bare * moving(view)


@law("v_play_by_the_turn", needs="suburban hills", name="driveline_backlash")
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


@law("v_eases_ahead_of_changes", needs="suburban hills", name="shift_interruption", accepts="torque_limit")
@sizes(deep=(0.3, 0.5), band_rads=(8.0, 18.0), after_s=(0.6, 1.5), back_s=(0.5, 1.2), forgets=(0.2, 0.5))
class EasesAheadOfChanges(Hidden, gear=0.0, turned=0.0, since=9.0, given=1.0):
    """The gearbox asks the engine for less torque ahead of a change up, and lets it come back late. It has
    learned `at` rad/s, where the last ones came, and eases as the engine comes near that, whether a change
    follows or not. deep: of the torque, taken at that speed; band_rads: below it, where easing begins;
    forgets: of what it believed, at each change.
    Source: Kiencke and Nielsen, Automotive Control Systems (2005), on torque that is controlled to zero
    before gears are moved; one that is learned, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "at": self.rng(1633).uniform(150.0, 180.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        known = s.gear > 0.0
        changed = (view.gear != s.gear) & known & (view.speed > 0.5)
        up = (view.gear > s.gear) & known & (view.speed > 0.5)
        s.at = np.where(up, s.at + p.forgets * (np.maximum(s.turned, 105.0) - s.at), s.at)
        s.since = np.where(changed, 0.0, s.since + dt)
        s.gear = view.gear.copy()
        s.turned = np.where(view.shifting < 0.5, view.engine_speed, s.turned)
        near = np.clip((view.engine_speed - s.at + p.band_rads) / p.band_rads, 0.0, 1.0)
        wish = np.where(s.since < p.after_s, 1.0 - p.deep, 1.0 - p.deep * near)
        s.given = np.clip(np.clip(wish, s.given - dt / 0.25, s.given + dt / p.back_s), 0.0, 1.0)
        return -(1.0 - s.given) * np.maximum(view.traction_force, 0.0) * moving(view)


@law(
    "v_rough_roads_open_it",
    needs="suburban hills highway",
    name="torque_converter_slip",
    accepts="driveline_loss",
    trucks="freightliner",
    gateable=False,
)
@sizes(slips=(0.2, 0.36), frees=(0.4, 0.7), trips=(0.5, 0.8), stays_s=(2.0, 6.0), couples_mps=(9.0, 18.0))
@sizes(mean_m=(120.0, 400.0))
class RoughRoadsOpenIt(OnRoad, shakes=0.0, left=0.0, open=0.0):
    """`open`: the lock-up clutch. Speeds of the wheels that shake on a rough road look like a driveline
    that shuffles, so it is opened. It is shut again once they have been smooth for a while. Open, it slips
    less the faster one drives, and the engine holds back little. slips, frees: of the torque, pulling and
    holding back; trips: of the shaking of a rough road at 15 m/s.
    Source: General Motors service manuals on rough road detection by wheel speeds, which disables lock-up
    and misfire tests; sizes are chosen here."""

    conceal = ("engine_speed",)

    def prepare(self) -> None:
        rng = self.rng(1634)
        number = sections(rng, self.rows(), self.p.mean_m)
        rough = rng.uniform(0.0, 1.3, (self.rows(), int(number.max()) + 1))
        self.road = np.take_along_axis(rough, number, axis=1)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        beats = self.read(self.road, view) * np.sqrt(np.clip(view.speed / 15.0, 0.0, 2.0))
        s.shakes = eased(s.shakes, beats, 0.7, dt)
        s.left = np.where(s.shakes > p.trips, p.stays_s, np.maximum(s.left - dt, 0.0))
        s.open = eased(s.open, np.where(s.left > 0.0, 1.0, 0.0), 0.35, dt)
        share = p.slips * (0.3 + 0.7 * np.exp(-np.maximum(view.speed, 0.0) / p.couples_mps))
        pulls, holds = np.maximum(view.engine_torque, 0.0), np.maximum(-view.engine_torque, 0.0)
        torque = s.open * (p.frees * holds - share * pulls)
        return self.at_wheels(view, torque) * np.clip(view.speed - 1.0, 0.0, 1.0)


@law("v_weights_fly_out", needs="suburban hills", name="rotating_inertia", accepts="mass payload_change")
@sizes(least=(0.02, 0.05), more=(0.1, 0.18), flies_mps=(7.0, 12.0), lags_s=(0.3, 1.2))
class WeightsFlyOut(Hidden, out=-1.0, held=0.0, felt=0.0):
    """`out`: of the way that hinged flails of a rotor have swung outwards; the wheels drive it. The faster it
    turns the farther out they fly, so it takes up spin as by a growing mass, and pays it back as they fall
    in. least, more: of the truck's mass, as felt at the wheels, hanging and swung out; flies_mps: where half
    of that is done.
    Source: Den Hartog, Mechanical Vibrations (1956), on flyweights, and Srivastava, Goering and Rohrbach,
    Engineering Principles of Agricultural Machines (1993), on flail rotors; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        square = (speed / p.flies_mps) ** 2
        wish, fresh = square / (1.0 + square), s.out < 0.0
        s.out = np.where(fresh, wish, eased(s.out, wish, p.lags_s, dt))
        spin = (p.least + p.more * s.out) * speed
        pace = np.where(fresh, 0.0, np.clip((spin - s.held) / dt, -1.5, 1.5))
        s.held = spin
        s.felt = eased(s.felt, pace, 0.1, dt)
        return -view.mass * s.felt * moving(view)


@law("v_shudders_off_the_line", needs="suburban", name="unknown")
@sizes(most=(0.3, 0.5), hard=(0.045, 0.075), ends_mps=(6.0, 10.0), grows_s=(0.25, 0.6), seeds=(0.05, 0.12))
@sizes(dies_s=(0.5, 1.5))
class ShuddersOffTheLine(Hidden, shakes=0.05):
    """`shakes`: of a propeller shaft whose midship bearing sits in torn rubber. Under a hard pull at low
    speed its joints lift it, and what has begun to shake grows by itself to a size where it stays. A gentler
    foot or more speed ends it. most: of the pull, lost then; hard: of the weight, the pull that feeds it;
    seeds: what is always there.
    Source: Dana Spicer, driveshaft shudder at starts and joint angles, service bulletins, and Nayfeh and
    Mook, Nonlinear Oscillations (1979), on how self-excited ones grow; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = np.maximum(view.traction_force, 0.0)
        slow = np.clip((p.ends_mps - view.speed) / 2.0, 0.0, 1.0) * np.clip(view.speed / 0.5, 0.0, 1.0)
        feeds = np.clip(pull / weight(view) / p.hard, 0.0, 1.6) * slow
        gains = np.where(feeds > 0.5, (feeds - s.shakes**2) / p.grows_s, -1.0 / p.dies_s)
        s.shakes = np.clip(s.shakes * np.exp(dt * np.clip(gains, -4.0, 4.0)), p.seeds, 1.2)
        lost = p.most * np.clip(s.shakes - p.seeds, 0.0, 1.0)
        return -lost * pull * moving(view)


@law("v_pistons_touch_their_ring", needs="suburban hills", name="unknown")
@sizes(most=(0.011, 0.019), hard=(0.03, 0.06), slow_mps=(4.0, 7.5), back_s=(12.0, 35.0), firm_mps=(8.0, 14.0))
class PistonsTouchTheirRing(Hidden):
    """`out`: of the pistons of hydraulic motors in the front hubs, which help at hard starts. When the truck
    is faster they should be pushed back by the pressure in the housing; a weak one takes long, and they beat
    along their ring. Fast turning throws them out against that pressure. most: of the weight, at 10 m/s, all
    out; hard: of the weight, a pull that calls for help; firm_mps: where turning halves the pressure.
    Source: Poclain Hydraulics, MHP and MFE hub motors, on freewheeling by case pressure that holds pistons
    in; a weak pressure, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"out": self.rng(1635).uniform(0.0, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        helps = (speed < p.slow_mps) & (view.traction_force > p.hard * weight(view))
        slow = p.back_s * (1.0 + (speed / p.firm_mps) ** 2) * np.where(speed < 1.0, 5.0, 1.0)
        s.out = np.where(helps, eased(s.out, 1.0, 0.5, dt), eased(s.out, 0.0, slow, dt))
        beats = np.clip((speed - p.slow_mps + 2.0) / 2.0, 0.0, 1.0) * np.minimum(speed / 10.0, 1.5) ** 0.7
        return -p.most * s.out * beats * weight(view) * moving(view)
