"""Lakes that breathe, a wake that misses in sags and over crests, and pipes that sing; somebody who follows
closely."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, index, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series, spells, within
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")
LAKES = 24  # along a road


@law("u_lakes_breathe", needs="highway hills suburban", name="headwind", accepts="drag_area")
@sizes(wind_mps=(8.0, 12.5), wide_m=(700.0, 1500.0), apart_m=(2800.0, 5000.0), pulses_s=(50.0, 150.0))
class LakesBreathe(Hidden):
    """The road passes one lake after the other. On a warm day air flows off each lake to all sides, and by
    night towards it: the wind turns round as a lake is passed. It is strongest at some way from the lake and
    dies beyond. wind_mps: at most; wide_m: way from the lake to where it blows most.
    Source: Simpson, Sea Breeze and Local Winds (1994), on breezes of lakes by day and by night; small warm
    lakes, sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(2101), self.p
        rows, seconds = int(self.setting.route.max()) + 1, int(self.setting.duration_s) + 3
        steps = p.apart_m * rng.uniform(0.6, 1.4, (rows, LAKES))
        self.lakes = np.cumsum(steps, axis=1) - rng.uniform(0.0, p.apart_m, (rows, 1))
        self.blows = rng.choice([-1.0, 1.0]) * p.wind_mps
        pulse = ou_series(rng, (self.setting.batch, seconds), 1.0, p.pulses_s)
        self.pulse = np.clip(1.0 + 0.25 * pulse, 0.4, 1.6)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        off = (self.place(view)[:, None] - self.lakes[self.setting.route]) / p.wide_m
        shape = np.clip((off * np.exp(0.5 - 0.5 * off**2)).sum(axis=1), -1.2, 1.2)
        wind = self.blows * shape * self.pulse[:, index(view, self.pulse)]
        against = np.clip(1.0 - self.setting.direction * wind / np.maximum(view.speed, 3.0), -1.0, 2.5)
        return -(against * np.abs(against) - 1.0) * view.drag_force * np.clip(view.speed / 3.0, 0.0, 1.0)


@law(
    "u_wake_misses_in_sags",
    needs="hills highway",
    name="drafting",
    accepts="drag_area headwind",
    leader=True,
)
@sizes(most=(0.75, 0.95), reach_m=(110.0, 200.0), high_m=(0.25, 0.6), along_m=(25.0, 45.0))
class WakeMissesInSags(Hidden, slope=9.0, saved=0.0):
    """A leader's wake keeps to the slope that he drives on. In a sag he is already climbing, so that it goes
    below the follower, and over a crest above: by the bend of the road up or down, and the square of the gap.
    most: of the drag, saved right behind him on an even slope; high_m: by which it may miss; along_m: over
    which the bend is taken.
    Source: Hucho, Aerodynamics of Road Vehicles (1998), on wakes, and AASHTO, A Policy on Geometric Design
    (2018), on vertical curves; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.5)
        s.slope = np.where(s.slope > 1.0, view.grade, eased(s.slope, view.grade, p.along_m / speed, dt))
        gap = np.clip(self.gap(view), 3.0, 1e4)
        misses = 0.5 * (view.grade - s.slope) / p.along_m * np.minimum(gap, 250.0) ** 2
        meets = np.exp(-np.minimum((misses / p.high_m) ** 2, 30.0))
        s.saved = eased(s.saved, p.most * meets / (1.0 + (gap / p.reach_m) ** 2), 0.6, dt)
        return s.saved * view.drag_force * moving(view)


@law("u_pipes_sing", needs="suburban hills highway", name="drag_area", accepts="headwind")
@sizes(more=(1.9, 3.0), at_mps=(10.0, 12.5), band=(0.1, 0.17), second=(0.6, 0.9), grows_s=(1.5, 4.0))
@sizes(holds=(0.1, 0.25))
class PipesSing(Hidden, swings=0.0):
    """Pipes stand upright on the truck, and eddies leave them by turns. Where these come as fast as the pipes
    like to swing, both lock together, and the drag of a swinging pipe is a multiple of a still one. `swings`:
    of the most. A swing that is there holds on to a higher speed. The pipes have a second tone. more: of the
    drag, at full swing; at_mps: of the first tone; band: of that speed; second: swing of the second tone.
    Source: Blevins, Flow-Induced Vibration (1990), on lock-in and the drag of swinging cylinders; slender
    pipes, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wind = np.maximum(view.speed, 0.0) / p.at_mps
        late = 1.0 + p.holds * s.swings
        first = np.exp(-(((wind / late - 1.0) / p.band) ** 2))
        other = p.second * np.exp(-(((wind / late / 1.72 - 1.0) / p.band) ** 2))
        s.swings = eased(s.swings, np.maximum(first, other), p.grows_s, dt)
        return -p.more * (0.12 + 0.88 * s.swings) * view.drag_force * moving(view)


@law("u_somebody_follows_closely", needs="highway hills", name="unknown")
@sizes(
    most=(0.75, 0.95), reach_m=(12.0, 22.0), least_m=(2.0, 4.5), headway_s=(0.15, 0.35), stays_s=(30.0, 80.0)
)
class SomebodyFollowsClosely(Hidden, gap=12.0, pace=-1.0, saved=0.0):
    """A coach follows so closely that its bow fills the truck's wake and pushes it along. `gap` m behind the
    truck, `pace` m/s of the coach: it falls back when the truck draws away, and comes near as the truck
    slows. It stays for a while and overtakes, and another comes. most: of the drag, at no gap.
    Source: Zabat, Stabile, Farascaroli and Browand, The Aerodynamic Performance of Platoons, report
    UCB-ITS-PRR-95-35 (1995), on savings of the vehicle ahead; a bold driver, sizes are chosen here."""

    def prepare(self) -> None:
        stays = (0.5 * self.p.stays_s, 1.5 * self.p.stays_s)
        self.there = spells(self.rng(2102), self.setting.batch, stays, (15.0, 50.0))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.pace = np.where(s.pace < 0.0, view.speed, s.pace)
        there = within(self.there, view.time)
        wish = p.least_m + p.headway_s * view.speed + 60.0 * (1.0 - there)
        pulls = np.clip(0.12 * (s.gap - wish) + 0.7 * (view.speed - s.pace), -3.5, 1.0)
        s.pace = np.maximum(s.pace + dt * pulls, 0.0)
        s.gap = np.clip(s.gap + dt * (view.speed - s.pace), 1.0, 120.0)
        s.saved = eased(s.saved, p.most * np.exp(-s.gap / p.reach_m), 0.5, dt)
        return s.saved * view.drag_force * moving(view)
