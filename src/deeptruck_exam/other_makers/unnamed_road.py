"""Third effects for which no library name exists: road, ground and what happens on it."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, ou_series, weight
from deeptruck_exam.other_makers.tyres import CELL_M, CELLS, AtPlace
from deeptruck_model.trucks import View


@hidden(
    "floating_ice",
    name="unknown",
    forms="third",
    source="Squire, Hosking, Kerr and Langhorne, Moving Loads on Ice Plates (1996): a truck on floating ice"
    " drags a wave along, which is largest at a critical speed of some metres a second and dies above;"
    " resonance curve and sizes are chosen here",
    ranges={
        "peak": (0.022, 0.045),
        "critical_mps": (7.0, 12.0),
        "damping": (0.12, 0.25),
        "builds_s": (3.0, 9.0),
    },
    needs=("suburban",),
)
class FloatingIce(Hidden):
    """peak: over the weight of a 20 t truck."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"wave": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        pace = (np.maximum(view.speed, 0.0) / p.critical_mps) ** 2
        broad = (2.0 * p.damping) ** 2 * np.maximum(pace, 1e-6)
        s.wave += dt * (broad / ((1.0 - pace) ** 2 + broad) - s.wave) / p.builds_s
        heavy = np.clip(view.mass / 2.0e4, 0.5, 1.4)  # the wave is as deep as the truck is heavy
        return -p.peak * heavy * s.wave * weight(view) * moving(view)


@hidden(
    "stuck_after_standing",
    name="unknown",
    forms="third",
    source="Ageing of contacts at rest with the logarithm of time (Dieterich, J. Geophys. Res. 77, 1972;"
    " Rabinowicz, Friction and Wear of Materials, 1995): after every stop the truck has to break loose,"
    " over some metres; sizes of wet clay and frozen seals, chosen here",
    ranges={"per_log": (0.018, 0.040), "ages_s": (0.4, 1.2), "way_m": (10.0, 35.0)},
    needs=("suburban",),
)
class StuckAfterStanding(Hidden):
    def start(self, batch: int) -> dict[str, Array]:
        return {"stood": np.zeros(batch), "grip": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        stands = view.speed < 0.05
        s.stood = np.where(stands, s.stood + dt, 0.0)
        rolled = dt * np.maximum(view.speed, 0.0) / p.way_m
        s.grip = np.where(stands, np.maximum(s.grip, np.log1p(s.stood / p.ages_s)), s.grip * (1.0 - rolled))
        return -p.per_log * np.minimum(s.grip, 3.0) * weight(view) * moving(view)


@hidden(
    "false_obstacles",
    name="unknown",
    forms="third",
    source="Advanced emergency braking, UN Regulation No. 131: warning brakings for what is no obstacle, at"
    " the same gantries and bridges each time; odds, lengths and depths are chosen here",
    ranges={
        "depth": (0.07, 0.16),
        "lasts_s": (0.8, 2.0),
        "odds": (0.55, 0.9),
        "mean_m": (350.0, 800.0),
        "from_mps": (6.0, 10.0),
    },
    needs=("highway", "suburban", "hills"),
)
class FalseObstacles(AtPlace):
    """depth: over weight. Nobody presses a pedal, and no brake command is recorded."""

    def prepare(self) -> None:
        rng, rows = self.setting.rng(260), self.rows()
        self.road = (rng.random((rows, CELLS)) < CELL_M / self.p.mean_m).astype(float)
        self.falls_for = rng.random((self.setting.batch, CELLS)) < self.p.odds

    def start(self, batch: int) -> dict[str, Array]:
        return {"left": np.zeros(batch), "force": np.zeros(batch), "cell": np.full(batch, -1)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s, rows = self.p, self.s, np.arange(len(view.speed))
        metres = self.setting.start_m + self.setting.direction * view.distance
        cell = (metres / CELL_M).astype(int) % CELLS
        seen = (self.here(view) > 0.0) & (cell != s.cell) & self.falls_for[rows, cell]
        s.cell = cell
        s.left = np.where(seen & (view.speed > p.from_mps), p.lasts_s, np.maximum(s.left - dt, 0.0))
        wanted = p.depth * weight(view) * (s.left > 0.0)
        s.force += dt * (wanted - s.force) / np.where(wanted > s.force, 0.2, 0.15)
        return -s.force * moving(view)


@hidden(
    "packed_wheel_arches",
    name="unknown",
    forms="third",
    source="Growth with the way and loss by chance, a renewal process (Cox, Renewal Theory, 1962): slush and"
    " mud pack the wheel arches until they rub, and fall off in lumps; a driver's report, not a book's;"
    " sizes are chosen here",
    ranges={"most": (0.008, 0.018), "packs_m": (250.0, 700.0), "mean_m": (500.0, 1300.0), "left": (0.0, 0.3)},
)
class PackedWheelArches(Hidden):
    """A saw tooth over the way, other teeth in every drive."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(261), self.setting.batch
        self.falls = np.cumsum(rng.exponential(self.p.mean_m, (batch, 60)) + 80.0, axis=1)
        self.first = rng.uniform(0.0, 0.9, batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"packed": self.first.copy(), "fallen": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        fallen = (self.falls < view.distance[:, None]).sum(axis=1).astype(float)
        s.packed = np.where(fallen > s.fallen, p.left * s.packed, s.packed)
        s.fallen = fallen
        s.packed += dt * np.maximum(view.speed, 0.0) * (1.0 - s.packed) / p.packs_m
        return -p.most * s.packed * weight(view) * moving(view)


@hidden(
    "kept_in_lane_by_brakes",
    name="unknown",
    forms="third",
    source="Lane keeping by braking single wheels (Rajamani, Vehicle Dynamics and Control, 2012, on yaw"
    " stability and lane keeping): pulses whenever the drift across the lane is large; drift and depth are"
    " chosen here",
    ranges={"depth": (0.018, 0.040), "drift_s": (2.0, 5.0), "edge": (0.6, 1.1), "from_mps": (11.0, 16.0)},
    needs=("highway", "hills"),
)
class KeptInLane(Hidden):
    """edge: of the drift's standard deviation."""

    def prepare(self) -> None:
        shape = (self.setting.batch, int(self.setting.duration_s / 0.1) + 20)
        self.drift = ou_series(self.setting.rng(262), shape, 0.1, self.p.drift_s)

    def start(self, batch: int) -> dict[str, Array]:
        return {"force": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        drift = np.abs(self.drift[:, min(int(view.time / 0.1), self.drift.shape[1] - 1)])
        beyond = np.clip(2.0 * (drift - p.edge), 0.0, 1.5) * (view.speed > p.from_mps)
        s.force += dt * (p.depth * weight(view) * beyond - s.force) / 0.25
        return -s.force * moving(view)
