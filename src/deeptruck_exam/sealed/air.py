"""A lid over the land, oncoming trucks that sweep a wake away, and vanes that turn in the wind."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, index, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import SAMPLE_S, ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("h_wind_above_the_lid", needs="hills highway descent", name="headwind", accepts="drag_area")
@sizes(
    wind_mps=(10.0, 14.5), below=(0.05, 0.2), thick_m=(2.0, 5.0), waves_m=(4.0, 9.0), waves_s=(50.0, 140.0)
)
class WindAboveTheLid(Hidden, climbed=0.0):
    """Cold air lies in the low land under a lid, nearly still, and a wind blows along the road above it.
    Waves run along the lid, so that it rises and sinks over a truck. `climbed` m since the start. wind_mps:
    above; below: of that, under the lid; thick_m: over which both pass into each other; waves_m: of the lid.
    Source: Stull, An Introduction to Boundary Layer Meteorology (1988), on inversions that part a wind from
    still air and carry waves; heights and sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch, p = self.rng(1901), self.setting.batch, self.p
        seconds = int(self.setting.duration_s) + 3
        self.lid = p.waves_m * ou_series(rng, (batch, seconds), 1.0, p.waves_s)
        self.lid += rng.uniform(-4.0, 6.0, (batch, 1))
        self.blows = rng.choice([-1.0, 1.0]) * p.wind_mps

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.climbed = s.climbed + dt * np.maximum(view.speed, 0.0) * view.grade
        second = index(view, self.lid)
        later = self.lid[:, min(second + 1, self.lid.shape[1] - 1)]
        lid = self.lid[:, second] + (view.time - second) * (later - self.lid[:, second])
        above = 1.0 / (1.0 + np.exp(np.clip((lid - s.climbed) / p.thick_m, -30.0, 30.0)))
        wind = self.blows * (p.below + (1.0 - p.below) * above)
        against = np.clip(1.0 - self.setting.direction * wind / np.maximum(view.speed, 3.0), -1.0, 2.5)
        return -(against * np.abs(against) - 1.0) * view.drag_force * np.clip(view.speed / 3.0, 0.0, 1.0)


@law(
    "h_oncoming_trucks_sweep_it_off",
    needs="highway",
    name="drafting",
    accepts="drag_area headwind",
    leader=True,
)
@sizes(most=(0.8, 0.97), reach_m=(90.0, 180.0), every_s=(7.0, 18.0), takes=(0.6, 0.95), back_m=(0.8, 1.8))
class OncomingTrucksSweepItOff(Hidden, wake=1.0, saved=0.0):
    """`wake`: of a leader's wake that is whole. Trucks come towards both on the other lane, and each carries
    most of the wake off, the more the larger it is. The leader draws a new one, which has come back to the
    follower by the time that he has driven the gap between them. most: of the drag, saved right behind him;
    takes: of the wake, at most; back_m: gaps that he drives until the wake is back.
    Source: Baker, The Flow around High Speed Trains, J. Wind Eng. Ind. Aerodyn. 98 (2010), on gusts of what
    passes, and Hucho, Aerodynamics of Road Vehicles (1998), on wakes; sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(1902), self.setting.batch
        samples = int(self.setting.duration_s / SAMPLE_S) + 8
        comes = rng.random((batch, samples)) < SAMPLE_S / self.p.every_s
        self.size = comes * rng.uniform(0.3, 1.0, (batch, samples))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gap = np.clip(self.gap(view), 3.0, 1e4)
        sweeps = p.takes * self.size[:, index(view, self.size, SAMPLE_S)] / SAMPLE_S
        back = np.maximum(view.speed, 0.0) / (p.back_m * gap)
        s.wake = np.clip(s.wake + dt * (back * (1.0 - s.wake) - 2.0 * sweeps * s.wake), 0.0, 1.0)
        s.saved = eased(s.saved, p.most * s.wake / (1.0 + (gap / p.reach_m) ** 2), 0.5, dt)
        return s.saved * view.drag_force * moving(view)


@law("h_vanes_turn_in_the_wind", needs="hills highway suburban", name="drag_area", accepts="headwind")
@sizes(more=(1.7, 2.8), carries=(0.3, 0.5), turns_s=(8.0, 20.0), starts_mps=(9.0, 14.0), runs_s=(15.0, 50.0))
class VanesTurnInTheWind(Hidden, rim=0.0):
    """`rim` m/s of vanes on the roof, which air a load by turning in the wind of driving. Standing, they hold
    the wind like a cup, and turning with it they hold little. Rust holds them until the wind is fast enough,
    and once they turn they run on for long. more: of the drag, standing vanes; carries: of the wind's speed,
    that the rim reaches; turns_s: at 20 m/s.
    Source: Hoerner, Fluid-Dynamic Drag (1965), on cups and turbines by their ratio of speeds, and Savonius,
    The S-Rotor and Its Applications, Mechanical Engineering 53 (1931); sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"rim": self.rng(1903).uniform(0.0, 12.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wind = np.maximum(view.speed, 0.0)
        loose = np.where((wind > p.starts_mps) | (s.rim > 1.0), 1.0, 0.0)
        lags = p.carries * wind - s.rim
        gains = np.where(lags > 0.0, lags * wind / (20.0 * p.turns_s), lags / p.runs_s)
        s.rim = np.maximum(s.rim + dt * (loose * gains - 0.1 * np.minimum(s.rim, 1.0)), 0.0)
        slips = np.clip(1.0 - s.rim / np.maximum(wind, 1.0), 0.0, 1.0)
        return -p.more * slips**2 * view.drag_force * moving(view)
