"""Wind down the slopes, wakes beside the lane, loose cloth."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, index, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("t_slope_wind_pulses", needs="hills highway", name="headwind", accepts="drag_area")
@sizes(wind_mps=(7.5, 12.0), land_m=(200.0, 600.0), valley=(0.3, 0.6), pulse_s=(40.0, 110.0))
@sizes(depth=(0.3, 0.7))
class SlopeWindPulses(Hidden):
    """Cold air drains down whatever slope there is, so that it blows against who climbs, and pulses as it
    does. `land`: slope of the land, smoothed over land_m; valley: share of wind along each valley.
    Source: McNider, A Note on Velocity Fluctuations in Drainage Flows, J. Atmos. Sci. 39 (1982), and Prandtl,
    Essentials of Fluid Dynamics (1952), on mountain winds; strengths and periods are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(951)
        falls = rng.choice([-1.0, 1.0], int(self.setting.route.max()) + 1)
        self.valley = self.p.valley * falls[self.setting.route] * self.setting.direction
        self.phase = rng.uniform(0.0, 2.0 * np.pi, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"land": np.full(batch, np.nan)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.land = np.where(np.isnan(s.land), view.grade, s.land)
        s.land = s.land + dt * np.maximum(view.speed, 0.0) * (view.grade - s.land) / p.land_m
        pulse = 1.0 + p.depth * np.sin(2.0 * np.pi * view.time / p.pulse_s + self.phase)
        wind = p.wind_mps * pulse * (np.tanh(s.land / 0.012) + self.valley)
        relative = np.clip(1.0 + wind / np.maximum(view.speed, 0.5), -1.5, 3.0)
        felt = (relative * np.abs(relative) - 1.0) * view.drag_force
        return -felt * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("t_beside_the_wake", needs="highway", name="drafting", accepts="drag_area headwind", leader=True)
@sizes(deficit=(0.7, 0.95), widens=(0.012, 0.03), wanders_m=(0.25, 0.8), swings_s=(4.0, 14.0))
class BesideTheWake(Hidden):
    """Who follows wanders in his lane, out of the middle of the wake and back. widens: m for each m of gap.
    Source: Bastankhah and Porté-Agel, A New Analytical Model for Wind-Turbine Wakes, Renewable Energy 70
    (2014): the deficit is a bell across the wake, which widens with the way; a truck's width and wandering
    are chosen here."""

    core_m = 1.2

    def prepare(self) -> None:
        rng, p = self.rng(952), self.p
        shape = (self.setting.batch, int(self.setting.duration_s / 0.1) + 20)
        habit = 0.5 * p.wanders_m * rng.standard_normal((shape[0], 1))
        self.aside = habit + p.wanders_m * ou_series(rng, shape, 0.1, p.swings_s)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wide = self.core_m + p.widens * np.maximum(self.gap(view), 0.0)
        aside = self.aside[:, index(view, self.aside, 0.1)]
        slower = p.deficit * (self.core_m / wide) ** 2 * np.exp(-0.5 * (aside / wide) ** 2)
        return (1.0 - (1.0 - slower) ** 2) * view.drag_force


@law("t_cloth_flaps", needs="highway", name="drag_area", accepts="rolling_resistance_speed")
@sizes(more=(0.4, 0.75), from_mps=(18.0, 21.5), until=(0.82, 0.93), gathers_s=(1.5, 6.0))
class ClothFlaps(Hidden, flaps=0.0, size=0.0):
    """A loose cover lies still up to a speed, flaps beyond it, and lies down only well below. more: of the
    drag; until: of from_mps.
    Source: Zhang, Childress, Libchaber and Shelley, Flexible Filaments in a Flowing Soap Film as a Model for
    One-Dimensional Flags in a Two-Dimensional Wind, Nature 408 (2000): both states are stable between two
    speeds; drag of flags after Hoerner, Fluid-Dynamic Drag (1965); sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.flaps = np.where(view.speed > p.from_mps, 1.0, s.flaps)
        s.flaps = np.where(view.speed < p.until * p.from_mps, 0.0, s.flaps)
        s.size = s.size + dt * (s.flaps - s.size) / p.gathers_s
        return -p.more * s.size * view.drag_force * moving(view)
