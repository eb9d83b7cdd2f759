"""Air: drafting, drag area, wind."""

from __future__ import annotations

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_exam.laws.catalogue import law, sizes
from deeptruck_exam.laws.law import Law, Sizes, State, index
from deeptruck_exam.laws.series import ou_series, some_drives
from deeptruck_model.trucks import View


@law("drafting", "highway", accepts="drag_area headwind", leader=True)
@sizes(saving=(0.30, 0.55), length_m=(16.0, 35.0), power=(1.0, 1.6))
class Slipstream(Law):
    """The drag reduction behind a leader decreases with the gap relative to the truck's length.
    Source: Zabat, Stabile, Farascaroli and Browand, The Aerodynamic Performance of Platoons,
    UCB-ITS-PRR-95-35 (1995), drag against gap; fitted by a rational function."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = index(view, self.setting.leader_m, self.setting.dt)
        gap = self.setting.leader_m[:, at] - view.distance
        saving = p.saving / (1.0 + (np.maximum(gap, 1.0) / p.length_m) ** p.power)
        return np.nan_to_num(saving) * view.drag_force


@law("drafting", "highway", accepts="drag_area headwind", leader=True)
@sizes(deficit=(0.45, 0.7), length_m=(8.0, 16.0), miss=(0.1, 0.4), wander_s=(15.0, 40.0))
class FarWake(Law):
    """The wake that the leader left some seconds ago moves with its speed, and drifts sideways and back.
    Source: Schlichting, Boundary-Layer Theory, on axisymmetric turbulent wakes: velocity deficit with the
    power -2/3 of distance."""

    def prepare(self) -> None:
        rng, batch = self.rng(102), self.setting.batch
        self.leader_mps = np.gradient(self.setting.leader_m, self.setting.dt, axis=1)
        self.phase = rng.uniform(0.0, 2.0 * np.pi, (batch, 2))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        last = self.leader_mps.shape[1] - 1
        now = min(int(view.time / self.setting.dt), last)
        gap = np.maximum(np.nan_to_num(self.setting.leader_m[:, now] - view.distance, nan=1e6), 1.0)
        late = gap / np.maximum(view.speed, 3.0) / self.setting.dt
        then = np.clip(now - late, 0, last).astype(int)
        wake = self.leader_mps[np.arange(len(gap)), then]
        turn = 2.0 * np.pi * view.time / p.wander_s
        met = np.sin(turn + self.phase[:, 0]) + np.sin(0.41 * turn + self.phase[:, 1])
        hits = 1.0 - p.miss * np.clip(met, 0.0, 1.0)
        deficit = p.deficit * hits * (1.0 + gap / p.length_m) ** (-2.0 / 3.0)
        dragged = np.nan_to_num(np.clip(deficit * wake, 0.0, view.speed))
        return view.drag_force * (1.0 - (1.0 - dragged / np.maximum(view.speed, 1.0)) ** 2)


@law("drag_area", "highway hills", accepts="headwind rolling_resistance_speed")
@sizes(gain=(0.25, 0.60), flutter=(0.02, 0.06), share_of_drives=(0.4, 0.7))
class LooseTarpaulin(Law):
    """A cover is loose in some recordings, from their start or from a later time, and flutters.
    Source: Hucho, Aerodynamics of Road Vehicles (1998), on add-on and loose parts of trucks."""

    def prepare(self) -> None:
        rng = self.rng(2)
        batch, duration = self.setting.batch, self.setting.duration_s
        drives = some_drives(rng, batch, self.p.share_of_drives)
        moment = np.where(rng.random(batch) < 0.5, -1.0, rng.uniform(0.2, 0.6, batch) * duration)
        self.from_s = np.where(drives, moment, np.inf)
        self.flutter = ou_series(rng, (batch, int(duration / 0.05) + 40), 0.05, 0.3)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = index(view, self.flutter, 0.05)
        gain = p.gain + p.flutter * self.flutter[:, at]
        return np.where(view.time >= self.from_s, -gain * view.drag_force, 0.0)


@law("headwind", "highway hills", accepts="drag_area")
@sizes(
    wind_mps=(5.0, 12.0),
    turbulence=(0.10, 0.22),
    length_m=(150.0, 300.0),
    yaw_drag=(1.0, 2.5),
    from_deg=(0.0, 360.0),
)
class SteadyWind(Law):
    """One wind direction and mean speed for all recordings, with gusts; the heading of each road varies.
    Source: gusts by the Dryden spectrum of MIL-F-8785C; drag area growing with yaw, SAE J1252."""

    def prepare(self) -> None:
        rng = self.rng(1)
        samples = int(self.setting.duration_s / 0.1) + 20
        shape = (self.setting.batch, samples)
        scale_s = self.p.length_m / max(self.p.wind_mps + 15.0, 1.0)
        self.gust = self.p.turbulence * self.p.wind_mps * ou_series(rng, shape, 0.1, scale_s)
        self.side_gust = self.p.turbulence * self.p.wind_mps * ou_series(rng, shape, 0.1, scale_s)
        routes = int(self.setting.route.max()) + 1
        self.bearing = rng.uniform(0.0, 2.0 * np.pi, routes)[self.setting.route]
        self.wave = rng.uniform(1500.0, 5000.0, routes)[self.setting.route]

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = index(view, self.gust, 0.1)
        heading = self.bearing + 0.8 * np.sin(2.0 * np.pi * self.place(view) / self.wave)
        heading = heading + np.pi * (self.setting.direction < 0)
        angle = np.deg2rad(p.from_deg) - heading
        along = view.speed + p.wind_mps * np.cos(angle) + self.gust[:, at]
        across = p.wind_mps * np.sin(angle) + self.side_gust[:, at]
        yaw = np.arctan2(across, np.maximum(np.abs(along), 1.0))
        area = self.truck.drag_area * (1.0 + p.yaw_drag * np.sin(yaw) ** 2)
        wanted = 0.5 * self.truck.air_density * area * along * np.hypot(along, across)
        return (view.drag_force - wanted) * np.clip(view.speed / 2.0, 0.0, 1.0)


@law("headwind", "highway hills", accepts="drag_area")
@sizes(scale_mps=(8.0, 13.0), shelter=(0.45, 0.8), gap_m=(250.0, 700.0), gust=(0.3, 0.6), per_yaw=(0.3, 0.8))
class ShelteredWind(Law):
    """Mean wind and direction change from recording to recording; woods shelter parts of the road. shelter:
    share of the wind removed; gust: share of the mean wind; per_yaw: 1/rad.
    Source: Baker, Ground Vehicles in High Cross Winds, J. Fluids and Structures 5 (1991): drag coefficient
    linear in yaw; Weibull mean winds, Troen and Petersen, European Wind Atlas (1989); 1-cos gusts, CS-25.341.
    """

    def prepare(self) -> None:
        rng, batch = self.rng(101), self.setting.batch
        mean = np.clip(self.p.scale_mps * rng.weibull(2.0, batch), 4.0, 17.0)
        angle = rng.uniform(0.0, 2.0 * np.pi, batch)
        self.along, self.across = mean * np.cos(angle), np.abs(mean * np.sin(angle))
        self.phase = rng.uniform(0.0, 2.0 * np.pi, (int(self.setting.route.max()) + 1, 2))
        slots = int(self.setting.duration_s / 10.0) + 3
        self.gust = self.p.gust * (rng.random((batch, slots)) < 0.35) * rng.uniform(0.5, 1.0, (batch, slots))
        self.gust_s = rng.uniform(3.0, 9.0, (batch, slots))

    def exposure(self, at: Array) -> Array:
        """Share of the wind along the road, from 1 - shelter to 1."""
        phase, wave = self.phase[self.setting.route], 2.0 * np.pi / self.p.gap_m
        trees = np.sin(0.5 * wave * at + phase[:, 0]) + 0.7 * np.sin(0.31 * wave * at + phase[:, 1])
        return 1.0 - self.p.shelter / (1.0 + np.exp(-6.0 * trees))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slot = index(view, self.gust, 10.0)
        inside = np.clip((view.time - 10.0 * slot) / self.gust_s[:, slot], 0.0, 1.0)
        gust = 0.5 * self.gust[:, slot] * (1.0 - np.cos(2.0 * np.pi * inside))
        blows = self.exposure(self.place(view)) * (1.0 + gust)
        met = view.speed + self.along * blows
        yaw = np.minimum(self.across * blows / np.maximum(np.abs(met), 5.0), 0.5)
        half_density = 0.5 * self.truck.air_density * self.truck.drag_area
        wanted = half_density * (1.0 + p.per_yaw * yaw) * met * np.abs(met)
        return (view.drag_force - wanted) * np.clip(view.speed / 2.0, 0.0, 1.0)
