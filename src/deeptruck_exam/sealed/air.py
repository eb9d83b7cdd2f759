"""Trains beside the road, a round tank ahead whose wake turns narrow, and brushwood that folds back; a drum
that turns in the side wind."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, index, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import SAMPLE_S, ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")
TRAINS = 40  # within FAR_M of where a drive begins, both ways
FAR_M = 26000.0


@law("b_trains_run_alongside", needs="highway hills suburban", name="headwind", accepts="drag_area")
@sizes(takes=(0.34, 0.52), train_mps=(27.0, 36.0), long_m=(600.0, 1100.0), grows_m=(120.0, 350.0))
@sizes(dies_m=(200.0, 500.0))
class TrainsRunAlongside(Hidden):
    """A railway lies close beside the road. Each goods train drags air along, ever more from its head to its
    end, and behind it that wind dies. takes: of the train's speed, that the air at its end has; grows_m: from
    its head, to two thirds of that; dies_m: behind its end.
    Source: Sterling, Baker, Jordan and Johnson, A Study of the Slipstreams of High-Speed Passenger Trains and
    Freight Trains, Proc. IMechE F 222 (2008); a busy line, sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(2001), self.p
        shape = (self.setting.batch, TRAINS)
        self.head = self.setting.start_m[:, None] + rng.uniform(-FAR_M, FAR_M, shape)
        self.pace = rng.choice([-1.0, 1.0], shape) * p.train_mps * rng.uniform(0.8, 1.1, shape)
        self.long = p.long_m * rng.uniform(0.6, 1.2, shape)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        head = self.head + self.pace * view.time
        behind = np.sign(self.pace) * (head - self.place(view)[:, None])
        along = 1.0 - np.exp(-np.clip(behind, 0.0, self.long) / p.grows_m)
        left = np.exp(-np.maximum(behind - self.long, 0.0) / p.dies_m)
        wind = np.clip((p.takes * self.pace * along * left).sum(axis=1), -16.0, 16.0)
        against = np.clip(1.0 - self.setting.direction * wind / np.maximum(view.speed, 3.0), -1.0, 2.5)
        return -(against * np.abs(against) - 1.0) * view.drag_force * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("b_round_tank_ahead", needs="highway hills", name="drafting", accepts="drag_area headwind", leader=True)
@sizes(
    most=(0.8, 0.97), reach_m=(120.0, 220.0), narrow=(0.05, 0.2), flips_mps=(17.0, 21.5), holds=(0.03, 0.09)
)
@sizes(turns_s=(0.8, 2.5))
class RoundTankAhead(Hidden, narrow=0.0, saved=0.0):
    """The leader carries a round tank. Beyond one speed the flow clings to it, all at once, and its wake is
    `narrow` and saves little; it turns wide again at a somewhat lower speed. Only the leader's own speed
    counts. most: of the drag, saved right behind a wide wake; narrow: of that; flips_mps: where it turns
    narrow; holds: of that speed, lower where it turns back.
    Source: Schewe, On the Force Fluctuations Acting on a Circular Cylinder in Crossflow, J. Fluid Mechanics
    133 (1983), on two states of the flow and what keeps each; a smooth tank, sizes are chosen here."""

    def pace(self, view: View) -> Array:
        """The leader's speed over the last second, m/s."""
        way, ago = self.setting.leader_m, round(1.0 / self.setting.dt)
        now = max(self.now(view), min(ago, way.shape[1] - 1))
        before = max(now - ago, 0)
        return np.nan_to_num((way[:, now] - way[:, before]) / max((now - before) * self.setting.dt, 0.1))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pace = self.pace(view)
        back = p.flips_mps * (1.0 - p.holds)
        wish = np.where(pace > p.flips_mps, 1.0, np.where(pace < back, 0.0, np.rint(s.narrow)))
        s.narrow = eased(s.narrow, wish, p.turns_s, dt)
        near = 1.0 / (1.0 + (np.clip(self.gap(view), 3.0, 1e4) / p.reach_m) ** 2)
        s.saved = eased(s.saved, p.most * near * (1.0 - (1.0 - p.narrow) * s.narrow), 0.6, dt)
        return s.saved * view.drag_force * moving(view)


@law("b_brushwood_folds_back", needs="highway hills suburban", name="drag_area", accepts="headwind")
@sizes(more=(2.8, 4.2), power=(0.9, 1.5), bends_mps=(7.0, 11.0), folds_s=(4.0, 10.0), rises_s=(20.0, 60.0))
@sizes(leaves_m=(700.0, 2200.0))
class BrushwoodFoldsBack(Hidden):
    """Brushwood stands out of an open body. Branches fold back in the wind of driving, so that their area
    falls with a power of speed, at once when it grows and slowly as it goes. `leaves` on them are torn off
    along the way, the faster the sooner. more: of the drag, unfolded and leafy; power: of the speed;
    leaves_m: at 20 m/s.
    Source: Vogel, Drag and Reconfiguration of Broad Leaves in High Winds, J. Experimental Botany 40 (1989),
    on the power; a heap of branches, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(2002)
        return {"wind": rng.uniform(4.0, 16.0, batch), "leaves": rng.uniform(0.4, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.wind = eased(s.wind, speed, np.where(speed > s.wind, p.folds_s, p.rises_s), dt)
        tears = speed / p.leaves_m * np.minimum(speed / 20.0, 1.4) ** 3
        s.leaves = np.maximum(s.leaves * (1.0 - dt * tears), 0.0)
        area = (1.0 + (s.wind / p.bends_mps) ** 2) ** (-0.5 * p.power) * (0.45 + 0.55 * s.leaves)
        return -p.more * area * view.drag_force * moving(view)


@law("b_drum_turns_in_the_side_wind", needs="suburban hills highway", name="unknown")
@sizes(most=(0.016, 0.027), gusts_s=(5.0, 14.0), mean=(0.3, 0.8), at_rads=(120.0, 150.0), spins_s=(1.5, 5.0))
class DrumTurnsInTheSideWind(Hidden, spin=0.6):
    """An upright drum turns on the truck, by its engine, and the wind comes from the side: it is drawn across
    that wind, forwards or back as the wind has it, whatever the truck's speed. `spin` of the drum follows the
    engine slowly. most: of 20 t, at at_rads in the usual wind.
    Source: Seifert, A Review of the Magnus Effect in Aeronautics, Progress in Aerospace Sciences 55 (2012),
    on forces by spin and wind; a huge drum, sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(2003), self.p
        samples = int(self.setting.duration_s / SAMPLE_S) + 8
        gusts = ou_series(rng, (self.setting.batch, samples), SAMPLE_S, p.gusts_s)
        self.side = rng.choice([-1.0, 1.0], (self.setting.batch, 1)) * p.mean + 0.8 * gusts

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.spin = eased(s.spin, np.clip(view.engine_speed / p.at_rads, 0.0, 1.6), p.spins_s, dt)
        wind = self.side[:, index(view, self.side, SAMPLE_S)]
        share = (view.time / SAMPLE_S) % 1.0
        later = self.side[:, min(index(view, self.side, SAMPLE_S) + 1, self.side.shape[1] - 1)]
        blows = np.clip(wind + share * (later - wind), -2.2, 2.2)
        return p.most * 20000.0 * 9.81 * s.spin**1.5 * blows * moving(view)
