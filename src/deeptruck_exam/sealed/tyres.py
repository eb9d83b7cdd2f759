"""Axles that shimmy, tyres with flat spots, ice that melts under sliding treads."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.places import CELLS, OnRoad, stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("t_axle_shimmies", needs="highway", name="rolling_resistance_speed", accepts="drag_area")
@sizes(drags=(0.008, 0.018), from_mps=(15.5, 19.5), gathers_s=(0.6, 2.0), limits=(0.25, 0.5))
class AxleShimmies(Hidden, shake=0.1):
    """`shake`: square of its amplitude. Below a speed it dies away, above it grows until slip angles limit
    it. drags: of the weight, at 1; limits: share of speed above the first at which it is 1.
    Source: Pacejka, Tire and Vehicle Dynamics (2012), ch. 6, on wheel shimmy, a Hopf bifurcation over speed:
    sliding aside drags with the square of the angle; a self-steering axle, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        beyond = np.clip(view.speed / p.from_mps - 1.0, -0.6, 0.8) / p.limits
        grows = s.shake * (beyond - s.shake) / p.gathers_s
        s.shake = np.clip(s.shake + dt * grows, 0.03, 1.6)
        return -p.drags * (s.shake - 0.03) * weight(view) * moving(view)


@law("t_flat_spots_round_off", name="rolling_resistance_warmup")
@sizes(drags=(0.006, 0.014), glass=(0.35, 0.65), warms_s=(50.0, 140.0), rounds_s=(20.0, 70.0))
class FlatSpotsRoundOff(Hidden, warm=0.0):
    """`flat`: what standing overnight has left in the cords, other in each drive. It stays until the tyre is
    warm and then goes quickly. drags: of the weight, fully flat; glass: warmth at which cords give.
    Source: The Pneumatic Tire, ed. Gent and Walter, NHTSA DOT HS 810 561 (2006), on flat-spotting of nylon
    cords, which set below their glass transition and recover above; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(991)
        return {"flat": rng.uniform(0.35, 1.0, batch), "warm": rng.uniform(0.0, 0.25, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        goal = np.clip(np.maximum(view.speed, 0.0) / 18.0, 0.0, 1.5) ** 0.7
        s.warm = s.warm + dt * (goal - s.warm) / p.warms_s
        gives = 0.06 + 1.0 / (1.0 + np.exp(-(s.warm - p.glass) / 0.06))
        s.flat = np.clip(s.flat - dt * (view.speed > 0.3) * s.flat * gives / p.rounds_s, 0.0, 1.0)
        return -p.drags * s.flat * weight(view) * moving(view)


@law("t_ice_melts_under_it", needs="suburban hills", name="wheel_slip")
@sizes(grip=(0.13, 0.19), falls=(0.35, 0.65), rears=(0.25, 0.6), inertia=(0.05, 0.12))
class IceMeltsUnderIt(OnRoad, slides=0.0, lost=0.0):
    """`slides` m/s of the driven treads over the road, in the shade. Once they slide they melt the ice and
    hold less, down to `falls`. rears: height of the centre over the wheelbase, which loads the driven axle
    uphill.
    Source: Evans, Nye and Cheeseman, The Kinetic Friction of Ice, Proc. R. Soc. A 347 (1976): friction falls
    with the root of the sliding speed; places in the shade and sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(992)
        self.ice = np.zeros((self.rows(), CELLS))
        for row in self.ice:
            for first, last in stretches(rng, (60.0, 240.0), (50.0, 200.0)):
                row[first:last] = 1.0

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        ice = self.read(self.ice, view)
        tilt = view.grade + np.clip(view.acceleration, -3.0, 3.0) / GRAVITY
        load = (self.truck.drive_axle_share + p.rears * tilt) * weight(view)
        melts = np.clip(np.sqrt(0.15 / np.maximum(s.slides, 0.15)), p.falls, 1.0)
        grip = (p.grip * melts + 0.6 * (1.0 - ice)) * load
        pull = np.maximum(view.traction_force, 0.0)
        turning = np.clip((pull - grip) / (p.inertia * view.mass), -15.0, 15.0)
        s.slides = np.clip(s.slides + dt * turning, 0.0, 6.0)
        s.lost = s.lost + dt * (np.maximum(pull - grip, 0.0) - s.lost) / 0.15
        held = np.maximum(view.brake_force - (1.1 * p.grip + 0.6 * (1.0 - ice)) * weight(view), 0.0)
        return held * moving(view) - np.minimum(s.lost, pull)
