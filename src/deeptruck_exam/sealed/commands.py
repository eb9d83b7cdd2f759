"""Two of three that decide, a loading programme, and somebody on the step."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from deeptruck_exam.effects.law import STEP_S, Array, Hidden, Late, Sizes, State, TorqueFilter, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("k_two_of_three_decide", needs="suburban hills descent", name="command_delay", accepts="clock_offset")
@sizes(
    quick_s=(0.2, 0.4), middle_s=(0.45, 0.75), slow_s=(0.8, 1.3), uneven=(0.15, 0.35), wander_s=(5.0, 20.0)
)
class TwoOfThreeDecide(Late):
    """Three computers pass each command on, each by a way of its own that is quick or slow by turns; what is
    done is what the middle one says, so that nothing happens before the second one has heard. quick_s,
    middle_s, slow_s: of the three ways; uneven: of them, by chance.
    Source: Lyons and Vanderkulk, The Use of Triple-Modular Redundancy to Improve Computer Reliability, IBM
    Journal 6 (1962); a voter behind unlike links, times are chosen here."""

    length = 400

    def prepare(self) -> None:
        p, slots = self.p, int(self.setting.duration_s / 0.1) + 600
        wander = np.exp(p.uneven * ou_series(self.rng(1421), (3, slots), 0.1, p.wander_s))
        late = np.array([[p.quick_s], [p.middle_s], [p.slow_s]]) * wander / STEP_S
        self.late = np.clip(np.rint(late), 5, self.length - 2).astype(int)

    def start(self, batch: int) -> dict[str, Any]:
        return super().start(batch)

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        three = self.late[:, (s.at // 10) % self.late.shape[1]]
        return np.asarray(np.median([self.ago(s, int(steps)) for steps in three], axis=0))


@law("k_loads_by_programme", needs="suburban hills", name="command_rate_limit", accepts="turbo_lag")
@sizes(
    once_per_s=(0.5, 0.9), then_per_s=(0.04, 0.09), step=(0.12, 0.22), soaks_s=(8.0, 25.0), falls=(1.0, 2.0)
)
class LoadsByProgramme(TorqueFilter):
    """`soaked`: load that the engine has got used to. A step above that is taken at once, what is asked
    beyond it comes along a slow line as the engine soaks. once_per_s, then_per_s: of the full command; step:
    of it; falls: of it, in a second.
    Source: CIMAC, Transient Response Behaviour of Gas Engines, Position Paper (2011), on load steps that such
    engines accept from what they carry already; rates are chosen here."""

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.soaked = u[:, 0] / self.full

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        given = s.given / self.full
        s.soaked = eased(s.soaked, given, p.soaks_s, dt)
        at_once = np.clip((s.soaked + p.step - given) / 0.04, 0.0, 1.0)
        pace = p.then_per_s + (p.once_per_s - p.then_per_s) * at_once
        down = p.falls * self.full * dt
        return np.asarray(np.clip(pedal, s.given - down, s.given + pace * self.full * dt))


@law("k_somebody_on_the_step", needs="suburban", name="unknown")
@sizes(at_mps=(6.5, 8.3), takes=(0.35, 0.6), rides=(0.7, 0.95), eases_s=(0.4, 1.2), wide_mps=(0.8, 2.0))
class SomebodyOnTheStep(Hidden, still=0.0, acts=0.0):
    """`on`: a loader rides on the step behind. At every stand one may get on or off; while one is on it, a
    switch in the step keeps the truck slow by taking torque away above a speed, of which the crew knows
    nothing. takes: of the pull; rides: share of ways between stands; wide_mps: from none to all of it.
    Source: EN 1501-1, Refuse Collection Vehicles, Rear Loaded, on footboards whose occupation limits the
    speed to 30 km/h; a soft limit, sizes are chosen here."""

    def prepare(self) -> None:
        self.dice = self.rng(1422).random((self.setting.batch, 97))

    def start(self, batch: int) -> dict[str, Array]:
        first = np.resize(self.dice[:, 0], batch)
        return {
            **super().start(batch),
            "on": np.where(first < self.p.rides, 1.0, 0.0),
            "stands": np.ones(batch),
        }

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        before, s.still = s.still, np.where(view.speed < 0.3, s.still + dt, 0.0)
        changes = (before <= 1.5) & (s.still > 1.5)
        s.stands = np.where(changes, (s.stands + 1.0) % 97.0, s.stands)
        row = np.arange(len(view.speed)) % len(self.dice)
        drawn = np.where(self.dice[row, s.stands.astype(int)] < p.rides, 1.0, 0.0)
        s.on = np.where(changes, drawn, s.on)
        over = np.clip((view.speed - p.at_mps) / p.wide_mps, 0.0, 1.0)
        s.acts = eased(s.acts, s.on * over, p.eases_s, dt)
        return -p.takes * s.acts * np.maximum(view.traction_force, 0.0) * moving(view)
