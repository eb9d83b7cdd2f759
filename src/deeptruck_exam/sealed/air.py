"""A street of eddies behind a hill, a leader who folds out his tail, and a net that chaff fills."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, index, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("v_street_of_eddies", needs="highway hills", name="headwind", accepts="drag_area")
@sizes(
    mean_mps=(3.0, 5.5),
    swings_mps=(5.0, 8.5),
    long_m=(250.0, 700.0),
    drifts=(0.75, 0.9),
    fades_s=(60.0, 200.0),
)
class StreetOfEddies(Hidden):
    """A lone hill sheds eddies by turns to either side, and they drift over the land along the road. Who
    drives against them meets many in a minute, who drives along with them few. mean_mps: of the wind along
    the road; swings_mps: by eddies; long_m: from one to the next of a side; drifts: of the wind at height,
    which is twice that at the ground.
    Source: Chopra and Hubert, Mesoscale Eddies in Wake of Islands, J. Atmospheric Sciences 22 (1965), on
    streets behind heights; a small hill, sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1601)
        shape = (self.setting.batch, int(self.setting.duration_s) + 5)
        self.strong = 1.0 + 0.3 * ou_series(rng, shape, 1.0, self.p.fades_s)
        self.first = rng.uniform(0.0, 2.0 * np.pi, self.setting.batch)
        self.blows = rng.choice([-1.0, 1.0])

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        strong = np.clip(self.strong[:, index(view, self.strong)], 0.2, 1.8)
        drift = self.blows * p.drifts * 2.0 * p.mean_mps * view.time
        phase = self.first + 2.0 * np.pi * (self.place(view) - drift) / p.long_m
        along = self.blows * p.mean_mps + p.swings_mps * strong * np.tanh(1.6 * np.sin(phase)) / np.tanh(1.6)
        against = np.clip(1.0 - self.setting.direction * along / np.maximum(view.speed, 3.0), -1.0, 2.5)
        return -(against * np.abs(against) - 1.0) * view.drag_force * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("v_leader_folds_out_his_tail", needs="highway", name="drafting", accepts="drag_area", leader=True)
@sizes(most=(0.8, 0.95), reach_m=(60.0, 120.0), takes=(0.85, 0.98), out_mps=(22.8, 24.4), in_mps=(20.0, 22.3))
@sizes(sure_s=(1.0, 3.0), folds_s=(2.0, 5.0))
class LeaderFoldsOutHisTail(Hidden, tail=0.0):
    """`tail`: of the flaps at the leader's rear, which fold out by themselves above one speed and in again
    below another. Out, they narrow his wake and little is saved behind him. most: of the drag, right behind
    him; takes: of that, with flaps out; sure_s: how long a speed has to last.
    Source: Stemco, TrailerTail AutoDeploy, on flaps that unfold at 45 mph, and Salari and Ortega,
    Aerodynamic Design Criteria for Class 8 Heavy Vehicles, LLNL-TR-464265 (2010); sizes are chosen here."""

    def prepare(self) -> None:
        self.pace = np.clip(
            np.nan_to_num(np.gradient(self.setting.leader_m, self.setting.dt, axis=1)), 0.0, 35.0
        )

    def start(self, batch: int) -> dict[str, Array]:
        fast = np.resize(self.pace[:, 0], batch)
        return {**super().start(batch), "felt": fast, "wants": (fast > self.p.out_mps).astype(float)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.felt = eased(s.felt, self.pace[:, self.now(view)], p.sure_s, dt)
        s.wants = np.where(s.felt > p.out_mps, 1.0, np.where(s.felt < p.in_mps, 0.0, s.wants))
        s.tail = np.clip(s.tail + dt * np.where(s.wants > 0.5, 1.0, -1.0) / p.folds_s, 0.0, 1.0)
        gap = np.clip(self.gap(view), 0.0, 1e4)
        return p.most * np.exp(-gap / p.reach_m) * (1.0 - p.takes * s.tail) * view.drag_force * moving(view)


@law("v_chaff_fills_the_net", needs="highway hills", name="drag_area", accepts="headwind")
@sizes(more=(1.4, 2.1), fills_m=(150.0, 500.0), solid=(1.0, 1.5), bears=(0.55, 0.95), shakes_mps2=(0.5, 1.0))
class ChaffFillsTheNet(Hidden):
    """`shut`: of the meshes of a net over loose straw. The wind of driving presses chaff into them, and the
    net turns from a sieve into a wall. What has been pressed in falls out when the driver brakes, or of
    itself where it has grown too thick. more: of the drag, all shut; solid: power of that with `shut`;
    shakes_mps2: of braking, that frees it in two seconds.
    Source: Hoerner, Fluid-Dynamic Drag (1965), on screens and their solidity, and Laws and Livesey, Flow
    Through Screens, Annual Review of Fluid Mechanics 10 (1978); chaff and sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"shut": self.rng(1602).uniform(0.0, 0.9, batch), "drops": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.drops = np.where(s.shut > p.bears, 1.0, np.where(s.shut < 0.15, 0.0, s.drops))
        shakes = np.clip(-view.acceleration / p.shakes_mps2, 0.0, 2.0) ** 2 / 2.0
        presses = speed / p.fills_m * np.clip(speed / 15.0, 0.0, 1.5)
        s.shut = np.clip(
            s.shut + dt * (presses * (1.0 - s.drops) - (shakes + 0.5 * s.drops) * s.shut), 0.0, 1.0
        )
        return -p.more * s.shut**p.solid * view.drag_force * moving(view)
