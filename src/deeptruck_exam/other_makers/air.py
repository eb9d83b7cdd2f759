"""Third forms of the air: a front that passes, the pocket behind a leader, exchanged bodies."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, place, some_drives
from deeptruck_model.trucks import View


@hidden(
    "passing_front",
    name="headwind",
    forms="third",
    source="Von Karman's spectrum (MIL-HDBK-1797) frozen into the air by Taylor's hypothesis, as a sum of"
    " waves met at road plus wind; the mean wind rises and veers as a front passes; drag with yaw squared"
    " (SAE J1252 wind tunnel practice); polygon roads, sizes chosen here",
    ranges={
        "after_mps": (8.0, 14.0),
        "before": (0.1, 0.5),  # of the wind after the front
        "turbulence": (0.12, 0.24),
        "scale_m": (80.0, 250.0),
        "yaw_drag": (1.0, 2.2),  # 1/rad2
        "from_deg": (0.0, 360.0),
    },
    needs=("highway", "hills"),
    accepts=("drag_area",),
)
class PassingFront(Hidden):
    def prepare(self) -> None:
        rng, batch = self.setting.rng(201), self.setting.batch
        self.front_s = rng.uniform(0.1, 0.7, batch) * self.setting.duration_s
        self.veer = np.deg2rad(self.p.from_deg + rng.normal(0.0, 25.0, batch))
        self.wave = 2.0 * np.pi / np.geomspace(25.0, 2500.0, 18)[:, None]
        power = (1.0 + 70.8 * (self.wave * self.p.scale_m / (2.0 * np.pi)) ** 2) ** (-5.0 / 6.0) * self.wave
        self.size = self.p.turbulence * np.sqrt(2.0 * power / power.sum())
        self.phase = rng.uniform(0.0, 2.0 * np.pi, (18, batch))
        routes = int(self.setting.route.max()) + 1
        self.bearing = rng.uniform(0.0, 2.0 * np.pi, (routes, 1)) + np.cumsum(
            rng.normal(0.0, 0.45, (routes, 200)), axis=1
        )

    def heading(self, at: Array) -> Array:
        """Of the road, which bends every 700 m, rad."""
        leg = (at / 700.0).astype(int) % self.bearing.shape[1]
        return self.bearing[self.setting.route, leg] + np.pi * (self.setting.direction < 0)

    def newtons(self, view: View, dt: float) -> Array:
        p = self.p
        passed = 0.5 + 0.5 * np.tanh((view.time - self.front_s) / 15.0)
        mean = p.after_mps * (p.before + (1.0 - p.before) * passed)
        met = self.wave * (view.distance + mean * view.time) + self.phase
        wind = mean * (1.0 + (self.size * np.sin(met)).sum(axis=0))
        angle = self.veer + 1.2 * passed - self.heading(place(self.setting, view))
        along, across = view.speed + wind * np.cos(angle), wind * np.sin(angle)
        yaw = np.clip(np.arctan2(across, np.maximum(along, 2.0)), -0.6, 0.6)
        area = self.truck.drag_area * (1.0 + p.yaw_drag * yaw**2)
        wanted = 0.5 * self.truck.air_density * area * along * np.abs(along)
        return (view.drag_force - wanted) * np.clip(view.speed / 2.0, 0.0, 1.0)


@hidden(
    "pocket_behind_leader",
    name="drafting",
    forms="third",
    source="McAuliffe, Lammert, Lu, Shladover, Surcel and Kailas, Influences on Energy Savings of Heavy"
    " Trucks Using Cooperative Adaptive Cruise Control, SAE 2018-01-1181: the saving is largest at a gap"
    " and falls to both sides; its shape, and leaders of all sizes, are chosen here",
    ranges={"saving": (0.45, 0.70), "best_m": (12.0, 22.0), "smallest": (0.35, 0.8), "fills_s": (1.0, 4.0)},
    needs=("highway",),
    leader=True,
    accepts=("drag_area", "headwind"),
)
class PocketBehindLeader(Hidden):
    """smallest: saving behind the smallest leader over that behind the largest."""

    def prepare(self) -> None:
        self.leader = self.setting.rng(202).uniform(self.p.smallest, 1.0, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"saving": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        at = min(int(view.time / self.setting.dt), self.setting.leader_m.shape[1] - 1)
        gap = np.nan_to_num(self.setting.leader_m[:, at] - view.distance, nan=1e4)
        near = np.clip(gap, 0.5, 1e4) / p.best_m
        wanted = p.saving * self.leader * near * np.exp(1.0 - near)
        s.saving += dt * (wanted - s.saving) / p.fills_s
        return s.saving * view.drag_force


@hidden(
    "exchanged_bodies",
    name="drag_area",
    forms="third",
    source="Drag of platform, box and curtain bodies, Hucho, Aerodynamics of Road Vehicles (1998), on"
    " commercial vehicles: swap bodies changed between drives, curtains that bulge with speed; sizes"
    " chosen here",
    ranges={
        "larger": (0.45, 0.85),
        "smaller": (0.2, 0.4),
        "bulge": (0.0, 0.3),
        "share_of_drives": (0.5, 0.75),
    },
    needs=("highway", "hills"),
    accepts=("headwind", "rolling_resistance_speed"),
)
class ExchangedBodies(Hidden):
    """One body a drive; two in three of the exchanged ones are larger than the one that is known."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(203), self.setting.batch
        drives = some_drives(rng, batch, self.p.share_of_drives)
        larger = rng.random(batch) < 0.67
        self.gain = drives * np.where(larger, self.p.larger, -self.p.smaller)

    def newtons(self, view: View, dt: float) -> Array:
        bulge = 1.0 + self.p.bulge * (np.clip(view.speed, 0.0, 30.0) / 20.0 - 1.0)
        return -self.gain * bulge * view.drag_force
