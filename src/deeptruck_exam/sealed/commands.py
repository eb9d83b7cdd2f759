"""Messages that are longer for larger changes, one pump for both pedals, and a pedal that asks for a pull."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Filter, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law(
    "h_large_changes_need_long_messages",
    needs="suburban hills descent",
    name="command_delay",
    accepts="clock_offset",
)
@sizes(least_s=(0.25, 0.45), full_s=(1.5, 3.0))
class LargeChangesNeedLongMessages(Filter):
    """A line sends what has changed, bit by bit: a small change is a short message and a large one a long
    one. The receiver acts when a message is whole, and only then is the next one begun. Each pedal has a
    line of its own. least_s: of the shortest; full_s: more, for a change by the whole pedal.
    Source: Shannon, A Mathematical Theory of Communication (1948), and ITU-T G.726 (1990), on codes that
    send differences; a slow line, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Any]:
        zeros = np.zeros((batch, 2))
        return {"held": zeros.copy(), "sent": zeros.copy(), "left": zeros.copy()}

    def begin(self, s: State, u: Array) -> None:
        s.held, s.sent = u.copy(), u.copy()

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        s.left = s.left - dt
        whole = s.left <= 0.0
        s.held = np.where(whole, s.sent, s.held)
        changed = np.abs(u - s.held) / np.array([self.full, 40.0])
        s.sent = np.where(whole, u, s.sent)
        length = np.where(changed > 0.0, p.least_s + p.full_s * np.minimum(changed, 1.0), 0.0)
        s.left = np.where(whole, length, s.left)
        return np.asarray(s.held)


@law("h_one_pump_for_both_pedals", needs="suburban hills", name="command_rate_limit", accepts="turbo_lag")
@sizes(per_s=(0.16, 0.3), brake=(3.0, 6.0), keeps=(0.15, 0.3), fills_s=(5.0, 12.0))
class OnePumpForBothPedals(Filter):
    """A small pump presses the oil that moves throttle and brake. `store` of pressed oil, which every move of
    the brake takes from and the pump fills. The throttle moves by what pressure is left: fast after long
    rolling, slowly after a braking. per_s: of the full command, with a full store; brake: of the store, for a
    full braking; keeps: of the pace, with an empty one.
    Source: Merritt, Hydraulic Control Systems (1967), on flow by supply pressure, and Watton,
    Fundamentals of Fluid Power Control (2009), on accumulators that actuators share; a small
    pump, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Any]:
        return {"given": np.zeros(batch), "was": np.zeros(batch), "store": np.full(batch, 0.6)}

    def begin(self, s: State, u: Array) -> None:
        s.given, s.was = u[:, 0].copy(), u[:, 1].copy()

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        takes = p.brake * np.abs(u[:, 1] - s.was) / 40.0
        s.was = u[:, 1].copy()
        s.store = np.clip(s.store + dt * (1.0 - s.store) / p.fills_s - takes, 0.0, 1.0)
        most = p.per_s * (p.keeps + (1.0 - p.keeps) * s.store) * self.full * dt
        s.given = np.clip(u[:, 0], s.given - most, s.given + most)
        return np.stack([s.given, u[:, 1]], axis=1)


@law("h_pedal_asks_for_a_pull", needs="suburban hills highway", name="unknown")
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
