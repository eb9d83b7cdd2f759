"""A mean of two ways by which commands come, and grease that has set about a cable."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import STEP_S, Array, Late, Sizes, State, TorqueFilter
from deeptruck_exam.effects.planting import hidden, sizes

law = partial(hidden, family="sealed")


@law(
    "j_mean_of_two_ways",
    needs="suburban hills descent",
    name="command_delay",
    accepts="clock_offset",
)
@sizes(first_s=(0.25, 0.45), second_s=(0.8, 1.3), trust=(0.35, 0.65), hears_s=(10.0, 30.0), deaf_s=(3.0, 9.0))
class MeanOfTwoWays(Late):
    """Each command comes by two ways, one of them much later than the other, and a computer that should know
    better takes their mean. At times one way is not heard, and the other counts alone. trust: weight of the
    earlier; hears_s, deaf_s: how long both are heard, and one alone. All trucks of a batch share that.
    Source: Gustafsson, Statistical Sensor Fusion (2010), on fusing what is out of step, and IEC 62439-3 on
    parallel redundancy; a gateway that averages instead of choosing, times are chosen here."""

    length = 400

    def prepare(self) -> None:
        rng, p = self.rng(2221), self.p
        steps, at = int(self.setting.duration_s / STEP_S) + 6000, 0
        self.weight = np.full(steps, p.trust)
        while at < steps:
            at += round(p.hears_s * rng.uniform(0.4, 1.8) / STEP_S)
            alone = round(p.deaf_s * rng.uniform(0.4, 1.8) / STEP_S)
            self.weight[at : at + alone] = rng.choice([0.0, 1.0])
            at += alone
        ease = np.ones(30) / 30.0
        self.weight = np.convolve(np.pad(self.weight, 15, mode="edge"), ease, mode="same")[15:-15]

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        weight = self.weight[min(s.at, len(self.weight) - 1)]
        early, late = (self.ago(s, round(seconds / STEP_S)) for seconds in (p.first_s, p.second_s))
        return np.asarray(late + weight * (early - late))


@law("j_grease_has_set", needs="suburban hills", name="command_rate_limit", accepts="turbo_lag")
@sizes(slow_per_s=(0.04, 0.07), quick_per_s=(0.35, 0.6), breaks=(0.2, 0.4), sets_s=(1.0, 3.0))
class GreaseHasSet(TorqueFilter):
    """The grease about a cable sets when it is at rest and flows when it is moved: a first movement is slow,
    and gets quicker by its own way. `set`: 1 when it has stood long. slow_per_s, quick_per_s: of the full
    command; breaks: way, of the full one, that breaks two thirds of it.
    Source: Mewis and Wagner, Thixotropy, Advances in Colloid and Interface Science 147 (2009), on structure
    that builds at rest and is broken by shear; a long cable in the wrong grease, sizes are chosen here."""

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.set = np.ones(len(u))

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        pace = p.quick_per_s + (p.slow_per_s - p.quick_per_s) * s.set
        step = dt * pace * self.full
        given = np.clip(pedal, s.given - step, s.given + step)
        moved = np.abs(given - s.given) / self.full
        s.set = np.clip(s.set * np.exp(-moved / p.breaks) + dt * (1.0 - s.set) / p.sets_s, 0.0, 1.0)
        return np.asarray(given)
