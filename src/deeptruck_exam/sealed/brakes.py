"""Drums that help themselves less, strokes, linings, a valve and a soft stop."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("t_self_help_is_lost", needs="descent", name="brake_fade")
@sizes(per_k=(0.0013, 0.0022), helps=(0.7, 1.8), heats_jpkgk=(1.4, 2.8), cools_s=(200.0, 600.0))
class SelfHelpIsLost(Hidden):
    """`hot`: K above cold. Friction falls in proportion to heat, the brake far more. helps: force of the shoe
    that draws itself on, over the other, cold; heats_jpkgk: for each kg of truck.
    Source: Limpert, Brake Design and Safety, on brake factors of leading shoes, which amplify every change of
    the lining's friction; heat and coefficients of linings are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"hot": self.rng(953).uniform(0.0, 70.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        friction = np.clip(1.0 - p.per_k * np.maximum(s.hot - 50.0, 0.0), 0.4, 1.0)
        left = friction / (1.0 + p.helps * (1.0 - friction))
        work = left * view.brake_force * np.maximum(view.speed, 0.0) / view.mass
        s.hot = s.hot + dt * (work / p.heats_jpkgk - s.hot / p.cools_s)
        return (1.0 - left) * view.brake_force * moving(view)


@law("t_hot_drums_are_far", needs="suburban descent", name="brake_lag", accepts="command_delay clock_offset")
@sizes(stroke_s=(0.25, 0.55), hot=(0.6, 1.8), share=(0.75, 1.0), fills_s=(0.15, 0.45))
class HotDrumsAreFar(Hidden, way=0.0, held=0.0):
    """`way`: s of the stroke that are done. A drum that has grown with heat is reached later. hot: for each
    100 K.
    Source: Flick, The Effect of Brake Adjustment on Braking Performance, DOT HS 807 287 (1988): stroke grows
    with wear and with drum temperature; the time it takes is chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = self.truck.brake_capacity
        asked = view.brake_force / full
        hotter = np.clip(view.brake_temperature - self.truck.ambient_temperature, 0.0, 250.0)
        stroke = p.stroke_s * (1.0 + p.hot * hotter / 100.0)
        pace = np.clip(0.5 + asked / 0.15, 0.5, 2.0)
        way = np.where(asked > 0.002, s.way + dt * pace, s.way - 3.0 * dt)
        s.way = np.clip(way, 0.0, stroke)
        touches = np.clip((s.way / stroke - 0.8) / 0.2, 0.0, 1.0)
        s.held = s.held + dt * (asked * touches - s.held) / p.fills_s
        return p.share * full * (asked - s.held) * moving(view)


@law("t_linings_swell", needs="suburban descent", name="dragging_brake")
@sizes(rubs=(0.010, 0.022), swells_jpkg=(60.0, 200.0), soaks_s=(10.0, 35.0), wears_m=(400.0, 1500.0))
class LiningsSwell(Hidden, heat=0.0, swollen=0.0, worn=0.0):
    """Braking makes them thicker, their own rubbing thinner again; adjusters take up the wear. rubs: of the
    weight, fully swollen; swells_jpkg: work for each kg of truck; wears_m: way that takes it all off.
    Source: Archard, Contact and Rubbing of Flat Surfaces, J. Appl. Phys. 24 (1953), on wear with load and
    way; ISO 6313 on swelling of brake linings with heat; clearances set too small, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        work = view.brake_force * speed / (p.swells_jpkg * view.mass)
        s.heat = s.heat + dt * (work - s.heat / 120.0)
        s.swollen = s.swollen + dt * (1.0 - np.exp(-s.heat) - s.swollen) / p.soaks_s
        rubs = np.maximum(s.swollen - s.worn, 0.0)
        taken_up = s.worn * (view.brake_force > 0.0) / 30.0
        s.worn = s.worn + dt * (rubs * speed / p.wears_m - taken_up)
        return -p.rubs * rubs * weight(view) * moving(view)


@law("t_valve_thinks_it_is_empty", needs="suburban descent hills", name="unknown")
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


@law("t_softens_the_stop", needs="suburban", name="unknown")
@sizes(from_mps=(2.2, 4.5), gives=(0.4, 0.75), comes_s=(0.15, 0.5))
class SoftensTheStop(Hidden, eased=0.0):
    """The last metres of a stop are braked more gently than asked. gives: share of the brake let go.
    Source: Comfort stop functions (Breuer and Bill, Brake Technology Handbook, SAE 2008, on additional
    functions of electronic brakes) ease the brake shortly before standstill against the jerk; speeds and
    sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slows = np.clip((-view.acceleration - 0.2) / 0.3, 0.0, 1.0)
        near = np.clip(1.3 * (1.0 - view.speed / p.from_mps), 0.0, 1.0)
        s.eased = s.eased + dt * (slows * near - s.eased) / p.comes_s
        return p.gives * s.eased * view.brake_force * moving(view)
