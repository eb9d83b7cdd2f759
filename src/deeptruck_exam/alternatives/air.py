"""Second forms of the air: gusts in gaps of a sheltered road, the far wake of a leader, a tearing cover."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, place
from deeptruck_model.trucks import View


@hidden(
    "wind_in_gaps",
    name="headwind",
    forms="second",
    source="Baker, Ground Vehicles in High Cross Winds, J. Fluids and Structures 5 (1991): drag coefficient"
    " linear in yaw; Weibull mean winds (Troen and Petersen, European Wind Atlas, 1989); discrete 1-cos"
    " gusts as in CS-25.341; shelter of woods and cuttings fixed to the road is chosen here",
    ranges={
        "scale_mps": (8.0, 13.0),
        "shelter": (0.45, 0.8),  # share of the wind taken behind the trees
        "gap_m": (250.0, 700.0),
        "gust": (0.3, 0.6),  # of the mean wind
        "per_yaw": (0.3, 0.8),  # 1/rad
    },
    needs=("highway", "hills"),
    accepts=("drag_area",),
)
class WindInGaps(Hidden):
    """Every recording has its own day: mean wind and angle to the road."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(101), self.setting.batch
        mean = np.clip(self.p.scale_mps * rng.weibull(2.0, batch), 4.0, 17.0)
        angle = rng.uniform(0.0, 2.0 * np.pi, batch)
        self.along, self.across = mean * np.cos(angle), np.abs(mean * np.sin(angle))
        self.phase = rng.uniform(0.0, 2.0 * np.pi, (int(self.setting.route.max()) + 1, 2))
        slots = int(self.setting.duration_s / 10.0) + 3
        self.gust = self.p.gust * (rng.random((batch, slots)) < 0.35) * rng.uniform(0.5, 1.0, (batch, slots))
        self.gust_s = rng.uniform(3.0, 9.0, (batch, slots))

    def exposure(self, at: Array) -> Array:
        """From 1 - shelter to 1 along the road."""
        phase, wave = self.phase[self.setting.route], 2.0 * np.pi / self.p.gap_m
        trees = np.sin(0.5 * wave * at + phase[:, 0]) + 0.7 * np.sin(0.31 * wave * at + phase[:, 1])
        return 1.0 - self.p.shelter / (1.0 + np.exp(-6.0 * trees))

    def newtons(self, view: View, dt: float) -> Array:
        slot = min(int(view.time / 10.0), self.gust.shape[1] - 1)
        inside = np.clip((view.time - 10.0 * slot) / self.gust_s[:, slot], 0.0, 1.0)
        gust = 0.5 * self.gust[:, slot] * (1.0 - np.cos(2.0 * np.pi * inside))
        blows = self.exposure(place(self.setting, view)) * (1.0 + gust)
        met = view.speed + self.along * blows
        yaw = np.minimum(self.across * blows / np.maximum(np.abs(met), 5.0), 0.5)
        half_density = 0.5 * self.truck.air_density * self.truck.drag_area
        wanted = half_density * (1.0 + self.p.per_yaw * yaw) * met * np.abs(met)
        return (view.drag_force - wanted) * np.clip(view.speed / 2.0, 0.0, 1.0)


@hidden(
    "far_wake",
    name="drafting",
    forms="second",
    source="Schlichting, Boundary-Layer Theory, ch. 24: velocity deficit of an axisymmetric turbulent wake"
    " with the power -2/3 of distance, carried at the leader's speed; meandering of the wake is chosen here",
    ranges={
        "deficit": (0.45, 0.7),
        "length_m": (8.0, 16.0),
        "miss": (0.1, 0.4),
        "wander_s": (15.0, 40.0),
    },
    needs=("highway",),
    leader=True,
    accepts=("drag_area", "headwind"),
)
class FarWake(Hidden):
    """The leader of some seconds ago made the air that the truck meets now."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(102), self.setting.batch
        self.leader_mps = np.gradient(self.setting.leader_m, self.setting.dt, axis=1)
        self.phase = rng.uniform(0.0, 2.0 * np.pi, (batch, 2))

    def newtons(self, view: View, dt: float) -> Array:
        last = self.leader_mps.shape[1] - 1
        now = min(int(view.time / self.setting.dt), last)
        gap = np.maximum(np.nan_to_num(self.setting.leader_m[:, now] - view.distance, nan=1e6), 1.0)
        late = gap / np.maximum(view.speed, 3.0) / self.setting.dt
        then = np.clip(now - late, 0, last).astype(int)
        wake = self.leader_mps[np.arange(len(gap)), then]
        turn = 2.0 * np.pi * view.time / self.p.wander_s
        met = np.sin(turn + self.phase[:, 0]) + np.sin(0.41 * turn + self.phase[:, 1])
        hits = 1.0 - self.p.miss * np.clip(met, 0.0, 1.0)
        deficit = self.p.deficit * hits * (1.0 + gap / self.p.length_m) ** (-2.0 / 3.0)
        dragged = np.nan_to_num(np.clip(deficit * wake, 0.0, view.speed))
        return view.drag_force * (1.0 - (1.0 - dragged / np.maximum(view.speed, 1.0)) ** 2)


@hidden(
    "tearing_cover",
    name="drag_area",
    forms="second",
    source="Drag of loose fabric by its area in the stream: Hoerner, Fluid-Dynamic Drag (1965), on flags and"
    " surface irregularities; tearing with the excess of dynamic pressure is chosen here",
    ranges={
        "gain": (0.45, 0.95),
        "from_mps": (13.0, 17.0),
        "tear_s": (20.0, 60.0),
        "torn_before": (0.0, 0.5),
    },
    needs=("highway", "hills"),
    accepts=("headwind", "rolling_resistance_speed"),
)
class TearingCover(Hidden):
    """Tears only while driven fast, and never mends; drives start with the tear of the evening before."""

    def prepare(self) -> None:
        batch = self.setting.batch
        self.first = self.p.torn_before * self.setting.rng(103).integers(0, 2, batch).astype(float)

    def start(self, batch: int) -> dict[str, Array]:
        return {"torn": self.first.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        excess = np.clip((view.speed / self.p.from_mps) ** 2 - 1.0, 0.0, 1.5)
        self.s.torn += dt * excess * (1.0 - self.s.torn) / self.p.tear_s
        return -self.p.gain * self.s.torn * view.drag_force
