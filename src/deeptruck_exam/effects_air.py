"""Hidden effects of the air: wind, slipstream, a changed body."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, ou_series, place, some_drives
from deeptruck_model.trucks import View


@hidden(
    "headwind",
    source="Gusts by the Dryden (first-order) form of MIL-F-8785C, which approximates Kaimal's spectrum of"
    " IEC 61400-1; drag area grows with yaw as SAE J1252 measures it; winding heading of the road",
    ranges={
        "wind_mps": (5.0, 12.0),
        "turbulence": (0.10, 0.22),
        "length_m": (150.0, 300.0),
        "yaw_drag": (1.0, 2.5),
        "from_deg": (0.0, 360.0),
    },
    needs=("highway", "hills"),
    accepts=("drag_area",),
)
class Wind(Hidden):
    """One wind for all recordings, from one direction; every road has its own winding heading."""

    def prepare(self) -> None:
        rng = self.setting.rng(1)
        samples = int(self.setting.duration_s / 0.1) + 20
        shape = (self.setting.batch, samples)
        scale_s = self.p.length_m / max(self.p.wind_mps + 15.0, 1.0)
        self.gust = self.p.turbulence * self.p.wind_mps * ou_series(rng, shape, 0.1, scale_s)
        self.side_gust = self.p.turbulence * self.p.wind_mps * ou_series(rng, shape, 0.1, scale_s)
        routes = int(self.setting.route.max()) + 1
        self.bearing = rng.uniform(0.0, 2.0 * np.pi, routes)[self.setting.route]
        self.wave = rng.uniform(1500.0, 5000.0, routes)[self.setting.route]

    def newtons(self, view: View, dt: float) -> Array:
        at = min(int(view.time / 0.1), self.gust.shape[1] - 1)
        heading = self.bearing + 0.8 * np.sin(2.0 * np.pi * place(self.setting, view) / self.wave)
        heading = heading + np.pi * (self.setting.direction < 0)
        angle = np.deg2rad(self.p.from_deg) - heading
        along = view.speed + self.p.wind_mps * np.cos(angle) + self.gust[:, at]
        across = self.p.wind_mps * np.sin(angle) + self.side_gust[:, at]
        yaw = np.arctan2(across, np.maximum(np.abs(along), 1.0))
        area = self.truck.drag_area * (1.0 + self.p.yaw_drag * np.sin(yaw) ** 2)
        wanted = 0.5 * self.truck.air_density * area * along * np.hypot(along, across)
        return (view.drag_force - wanted) * np.clip(view.speed / 2.0, 0.0, 1.0)


@hidden(
    "drafting",
    source="Zabat, Stabile, Farascaroli and Browand, The Aerodynamic Performance of Platoons,"
    " UCB-ITS-PRR-95-35 (1995): saving falls off with gap over vehicle length; the rational form is chosen"
    " here",
    ranges={"saving": (0.30, 0.55), "length_m": (16.0, 35.0), "power": (1.0, 1.6)},
    needs=("highway",),
    leader=True,
    accepts=("drag_area", "headwind"),
)
class Slipstream(Hidden):
    def newtons(self, view: View, dt: float) -> Array:
        at = min(int(view.time / self.setting.dt), self.setting.leader_m.shape[1] - 1)
        gap = self.setting.leader_m[:, at] - view.distance
        saving = self.p.saving / (1.0 + (np.maximum(gap, 1.0) / self.p.length_m) ** self.p.power)
        return np.nan_to_num(saving) * view.drag_force


@hidden(
    "drag_area",
    source="Add-on and loose parts change the drag of trucks, Hucho, Aerodynamics of Road Vehicles (1998);"
    " sizes and the broad-band flutter are chosen here",
    ranges={"gain": (0.25, 0.60), "flutter": (0.02, 0.06), "share_of_drives": (0.4, 0.7)},
    needs=("highway", "hills"),
    accepts=("headwind", "rolling_resistance_speed"),
)
class LooseTarpaulin(Hidden):
    """In some recordings, from their beginning or from a moment on."""

    def prepare(self) -> None:
        rng = self.setting.rng(2)
        batch, duration = self.setting.batch, self.setting.duration_s
        drives = some_drives(rng, batch, self.p.share_of_drives)
        moment = np.where(rng.random(batch) < 0.5, -1.0, rng.uniform(0.2, 0.6, batch) * duration)
        self.from_s = np.where(drives, moment, np.inf)
        self.flutter = ou_series(rng, (batch, int(duration / 0.05) + 40), 0.05, 0.3)

    def newtons(self, view: View, dt: float) -> Array:
        at = min(int(view.time / 0.05), self.flutter.shape[1] - 1)
        gain = self.p.gain + self.p.flutter * self.flutter[:, at]
        return np.where(view.time >= self.from_s, -gain * view.drag_force, 0.0)
