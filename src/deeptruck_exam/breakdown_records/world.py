"""The world of the sixth forms: hauliers' trucks by size, flat land with climbs, planners and fidgets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deeptruck_exam import routes, trucks
from deeptruck_exam.breakdown_records.loggers import Logger, record
from deeptruck_exam.breakdown_records.traffic import speed_profile
from deeptruck_exam.fleet_trials import world as fleet
from deeptruck_exam.hidden import Array, ou_series
from deeptruck_exam.makers import World
from deeptruck_model import trucks as pool

LOADS = {"freightliner": (0.8, 1.85), "trucksim": (0.58, 1.8), "volvo": (0.46, 1.5)}  # empty, full
WITH_SIZE = {  # what a truck bought for heavy work has more of: share of the range that its size decides
    "full_load_gain": 0.6,
    "engine_inertia": 0.6,
    "friction_constant": 0.5,
    "front_brake_torque": 0.7,
    "rear_brake_torque": 0.7,
    "brake_heat_capacity": 0.7,
    "wheel_inertia": 0.5,
    "drag_area": 0.4,
    "engine_brake_torque": 0.6,
}


def draw_parameters(name: str, rng: np.random.Generator) -> dict[str, float]:
    """Overrides of a truck: one size behind many of its parts, and a load that is empty, part or full."""
    reference = pool.load(name).parameters()
    size = rng.random()
    values = {}
    for part, (low, high) in trucks.SPREAD.items():
        tied = WITH_SIZE.get(part, 0.0)
        place = tied * size + (1.0 - tied) * rng.beta(2.0, 2.0)
        values[part] = float(f"{reference[part] * (low + (high - low) * place):.5g}")
    empty, full = LOADS[name]
    load = rng.choice([rng.uniform(0.0, 0.12), rng.uniform(0.2, 0.8), rng.uniform(0.85, 1.0)])
    factor = empty + (full - empty) * load * (0.9 + 0.1 * size)
    values["mass"] = float(f"{reference['mass'] * factor:.5g}")
    values["ambient_temperature"] = float(np.round(rng.uniform(-10.0, 34.0), 1))
    values["brake_controller_mass"] = values["mass"]
    return values


def draw_profile(rng: np.random.Generator, amplitude: float) -> Array:
    """Grade of a road that is flat for long, climbs a valley's side or a flyover on one slope with eased
    ends, and comes down again some way on, by another."""
    cells = round(routes.LENGTH_M / routes.STEP_M)
    profile, at = np.zeros(cells + 3000), 0  # the last climb may end beyond
    while at < cells:
        at += round(rng.exponential(280.0) / routes.STEP_M)
        rise = rng.choice([-1.0, 1.0]) * 4.0 * rng.gamma(2.0, 1.5)  # m
        for height in (rise, -rise * rng.uniform(0.7, 1.3)):
            slope = rng.uniform(0.6, 1.4)
            length = max(6, round(abs(height) * 28.0 / slope / routes.STEP_M))
            ramp = np.sin(np.pi * (np.arange(length) + 0.5) / length) ** 0.6
            profile[at : at + length] = np.sign(height) * slope * ramp
            at += length + round(rng.exponential(160.0) / routes.STEP_M)
    smooth = np.convolve(profile[:cells], np.hanning(13) / np.hanning(13).sum(), mode="same")
    return np.clip(amplitude * smooth / smooth.std(), -0.075, 0.075)


def draw_way_down(rng: np.random.Generator) -> Array:
    """Grade of a motorway's way down, driven forwards: one long slope, eased on viaducts."""
    grade = -rng.uniform(0.046, 0.058) + 0.005 * fleet.swell(rng, rng.uniform(1500.0, 3000.0), 0.4)
    metres = np.arange(len(grade)) * routes.STEP_M
    for middle in np.cumsum(rng.exponential(1100.0, 90) + 500.0):
        half = rng.uniform(80.0, 200.0)
        grade = grade + 0.024 / (1.0 + ((metres - middle) / half) ** 6)
    return np.clip(grade, -0.075, -0.015)


def draw_roads(rng: np.random.Generator, scenarios: list[str], flat: bool) -> routes.Roads:
    """Laid out as in the fifth world, of this world's slopes."""
    return fleet.draw_roads(rng, scenarios, flat, draw_profile, draw_way_down)


@dataclass
class Planning(fleet.Pausing):
    """Half of the people plan far ahead and hardly move, half fidget with the pedal and press too hard.
    Cruise controls plan: they let speed sag within a band and begin to slow or pull before they must."""

    def __post_init__(self) -> None:
        super().__post_init__()
        rng, (batch, n) = self.rng, self.target.shape
        nervous = np.asarray(rng.random(batch) < 0.5)
        self.glider[:] = False
        self.ahead_s = np.where(nervous, rng.uniform(0.8, 1.6, batch), rng.uniform(3.0, 5.0, batch))
        self.gain = np.where(nervous, rng.uniform(0.35, 0.55, batch), rng.uniform(0.10, 0.2, batch))
        often = np.where(nervous, rng.uniform(2.5, 5.0, batch), rng.uniform(0.5, 1.2, batch))
        self.looks = (rng.random((batch, n)) < often[:, None] * self.dt) | ~self.human[:, None]
        fast, slow = ou_series(rng, (batch, n), self.dt, 0.7), ou_series(rng, (batch, n), self.dt, 8.0)
        self.moods = np.where(nervous[:, None], 0.07 * fast, 0.02 * slow)
        self.sags = rng.uniform(0.2, 0.8, batch)  # m/s

    def _pedals(self, k: int, speed: Array, ratio: Array, engine_speed: Array, grade: Array) -> Array:
        cruises = self.style == "cruise"
        later = min(k + round(5.0 / self.dt), self.target.shape[1] - 1)
        error = self.target[:, k] - speed
        outside = np.sign(error) * np.maximum(np.abs(error) - self.sags, 0.0)
        coming = (self.target[:, later] - self.target[:, k]) / 5.0
        wish = coming + 0.3 * outside + 0.06 * error + 0.01 * self.integral
        self.wanted = np.where(cruises, np.clip(np.nan_to_num(wish), -2.3, 1.2), self.wanted)
        return super()._pedals(k, speed, ratio, engine_speed, grade)


WORLD = World(draw_parameters, draw_roads, speed_profile, Planning, Logger.draw, record)
