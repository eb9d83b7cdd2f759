"""Wakes of wind mills, a wake that dies by the clock, and louvres that open with heat."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, index, moving
from deeptruck_exam.effects.places import OnRoad
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")
FARMS, MILLS = 28, 14  # along all the road, and in each farm


@law("y_wakes_of_wind_mills", needs="highway hills", name="headwind", accepts="drag_area")
@sizes(
    wind_mps=(6.5, 10.0), takes=(0.6, 0.85), widens=(0.05, 0.09), far_m=(120.0, 420.0), turns_s=(30.0, 90.0)
)
@sizes(swings=(0.3, 0.6))
class WakesOfWindMills(OnRoad):
    """A steady wind blows along the road, and farms of mills beside the road take some of it. Each mill's
    wake lies where the wind carries it. As the wind swings, all wakes move along the road. takes: of the
    wind, right behind a mill; widens: of a wake, by the way; far_m: of the mills from the road; swings: rad
    of the wind.
    Source: Jensen, A Note on Wind Generator Interaction, Risø-M-2411 (1983), on wakes that widen evenly;
    mills and the swinging wind are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1801), self.p
        farms = np.repeat(rng.uniform(0.0, 60000.0, (self.rows(), FARMS)), MILLS, axis=1)
        at = farms + 300.0 * rng.standard_normal(farms.shape)
        far = rng.choice([-1.0, 1.0], at.shape) * p.far_m * rng.uniform(0.5, 1.8, at.shape)
        self.at, self.far = at[self.setting.route], far[self.setting.route]
        seconds = int(self.setting.duration_s) + 3
        self.angle = p.swings * ou_series(rng, (self.setting.batch, seconds), 1.0, p.turns_s)
        self.blows = rng.choice([-1.0, 1.0]) * p.wind_mps

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        second = index(view, self.angle)
        last = min(second + 1, self.angle.shape[1] - 1)
        share = view.time - np.floor(view.time)
        angle = (1.0 - share) * self.angle[:, second] + share * self.angle[:, last]
        wide = 45.0 + p.widens * np.abs(self.far)
        away = self.place(view)[:, None] - self.at - np.sin(angle)[:, None] * self.far
        lulls = p.takes * (45.0 / wide) ** 2 * np.exp(-0.5 * (away / wide) ** 2)
        wind = self.blows * np.cos(angle) * (1.0 - np.minimum(lulls.sum(axis=1), 0.9))
        against = np.clip(1.0 - self.setting.direction * wind / np.maximum(view.speed, 3.0), -1.0, 2.5)
        return -(against * np.abs(against) - 1.0) * view.drag_force * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("y_wake_dies_by_the_clock", needs="highway", name="drafting", accepts="drag_area headwind", leader=True)
@sizes(most=(0.8, 0.97), virtual_s=(1.5, 3.0), power=(1.0, 1.4), settles_s=(0.4, 1.2))
class WakeDiesByTheClock(Hidden, at=0.0, saved=0.0):
    """The wake of a leader dies by the time since he was here, however far he has got. `at`: the sample at
    which he was here. So the same gap saves more at high speed than at low speed. most: of the drag, saved
    just behind him; virtual_s: of age that a wake is born with; settles_s: of the flow round the follower.
    Source: Batchelor, The Theory of Homogeneous Turbulence (1953), on energy that falls with a power of its
    age; the age of a wake is that of its turbulence, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        way, row = self.setting.leader_m, np.arange(len(view.distance))
        last = way.shape[1] - 1
        now = s.at.astype(int)
        s.at = np.where(way[row, np.minimum(now + 1, last)] < view.distance, np.minimum(now + 1, last), now)
        here = s.at.astype(int)
        pace = np.maximum((way[:, min(9, last)] - way[:, 0]) / (min(9, last) * self.setting.dt), 3.0)
        before = np.maximum(way[row, here] - view.distance, 0.0) / pace  # he started ahead of this place
        age = np.nan_to_num(view.time - here * self.setting.dt + before, nan=1e4)
        wish = p.most * (1.0 + np.clip(age, 0.0, 1e4) / p.virtual_s) ** -p.power
        s.saved = eased(s.saved, wish, p.settles_s, dt)
        return s.saved * view.drag_force * moving(view)


@law("y_louvres_open_with_heat", needs="hills highway suburban", name="drag_area", accepts="headwind")
@sizes(more=(0.9, 1.4), heats_s=(4.0, 10.0), cools_s=(10.0, 25.0), opens=(0.35, 0.55), shuts=(0.12, 0.25))
@sizes(moves_s=(1.5, 5.0))
class LouvresOpenWithHeat(Hidden, open=0.0):
    """`heat` of the coolant, which engine power gives and the wind of driving takes. Louvres before the
    cooler open by three steps. Each opens at one heat and shuts again at a much lower one. more: of the drag,
    all open; opens, shuts: heat of the first step.
    Source: Hucho, Aerodynamics of Road Vehicles (1998), on drag of cooling air, and Bosch Automotive Handbook
    (2014), on radiator shutters; large louvres, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        heat = self.rng(1803).uniform(0.1, 0.9, batch)
        steps = np.array([np.zeros(batch), np.zeros(batch), np.zeros(batch)])
        return {**super().start(batch), "heat": heat, "steps": steps}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        cooling = 0.3 + 0.7 * np.clip(view.speed / 20.0, 0.0, 1.4) * (0.4 + 0.6 * s.open)
        heats = 1.6 * self.power_share(view) / p.heats_s
        s.heat = np.clip(s.heat + dt * (heats - s.heat * cooling / p.cools_s), 0.0, 1.5)
        later = np.array([[0.0], [0.2], [0.4]])
        s.steps = np.where(s.heat > p.opens + later, 1.0, np.where(s.heat < p.shuts + later, 0.0, s.steps))
        s.open = eased(s.open, s.steps.mean(axis=0), p.moves_s, dt)
        return -p.more * s.open * view.drag_force * moving(view)
