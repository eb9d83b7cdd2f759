"""Metal that melts in the linings, shoes that are carried round, seals that slip, and a servo without a
store."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("b_metal_melts_in_the_linings", needs="suburban descent", name="brake_fade", accepts="brake_gain")
@sizes(most=(0.5, 0.72), warm_jpkg=(45.0, 110.0), cools_s=(35.0, 90.0), melts=(0.45, 0.7), latent=(0.25, 0.5))
class MetalMeltsInTheLinings(Hidden):
    """`heat` that is stored in linings with a soft metal in them. Once they are at its melting point they get
    no hotter until all of it is molten, and no cooler until all of it is solid again; what is molten
    lubricates. most: of the brake force, lost when all is molten; melts: heat where it begins; latent: heat
    that melting takes.
    Source: Crank, Free and Moving Boundary Problems (1984), on stored heat at a melting point, and Breuer and
    Bill, Brake Technology Handbook (SAE, 2008), on metals in linings; soft linings, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"heat": self.rng(2011).uniform(0.1, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        molten = np.clip((s.heat - p.melts) / p.latent, 0.0, 1.0)
        hot = np.minimum(s.heat, p.melts) + np.maximum(s.heat - p.melts - p.latent, 0.0)
        work = view.brake_force * np.maximum(view.speed, 0.0) / view.mass
        s.heat = np.clip(s.heat + dt * (work / p.warm_jpkg - hot / p.cools_s), 0.0, 1.6)
        return p.most * molten * view.brake_force * moving(view)


@law(
    "b_shoes_are_carried_round",
    needs="suburban hills descent",
    name="brake_lag",
    accepts="command_delay clock_offset",
)
@sizes(share=(0.75, 0.95), way_m=(5.0, 10.0), dry=(0.3, 0.7), back_s=(0.5, 1.4), least_s=(0.12, 0.3))
class ShoesAreCarriedRound(Hidden, held=0.0):
    """Shoes float in their drum, and do nothing before it has carried them round to their anchor. That takes
    a way and not a time: fast wheels are braked soon and slow ones late. Firmly pressed shoes are carried
    along better. `held`: of full braking. share: of the brake force; way_m: of the road, softly pressed; dry:
    less of it, firmly pressed; back_s: until springs have drawn them back.
    Source: Limpert, Brake Design and Safety (1999), on duo-servo drums whose shoes shift to an anchor; loose
    shoes, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        way = p.way_m * (1.0 - p.dry * np.tanh(8.0 * asked))
        carried = p.least_s + way / np.maximum(view.speed, 1.0)
        s.held = eased(s.held, asked, np.where(asked > s.held, carried, p.back_s), dt)
        return p.share * (asked - s.held) * self.truck.brake_capacity * moving(view)


@law("b_seals_slip_on_their_pistons", needs="suburban hills descent", name="dragging_brake")
@sizes(most=(0.01, 0.017), gives=(0.025, 0.06), shakes_m=(150.0, 500.0), rough=(0.5, 1.5))
class SealsSlipOnTheirPistons(Hidden):
    """The seal of a piston bends with it and draws it back by that much. Beyond it the piston slips through:
    after a firm braking the pads stay at their disc, and a light one leaves them as they are. Only the way
    shakes them off. `slipped` of full braking, that the seal has let through. most: of the weight; gives: of
    full braking, that the seal can draw back.
    Source: Breuer and Bill, Brake Technology Handbook (SAE, 2008), on roll-back of seals, and Visintin,
    Differential Models of Hysteresis (1994), on play; stiff seals, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"slipped": self.p.gives * self.rng(2012).uniform(0.0, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        s.slipped = np.clip(s.slipped, asked - p.gives, asked + p.gives)
        harsh = 1.0 + p.rough * np.minimum(np.abs(view.acceleration), 2.0)
        off = 1.0 - dt * harsh * np.maximum(view.speed, 0.0) / p.shakes_m
        s.slipped = np.maximum(s.slipped, 0.0) * off
        touches = np.clip((s.slipped - asked) / p.gives, 0.0, 1.0)
        return -p.most * np.sqrt(touches + 1e-9) * weight(view) * moving(view)


@law("b_servo_has_no_store", needs="suburban hills descent", name="unknown")
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
