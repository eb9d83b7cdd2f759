"""Patches that carry the friction, help from a steering pump, a pendulum, and a valve that reads the nod."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("z_patches_carry_it", needs="suburban descent", name="brake_fade", accepts="brake_gain")
@sizes(share=(0.22, 0.36), grows_jpkg=(50.0, 140.0), warm_jpkg=(60.0, 150.0), cools_s=(25.0, 80.0))
@sizes(breaks=(1.2, 2.2), rests_s=(60.0, 200.0))
class PatchesCarryIt(Hidden):
    """`patch`: of the hard patches on the pads that carry the friction. Gentle heat builds them from dust of
    wear, great heat breaks them faster than they grow, and standing cold they crumble slowly. So a brake that
    has worked hard holds little, until some braking at lower heat has built patches anew. share: of the brake
    force, without patches; breaks: how much faster they break in heat than they grow.
    Source: Ostermeyer, On the Dynamics of the Friction Coefficient, Wear 254 (2003): patches grow and break
    with heat and wear, and friction is their balance; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(1711)
        return {"patch": rng.uniform(0.3, 0.9, batch), "hot": rng.uniform(0.0, 0.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        work = view.brake_force * np.maximum(view.speed, 0.0) / view.mass
        s.hot = np.clip(s.hot + dt * (work / p.warm_jpkg - s.hot / p.cools_s), 0.0, 2.5)
        grows = work / p.grows_jpkg * (1.0 - s.patch)
        breaks = p.breaks * work / p.grows_jpkg * s.hot**2 * s.patch + s.patch / p.rests_s
        s.patch = np.clip(s.patch + dt * (grows - breaks), 0.0, 1.0)
        return p.share * (1.0 - s.patch) * view.brake_force * moving(view)


@law(
    "z_helped_by_the_steering_pump",
    needs="suburban hills descent",
    name="brake_lag",
    accepts="command_delay clock_offset",
)
@sizes(share=(0.75, 0.95), per_s=(0.12, 0.25), at_rads=(120.0, 160.0), kept=(0.05, 0.15), fills_s=(6.0, 20.0))
@sizes(drains_s=(0.2, 0.5))
class HelpedByTheSteeringPump(Hidden, held=0.0, store=1.0):
    """`held`: of full braking, by a booster that the pump of the steering feeds. Its flow grows with the
    engine's speed, so that brakes come slowly at idle and soon at high revs. `store`, a small one, fills the
    first press at once, and is filled again while nobody brakes. share: of the brake force, boosted; per_s:
    of full braking, at at_rads; kept: of full braking, in a full store.
    Source: Bosch, Hydro-Boost service manual, on boosters fed by the power steering pump with a store for
    some stops, and Limpert, Brake Design and Safety; a worn pump, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        flow = p.per_s * np.clip(view.engine_speed / p.at_rads, 0.3, 1.5) ** 1.5
        wants = np.maximum(asked - s.held, 0.0)
        quick = np.minimum(np.minimum(s.store * p.kept / 0.25, wants / 0.1), 0.6)
        fills = np.minimum(flow, wants / 0.1)
        falls = eased(s.held, asked, p.drains_s, dt)
        s.held = np.where(wants > 0.0, np.minimum(s.held + dt * (fills + quick), asked), falls)
        gains = np.where(asked < 0.004, (1.0 - s.store) / p.fills_s, 0.0)
        s.store = np.clip(s.store + dt * (gains - quick / p.kept), 0.0, 1.0)
        return p.share * (asked - s.held) * self.truck.brake_capacity * moving(view)


@law("z_pendulum_brakes_the_trailer", needs="suburban hills", name="dragging_brake")
@sizes(most=(0.012, 0.02), least=(0.001, 0.003), tips=(0.012, 0.03), full=(0.05, 0.1), swings_rads=(1.5, 3.5))
@sizes(dull=(0.15, 0.4))
class PendulumBrakesTheTrailer(Hidden, angle=0.0, pace=0.0):
    """`angle` of a pendulum in a box that brakes a trailer by magnets. It should hang still until the driver
    brakes. Worn, it tips forwards as soon as the truck loses speed by itself or the road goes down, swings
    after each change, and never lets go wholly. most, least: of the weight, full and always; tips, full: g
    of slowing or slope, where it begins and where it brakes wholly.
    Source: Tekonsha and Hayes, electric brake controllers with pendulums, installation guides on levelling
    them, and Limpert, Brake Design and Safety; a worn one, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        leans = -(view.acceleration / GRAVITY + view.grade)
        push = p.swings_rads**2 * (np.clip(leans, -0.3, 0.3) - s.angle)
        s.pace = s.pace + dt * (push - 2.0 * p.dull * p.swings_rads * s.pace)
        s.angle = np.clip(s.angle + dt * s.pace, -0.3, 0.3)
        opens = np.clip((s.angle - p.tips) / (p.full - p.tips), 0.0, 1.0)
        return -(p.least + (p.most - p.least) * opens**1.3) * weight(view) * moving(view)


@law("z_valve_reads_the_nod", needs="suburban descent", name="unknown")
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
