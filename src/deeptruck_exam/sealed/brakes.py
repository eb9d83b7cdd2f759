"""Tar on linings, a retarder that goes first, and drums that shrink on their shoes; another foot valve."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("u_tar_comes_to_the_face", needs="suburban descent", name="brake_fade", accepts="brake_gain")
@sizes(most=(0.5, 0.72), warm_jpkg=(45.0, 110.0), cools_s=(30.0, 80.0), at=(0.3, 0.55), makes_s=(4.0, 12.0))
@sizes(rubs_jpkg=(70.0, 180.0))
class TarComesToTheFace(Hidden):
    """`heat` of linings whose resin was cooked too little. Hot, they sweat `tar`, which lies on their face
    and stays there when they are cold again: only the work of further, cooler brakings rubs it off. most: of
    the brake force, lost to a full coat; at: heat where it begins; rubs_jpkg: work that takes two thirds off.
    Source: Breuer and Bill, Brake Technology Handbook (SAE, 2008), on resins that decompose and how a lining
    recovers from fade; poor linings, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(2111)
        return {"heat": rng.uniform(0.1, 0.8, batch), "tar": rng.uniform(0.0, 0.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        work = view.brake_force * np.maximum(view.speed, 0.0) / view.mass
        airs = 0.4 + 0.6 * np.clip(view.speed / 20.0, 0.0, 1.4)
        s.heat = np.clip(s.heat + dt * (work / p.warm_jpkg - airs * s.heat / p.cools_s), 0.0, 1.6)
        sweats = np.maximum(s.heat - p.at, 0.0) * (1.0 - s.tar) / (0.4 * p.makes_s)
        cool = np.clip((p.at - s.heat) / (0.5 * p.at), 0.0, 1.0)
        s.tar = np.clip(s.tar + dt * (sweats - cool * work * s.tar / p.rubs_jpkg), 0.0, 1.0)
        return p.most * s.tar * view.brake_force * moving(view)


@law(
    "u_retarder_goes_first",
    needs="suburban hills descent",
    name="brake_lag",
    accepts="command_delay clock_offset",
)
@sizes(takes=(0.08, 0.14), fills_s=(0.9, 1.8), empties_s=(0.5, 1.2), slow_mps=(5.0, 8.0), hurries=(0.3, 0.6))
class RetarderGoesFirst(Hidden, oil=0.0):
    """A gentle braking is done by a retarder alone, whose oil has to come first; what is asked beyond it is
    done by the linings at once. So light brakings come late and hard ones nearly in time. `oil`: braking that
    is there, of full. takes: of full braking, at most by the retarder; slow_mps: below that speed its share
    goes to the linings; hurries: of the time, saved by a store of air when it was filled shortly before.
    Source: makers' manuals on electronic brakes that blend retarder and linings, and Breuer and Bill, Brake
    Technology Handbook (SAE, 2008); a slow retarder, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "warm": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        can = p.takes * np.clip(view.speed / p.slow_mps, 0.0, 1.0)
        gentle = np.minimum(asked, can)
        s.warm = eased(s.warm, np.clip(gentle / p.takes, 0.0, 1.0), 8.0, dt)
        fills = p.fills_s * (1.0 - p.hurries * s.warm)
        s.oil = eased(s.oil, gentle, np.where(gentle > s.oil, fills, p.empties_s), dt)
        return (gentle - s.oil) * self.truck.brake_capacity * moving(view)


@law("u_drums_shrink_on_their_shoes", needs="suburban hills descent", name="dragging_brake")
@sizes(
    most=(0.012, 0.02), warm_jpkg=(60.0, 140.0), drum_s=(12.0, 30.0), shoe_s=(60.0, 150.0), room=(0.06, 0.16)
)
@sizes(tight=(0.15, 0.3))
class DrumsShrinkOnTheirShoes(Hidden):
    """`drum`, `shoe`: their heat over the air's. Braking warms both; then the wind cools the drum long before
    its shoes, so that it shrinks on them and drags, some time after a braking and most at speed. room: of the
    clearance, as the difference of heat that closes it; tight: beyond it, for all the drag. most: of the
    weight.
    Source: Limpert, Brake Design and Safety (1999), on drums and shoes that grow with heat, and Newcomb and
    Spurr, Braking of Road Vehicles (1967), on their cooling; narrow adjustment, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        shoe = self.rng(2112).uniform(0.1, 0.8, batch)
        return {"shoe": shoe, "drum": 0.6 * shoe}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        work = view.brake_force * np.maximum(view.speed, 0.0) / view.mass / p.warm_jpkg
        wind = 0.25 + 0.75 * np.clip(view.speed / 20.0, 0.0, 1.4)
        s.drum = np.clip(s.drum + dt * (work - wind * s.drum / p.drum_s), 0.0, 2.0)
        s.shoe = np.clip(s.shoe + dt * (0.8 * work - s.shoe / p.shoe_s), 0.0, 2.0)
        grips = np.clip((s.shoe - s.drum - p.room) / p.tight, 0.0, 1.0)
        off = 1.0 - np.clip(view.brake_force / (0.02 * self.truck.brake_capacity), 0.0, 1.0)
        return -p.most * grips**1.5 * off * weight(view) * moving(view)


@law("u_another_foot_valve", needs="suburban hills descent", name="unknown")
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
