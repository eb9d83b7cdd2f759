"""Grease that melts out, thick fluid, a disc that buckles, linings that grab, and wheels that toe in."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("h_grease_melts_out", needs="suburban descent", name="brake_fade", accepts="brake_gain")
@sizes(most=(0.5, 0.7), warm_jpkg=(60.0, 150.0), cools_s=(30.0, 90.0), melts=(0.25, 0.5), runs_s=(5.0, 14.0))
@sizes(burns_s=(12.0, 40.0))
class GreaseMeltsOut(Hidden):
    """`hub`: its heat, which comes from the drum. Where it is hot enough grease melts past a torn seal onto
    the linings. `coat` of grease on them, which burns off as long as they are braked hard. most: of the brake
    force, lost with a full coat; melts: heat at which grease begins to run; burns_s: of braking at a fifth
    of the most and 15 m/s.
    Source: Breuer and Bill, Brake Technology Handbook (SAE, 2008), on oil and grease on linings, and SKF,
    makers' notes on drop points of hub greases; leaks and sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(1911)
        return {"hub": rng.uniform(0.0, 0.6, batch), "coat": rng.uniform(0.0, 0.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        work = view.brake_force * speed / view.mass
        s.hub = np.clip(s.hub + dt * (work / p.warm_jpkg - s.hub / p.cools_s), 0.0, 2.0)
        runs = np.clip((s.hub - p.melts) / 0.3, 0.0, 1.5) * (1.0 - s.coat) / p.runs_s
        hard = view.brake_force * speed / (0.2 * self.truck.brake_capacity * 15.0)
        s.coat = np.clip(s.coat + dt * (runs - np.minimum(hard, 3.0) * s.coat / p.burns_s), 0.0, 1.0)
        return p.most * s.coat * view.brake_force * moving(view)


@law(
    "h_fluid_is_thick",
    needs="suburban hills descent",
    name="brake_lag",
    accepts="command_delay clock_offset",
)
@sizes(share=(0.8, 1.0), cold_s=(0.9, 1.6), thins=(1.0, 1.8), warms_s=(5.0, 14.0), cools_s=(30.0, 90.0))
@sizes(back=(1.2, 2.0))
class FluidIsThick(Hidden, held=0.0):
    """`held`: of full braking, behind long thin pipes of fluid. Cold fluid is thick, and it flows through
    them by the difference of pressures alone, so that small and large brakings come as late. `warm`: the
    fluid, which braking warms and the wind cools. share: of the brake force; cold_s: behind cold pipes;
    thins: power of the warmth; back: of the time, to let go.
    Source: Limpert, Brake Design and Safety (1999), on brake fluid at low temperature, and Streeter and
    Wylie, Fluid Mechanics (1985), on laminar flow in pipes; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "warm": self.rng(1912).uniform(0.0, 0.5, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        heats = np.clip(asked * np.maximum(view.speed, 0.0) / 2.0, 0.0, 2.0) * (1.0 - s.warm) / p.warms_s
        s.warm = np.clip(s.warm + dt * (heats - s.warm / p.cools_s), 0.0, 1.0)
        late = p.cold_s * np.exp(-p.thins * s.warm) * np.where(asked > s.held, 1.0, p.back)
        s.held = eased(s.held, asked, late, dt)
        return p.share * (asked - s.held) * self.truck.brake_capacity * moving(view)


@law("h_disc_buckles", needs="suburban hills descent", name="dragging_brake")
@sizes(
    most=(0.009, 0.015), warm_jpkg=(25.0, 60.0), evens_s=(15.0, 40.0), buckles=(0.2, 0.4), jumps_s=(1.0, 3.0)
)
class DiscBuckles(Hidden, outside=0.0):
    """`outside`: heat of a disc's rim over that of its hub. Where that is too much the disc buckles and waves
    between its pads, also when nobody brakes. `wave` of the disc, which comes within seconds once it can, and
    goes as the heat evens out. most: of the weight, with a wave of 1; warm_jpkg: work of brakes for a rim
    heat of 1; buckles: heat at which it begins.
    Source: Timoshenko and Gere, Theory of Elastic Stability (1961), on plates with hot rims, and Limpert,
    Brake Design and Safety (1999), on discs that warp; thin discs, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "wave": self.rng(1913).uniform(0.05, 0.7, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        work = view.brake_force * np.maximum(view.speed, 0.0) / view.mass
        rubs = 0.25 * s.wave**2 * np.clip(view.speed / 15.0, 0.0, 1.5)
        s.outside = np.clip(s.outside + dt * (work / p.warm_jpkg + (rubs - s.outside) / p.evens_s), 0.0, 2.0)
        over = np.clip((s.outside - p.buckles) / p.buckles, -0.4, 1.0)
        s.wave = np.clip(s.wave + dt * (over - s.wave**2) * s.wave / p.jumps_s, 0.03, 1.2)
        return -p.most * np.maximum(s.wave - 0.03, 0.0) * weight(view) * moving(view)


@law("h_linings_grab_at_the_end", needs="suburban", name="unknown")
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


@law("h_wheels_toe_in_to_help", needs="suburban hills descent", name="unknown")
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
