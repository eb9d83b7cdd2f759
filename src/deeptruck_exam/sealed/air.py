"""Waves of air behind a ridge, walls that keep the leader's air, and curtains that are rolled up."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, index, moving
from deeptruck_exam.effects.places import MAP_CELL_M, MAP_CELLS, OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("k_waves_behind_the_ridge", needs="highway hills", name="headwind", accepts="drag_area")
@sizes(mean_mps=(6.0, 10.0), swings=(0.9, 1.5), long_m=(1300.0, 3000.0), dies_m=(3000.0, 8000.0))
@sizes(breathes_s=(60.0, 180.0))
class WavesBehindTheRidge(OnRoad):
    """Air that has crossed a ridge swings up and down behind it, and stands in waves over the land: at the
    ground it blows by turns hard, hardly, and back towards the ridge. Waves die away until the next ridge.
    mean_mps: of the wind along the road; swings: over half of that, in the first wave.
    Source: Scorer, Theory of Waves in the Lee of Mountains, Q. J. R. Met. Soc. 75 (1949), and Doyle and
    Durran, The Dynamics of Mountain-Wave-Induced Rotors, J. Atmospheric Sciences 59 (2002); shorter waves,
    sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1401), self.p
        metres = (np.arange(MAP_CELLS) + 0.5) * MAP_CELL_M
        self.road = np.zeros((self.rows(), MAP_CELLS))
        self.looks = rng.choice([-1.0, 1.0], self.rows())
        for row in self.road:
            ridge, long = -rng.uniform(0.0, 6000.0), p.long_m * rng.uniform(0.85, 1.15)
            while ridge < metres[-1]:
                behind = np.maximum(metres - ridge, 0.0)
                row += np.exp(-behind / p.dies_m) * np.sin(2.0 * np.pi * behind / long) * (behind > 0.0)
                ridge += rng.uniform(5000.0, 12000.0)
        self.road = np.where(self.looks[:, None] > 0.0, self.road, self.road[:, ::-1])
        shape = (self.setting.batch, int(self.setting.duration_s) + 5)
        self.breath = 1.0 + 0.25 * ou_series(rng, shape, 1.0, p.breathes_s)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        blows = 0.5 + p.swings * np.clip(self.between(self.road, view), -1.5, 1.5)
        breath = np.clip(self.breath[:, index(view, self.breath)], 0.3, 1.7)
        wind = p.mean_mps * blows * breath * self.looks[self.setting.route] * self.setting.direction
        relative = np.clip(1.0 + wind / np.maximum(view.speed, 0.5), -1.5, 3.0)
        felt = (relative * np.abs(relative) - 1.0) * view.drag_force
        return -felt * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("k_walls_keep_the_wake", needs="highway", name="drafting", accepts="drag_area headwind", leader=True)
@sizes(drawn=(0.6, 0.85), fills_s=(1.5, 4.0), mean_m=(300.0, 900.0), share=(0.45, 0.65), open=(0.02, 0.15))
@sizes(reach_m=(60.0, 160.0))
class WallsKeepTheWake(OnRoad, air=0.0):
    """`air` m/s that the leader has set in motion. Between walls and in galleries it cannot get out aside and
    runs along with him; in the open it is gone in a moment, and little is left behind him. drawn: of the
    leader's speed; share: of the road, that has walls; open: of the drag, saved right behind him elsewhere.
    Source: Bickel, Kuesel and King, Tunnel Engineering Handbook (1996), on air that vehicles drive through
    tunnels like pistons; walls beside an open road, sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1402), self.rows(), self.p.mean_m, self.p.share)
        self.pace = np.nan_to_num(np.gradient(self.setting.leader_m, self.setting.dt, axis=1))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        walls, gap = self.between(self.road, view), np.clip(self.gap(view), 0.0, 1e4)
        pace = np.clip(self.pace[:, self.now(view)], 0.0, 30.0)
        wish = p.drawn * pace * walls / (1.0 + (gap / p.reach_m) ** 2)
        s.air = eased(s.air, wish, p.fills_s * (0.4 + 0.6 * walls), dt)
        still = 1.0 - np.clip(s.air / np.maximum(view.speed, 5.0), 0.0, 0.95)
        saved = 1.0 - still**2 * (1.0 - p.open / (1.0 + gap / 15.0))
        return saved * view.drag_force * moving(view)


@law("k_curtains_for_the_birds", needs="highway hills", name="drag_area", accepts="headwind")
@sizes(more=(0.9, 1.6), warms_s=(25.0, 70.0), airs_s=(25.0, 60.0), opens_s=(5.0, 14.0), on=(0.6, 0.75))
@sizes(off=(0.38, 0.48))
class CurtainsForTheBirds(Hidden, rolled=0.0, open=0.0):
    """`warm`: air between crates of poultry. Birds warm it, the wind of driving airs it, the more the wider
    the curtains are open; they are rolled up when it is too warm and let down when it is too cold. Open
    crates are a grid in the stream. more: of the drag, all open; on, off: of `warm`.
    Source: Kettlewell, Hoxey and Mitchell, Heat Produced by Broiler Chickens in a Commercial Transport
    Vehicle, J. Agricultural Engineering Research 75 (2000); motors that roll curtains on the way, sizes are
    chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "warm": self.rng(1403).uniform(0.3, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        airs = (0.12 + s.open) * np.maximum(view.speed, 0.0) / 15.0 / p.airs_s
        rate = 1.0 / p.warms_s + airs
        s.warm = eased(s.warm, 1.0 / p.warms_s / rate, 1.0 / rate, dt)
        s.rolled = np.where(s.warm > p.on, 1.0, np.where(s.warm < p.off, 0.0, s.rolled))
        s.open = np.clip(s.open + dt * np.where(s.rolled > 0.5, 1.0, -1.0) / p.opens_s, 0.0, 1.0)
        return -p.more * s.open * view.drag_force * moving(view)
