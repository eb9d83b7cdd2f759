"""Mortar that is poured on the creep, a hook that is let down, water between two cushions, and a glider in
tow."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("b_pours_while_it_creeps", needs="suburban hills", name="payload_change", accepts="mass")
@sizes(most=(0.34, 0.5), pours_s=(14.0, 40.0), below_mps=(8.0, 12.0), fills_s=(5.0, 14.0))
class PoursWhileItCreeps(Hidden, filling=0.0):
    """`gone`: of a load that is poured out beside the road, whenever the truck is slow enough for the chute,
    and faster the slower it is. A machine behind fills it again from its own store when nearly
    nothing is left, until it is full. most: of the mass, that can be poured; below_mps: where pouring begins.
    Source: ACI 304R, Guide for Measuring, Mixing, Transporting, and Placing Concrete, on discharge from
    moving trucks; the quick filling and sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "gone": self.rng(2051).uniform(0.0, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slow = np.clip(1.0 - np.maximum(view.speed, 0.0) / p.below_mps, 0.0, 1.0)
        s.filling = np.where(s.gone > 0.97, 1.0, np.where(s.gone < 0.02, 0.0, s.filling))
        pours = slow * (1.0 - s.gone + 0.05) / p.pours_s
        s.gone = np.clip(s.gone + dt * np.where(s.filling > 0.5, -1.0 / p.fills_s, pours), 0.0, 1.0)
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return p.most * s.gone * view.mass * np.clip(felt, -4.0, 4.0) * moving(view)


@law("b_hook_is_let_down", needs="suburban", name="load_slosh")
@sizes(share=(0.25, 0.4), short_m=(0.8, 1.6), long_m=(4.5, 8.0), works_s=(8.0, 25.0), pace_mps=(0.3, 0.8))
@sizes(dull=(0.02, 0.06))
class HookIsLetDown(Hidden, lean=0.0, rate=0.0):
    """A load hangs from a crane on the truck, whose hook is let down and drawn up in spells. `rope` m: its
    swing is quick while it is short and slow while it is long, and grows as the rope is drawn in. `lean` rad
    ahead, `rate` of that. share: of the mass; pace_mps: of the hook.
    Source: Abdel-Rahman, Nayfeh and Masoud, Dynamics and Control of Cranes: A Review, J. Vibration and
    Control 9 (2003), on pendulums whose length changes; driving with it and sizes are chosen here."""

    def prepare(self) -> None:
        on, off = (0.5 * self.p.works_s, 1.5 * self.p.works_s), (0.5 * self.p.works_s, 1.5 * self.p.works_s)
        self.down = spells(self.rng(2052), self.setting.batch, on, off)

    def start(self, batch: int) -> dict[str, Array]:
        rope = self.rng(2053).uniform(self.p.short_m, self.p.long_m, batch)
        return {**super().start(batch), "rope": rope, "winds": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wish = np.where(within(self.down, view.time) > 0.5, p.long_m, p.short_m)
        s.winds = eased(s.winds, np.clip(wish - s.rope, -1.0, 1.0) * p.pace_mps, 0.5, dt)
        s.rope = np.clip(s.rope + dt * s.winds, 0.9 * p.short_m, 1.1 * p.long_m)
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -3.0, 3.0)
        own = np.sqrt(GRAVITY / s.rope)
        turns = -(GRAVITY * np.sin(s.lean) + felt * np.cos(s.lean) + 2.0 * s.winds * s.rate) / s.rope
        turns = turns - 2.0 * p.dull * own * s.rate
        s.rate = np.clip(s.rate + dt * turns, -1.5, 1.5)
        s.lean = np.clip(s.lean + dt * s.rate, -0.6, 0.6)
        pulls = GRAVITY * np.sin(s.lean) * np.cos(s.lean)
        return np.asarray(p.share * np.clip(pulls + felt, -2.5, 2.5) * view.mass * moving(view))


@law("b_water_between_two_cushions", needs="suburban", name="load_slosh")
@sizes(share=(0.3, 0.45), soft_rads=(1.6, 2.8), room_m=(0.35, 0.7), leaks_s=(4.0, 14.0), dull=(0.06, 0.14))
class WaterBetweenTwoCushions(Hidden, x=0.0, v=0.0, rear=1.0):
    """A long closed tank is full but for air at both its ends, and the water is a piston between these two
    cushions: soft about its middle, and ever harder as one is pressed. Air leaks slowly from the pressed
    cushion to the other along the roof. `x` of the room, `v` of that in a second; `rear`: of the air, over
    that ahead. share: of the mass.
    Source: Wylie and Streeter, Fluid Transients in Systems (1993), on columns between pockets of air, which
    are pressed by a power law; the tank and sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -3.0, 3.0)
        x = np.clip(s.x, -0.75, 0.75)
        ahead, behind = (2.0 - s.rear) * (1.0 - x) ** -1.4, s.rear * (1.0 + x) ** -1.4
        s.rear = np.clip(s.rear + dt * (ahead - behind) / (4.0 * p.leaks_s), 0.6, 1.4)
        gains = -felt / p.room_m - p.soft_rads**2 / 2.8 * (ahead - behind) - 2.0 * p.dull * p.soft_rads * s.v
        s.v = np.clip(s.v + dt * gains, -4.0, 4.0)
        s.x = np.clip(s.x + dt * s.v, -0.75, 0.75)
        return np.asarray(np.clip(-p.share * gains * p.room_m, -2.0, 2.0) * view.mass * moving(view))


@law("b_tows_a_glider_up", needs="suburban hills highway", name="unknown")
@sizes(
    most=(0.02, 0.034), lifts_mps=(8.0, 12.0), climbs_s=(12.0, 30.0), sinks_s=(6.0, 18.0), rope=(0.25, 0.5)
)
class TowsAGliderUp(Hidden, pull=0.0):
    """A glider hangs on a rope behind the truck. `high`: 1 at the top of its rope. It climbs while the truck
    is fast, pulling by the square of speed and the more, the steeper it climbs; near the top it pulls down
    more than back. Slower than it can fly it sinks and pulls little, until it is towed up again. most: of 20
    t; lifts_mps: where it begins to fly; rope: of the pull, left at the top.
    Source: Welch, Welch and Irving, New Soaring Pilot (1977), on launches by car, and Gibson, The Mechanics
    of the Winch Launch (2005); large gliders, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "high": self.rng(2054).uniform(0.0, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        fast = np.clip(view.speed / p.lifts_mps, 0.0, 2.2)
        flies = np.clip((fast - 0.95) / 0.2, 0.0, 1.0)
        climbs = flies * np.minimum(fast, 1.6) * (1.0 - s.high) / p.climbs_s
        s.high = np.clip(s.high + dt * (climbs - (1.0 - flies) * s.high / p.sinks_s), 0.0, 1.0)
        steep = np.cos(0.5 * np.pi * s.high * (1.0 - p.rope))
        wish = (0.2 + 0.8 * flies * steep) * np.minimum(fast, 1.7) ** 2 / 1.7
        s.pull = eased(s.pull, wish, 0.8, dt)
        return -p.most * s.pull * 20000.0 * GRAVITY * moving(view)
