"""Gas under pads, a caliper that slides late, and a shoe whose spring is broken; a trailer's valve that opens
late, and brakes that have to be pumped."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("j_gas_under_the_pads", needs="suburban descent", name="brake_fade", accepts="brake_gain")
@sizes(most=(0.55, 0.75), warm_jpkg=(35.0, 80.0), skin_s=(4.0, 9.0), body_s=(60.0, 150.0), at=(0.3, 0.5))
@sizes(gas_s=(2.5, 7.0), slots=(0.4, 0.8))
class GasUnderThePads(Hidden, skin=0.0, gas=0.0):
    """`skin` of the pads is heated by braking and gives off gas where it is hotter than their `body` by
    enough. The gas lifts them off the disc until it has found its way out, through slots the faster the disc
    turns. So a hard braking fades within itself, and a long gentle one does not. most: of the brake force;
    at: of the difference, where gas begins; slots: of the outflow, that is by turning.
    Source: Breuer and Bill, Brake Technology Handbook (SAE, 2008), on gas between lining and disc and why
    discs are slotted; resinous pads, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "body": self.rng(2211).uniform(0.0, 0.5, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        work = view.brake_force * np.maximum(view.speed, 0.0) / view.mass / p.warm_jpkg
        over = s.skin - s.body
        s.skin = np.clip(s.skin + dt * (work - over / p.skin_s), 0.0, 3.0)
        s.body = np.clip(s.body + dt * (0.12 * over / p.skin_s - s.body / p.body_s), 0.0, 2.0)
        makes = np.maximum(over - p.at, 0.0) / p.at
        out = (1.0 - p.slots) + p.slots * np.clip(view.speed / 12.0, 0.0, 1.5)
        s.gas = np.clip(s.gas + dt * (makes - out * s.gas) / p.gas_s, 0.0, 4.0)
        return p.most * s.gas / (0.35 + s.gas) * view.brake_force * moving(view)


@law(
    "j_caliper_slides_late",
    needs="suburban hills descent",
    name="brake_lag",
    accepts="command_delay clock_offset",
)
@sizes(outer=(0.42, 0.5), sticks=(0.02, 0.045), slides=(0.02, 0.045), springs=(0.3, 0.6), shakes=(0.3, 0.7))
class CaliperSlidesLate(Hidden, held=0.0):
    """The pad beside the piston bites at once; that on the other side only as far as the caliper has slid on
    its dry pins, which stick to a force and then let it creep. When the pedal is let go it creeps back as
    slowly, so that the outer pad lets go late too. `held`: what the outer pad presses, of full braking.
    outer: of the brake force; sticks: of full braking; slides: of that each second, for each such step
    beyond; springs: pace back; shakes: of the sticking, that a fast road takes off.
    Source: Breuer and Bill, Brake Technology Handbook (SAE, 2008), on floating calipers and their pins; dry
    pins, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        sticks = p.sticks * (1.0 - p.shakes * np.clip(view.speed / 22.0, 0.0, 1.0))
        differs = asked - s.held
        beyond = differs - np.clip(differs, -sticks * p.springs, sticks)
        s.held = np.clip(s.held + dt * p.slides * beyond / p.sticks, 0.0, 1.2)
        ahead = np.maximum(asked - s.held, -2.0 * p.sticks)
        return p.outer * ahead * self.truck.brake_capacity * np.clip(view.speed / 2.0, 0.0, 1.0)


@law("j_spring_of_a_shoe_is_broken", needs="suburban hills descent", name="dragging_brake")
@sizes(most=(0.011, 0.019), lies=(0.0, 0.015), wide=(0.015, 0.04), swings_s=(0.4, 1.2), grows=(0.5, 1.2))
@sizes(warms_s=(20.0, 60.0))
class SpringOfAShoeIsBroken(Hidden, lean=0.0, hot=0.0):
    """The spring that draws a shoe back is broken. Its own weight lays it on the drum wherever the truck goes
    down or slows, and off it wherever it climbs or gathers speed. A shoe that lies there draws itself in the
    more, the warmer it is. `lean`: what it feels, over gravity. most: of the weight, cold; lies: forwards,
    where it begins; wide: from there until it lies wholly; grows: of that, hot.
    Source: Limpert, Brake Design and Safety (1999), on leading shoes and their springs; one broken spring on
    each axle, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration / GRAVITY + view.grade, -0.3, 0.3)
        s.lean = eased(s.lean, felt, p.swings_s, dt)
        rests = np.clip((p.lies - s.lean) / p.wide, 0.0, 1.0)
        touches = rests * (1.0 + p.grows * s.hot) * (view.brake_force < 0.01 * self.truck.brake_capacity)
        s.hot = eased(s.hot, rests * np.clip(view.speed / 15.0, 0.0, 1.2), p.warms_s, dt)
        return -p.most * touches * weight(view) * moving(view)


@law("j_trailers_valve_opens_late", needs="suburban hills descent", name="unknown")
@sizes(share=(0.5, 0.68), opens=(0.06, 0.11), shuts=(0.3, 0.6), bites_s=(0.15, 0.4))
class TrailersValveOpensLate(Hidden, open=0.0):
    """A valve of the trailer sticks to its seat: light brakings are done by the tractor alone. Only a firmer
    one tears it open, and then all is as it should be until the pedal has nearly been let go. share: of the
    brake force, the trailer's; opens: of full braking; shuts: of that.
    Source: UN ECE Regulation 13, annex 10, on the compatibility of tractor and trailer and the pressure at
    which brakes begin, and makers' notes on relay emergency valves; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        wish = np.where(asked > p.opens, 1.0, np.where(asked < p.shuts * p.opens, 0.0, np.rint(s.open)))
        s.open = eased(s.open, wish, p.bites_s, dt)
        return p.share * (1.0 - s.open) * view.brake_force * moving(view)


@law("j_has_to_be_pumped", needs="suburban hills descent", name="unknown")
@sizes(lost=(0.5, 0.7), steps=(0.25, 0.4), forgets_s=(8.0, 20.0), on=(0.02, 0.05))
class HasToBePumped(Hidden, ready=0.3, on=0.0):
    """The shoes stand far from their drums, so that a pressing of the pedal is spent on their way. Pressed
    again shortly after, the pedal finds them nearer: each pressing adds a part, and all is lost again as the
    shoes go back. `ready`: 1 where nothing is lost. lost: of the brake force, with shoes that are far; steps:
    of what is missing, by one more pressing; on: of full braking, that counts as one.
    Source: Limpert, Brake Design and Safety (1999), on pedal travel and worn adjusters of hydraulic brakes;
    sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        now = np.where(asked > p.on, 1.0, np.where(asked < 0.3 * p.on, 0.0, s.on))
        pressed = (now > 0.5) & (s.on < 0.5)
        s.on = now
        s.ready = np.where(pressed, s.ready + p.steps * (1.0 - s.ready), s.ready)
        s.ready = eased(s.ready, 0.0, np.where(s.on > 0.5, 4.0 * p.forgets_s, p.forgets_s), dt)
        return p.lost * (1.0 - s.ready) * view.brake_force * moving(view)
