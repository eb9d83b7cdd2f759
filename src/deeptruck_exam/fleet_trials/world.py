"""The world of the fifth forms: fleets' trucks of all ages, swelling hills, a pass, people who pause."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from deeptruck_exam import drivers, routes
from deeptruck_exam.fleet_trials.harness import Harness, record
from deeptruck_exam.fleet_trials.traffic import speed_profile
from deeptruck_exam.hidden import Array, ou_series
from deeptruck_exam.makers import World
from deeptruck_model import trucks as pool

LOADS = {"freightliner": (0.85, 1.9), "trucksim": (0.6, 1.75), "volvo": (0.48, 1.45)}  # empty, full
AGES = {  # relative change from a new truck to an old one
    "rolling_resistance": 0.25,
    "drag_area": 0.15,
    "friction_constant": 0.4,
    "friction_quadratic": 0.3,
    "driveline_efficiency": -0.02,
    "boost_lag": 0.8,
    "brake_lag": 0.5,
    "brake_lag_rear": 0.5,
    "shift_time": 0.5,
    "indicated_efficiency": -0.05,
}
SCATTER = {  # logarithmic, of trucks of one age
    "drag_area": 0.10,
    "rolling_resistance": 0.10,
    "wheel_radius": 0.02,
    "wheel_inertia": 0.15,
    "engine_inertia": 0.15,
    "full_load_gain": 0.07,
    "accessory_power": 0.35,
    "final_drive": 0.05,
    "front_brake_torque": 0.08,
    "rear_brake_torque": 0.08,
    "brake_heat_capacity": 0.10,
    "engine_brake_torque": 0.08,
    "boost_lag": 0.15,
    "shift_time": 0.12,
    "shift_ramp": 0.15,
}


def draw_parameters(name: str, rng: np.random.Generator) -> dict[str, float]:
    """Overrides of a truck of some age, more often nearly empty or nearly full than half full."""
    reference = pool.load(name).parameters()
    age = rng.beta(1.3, 1.3)
    low, high = LOADS[name]
    factors = {part: 1.0 + age * change - 0.4 * change for part, change in AGES.items()}
    for part, spread in SCATTER.items():
        factors[part] = factors.get(part, 1.0) * np.exp(spread * np.clip(rng.standard_normal(), -2.0, 2.0))
    factors["mass"] = (low + (high - low) * rng.beta(0.7, 0.7)) * rng.uniform(0.98, 1.02)
    values = {part: float(f"{reference[part] * factor:.5g}") for part, factor in factors.items()}
    cold, height = rng.uniform(-14.0, 32.0), rng.gamma(1.2, 350.0)
    values["ambient_temperature"] = float(np.round(cold, 1))
    density = 1.225 * np.exp(-min(height, 1800.0) / 8400.0) * 288.0 / (273.0 + cold)
    values["air_density"] = float(f"{density:.4g}")
    values["brake_controller_mass"] = values["mass"]
    return values


def swell(rng: np.random.Generator, long_m: float, damping: float) -> Array:
    """Unit-variance swelling of a land along a road: a damped oscillator that noise keeps going, of the
    second order in the way (Åström, Introduction to Stochastic Control Theory, 1970)."""
    n, spare = round(routes.LENGTH_M / routes.STEP_M), 1500
    omega = 2.0 * np.pi / long_m * routes.STEP_M
    radius = np.exp(-damping * omega)
    poles = [1.0, -2.0 * radius * np.cos(omega * np.sqrt(1.0 - damping**2)), radius**2]
    out = lfilter([1.0], poles, rng.standard_normal(n + spare))[spare:]
    smooth = np.convolve(out, np.hanning(15) / np.hanning(15).sum(), mode="same")
    return np.asarray(smooth / smooth.std())


def draw_profile(rng: np.random.Generator, amplitude: float) -> Array:
    """Grade of a road over two swells of the land, of which diggers took the steepest."""
    both = swell(rng, rng.uniform(1800.0, 4200.0), 0.35) + 0.6 * swell(rng, rng.uniform(500.0, 1100.0), 0.25)
    limit = 2.0 * amplitude
    return np.clip(limit * np.tanh(amplitude * both / both.std() / limit), -0.075, 0.075)


def draw_pass(rng: np.random.Generator) -> Array:
    """Grade of a way down, driven forwards: 4 to 7 %, flatter in the hairpins."""
    grade = -rng.uniform(0.050, 0.060) + 0.009 * swell(rng, rng.uniform(900.0, 1800.0), 0.4)
    metres = np.arange(len(grade)) * routes.STEP_M
    for bend in np.cumsum(rng.gamma(3.0, 190.0, 140) + 150.0):
        grade = grade + 0.028 * np.exp(-(((metres - bend) / 28.0) ** 2))
    return np.clip(grade, -0.078, -0.012)


def draw_roads(
    rng: np.random.Generator,
    scenarios: list[str],
    flat: bool,
    profile: Callable[[np.random.Generator, float], Array] = draw_profile,
    way_down: Callable[[np.random.Generator], Array] = draw_pass,
) -> routes.Roads:
    """A road or two for each kind of drive; half of the drives on all but the pass go the other way."""
    grades: list[Array] = []
    rows: dict[str, list[int]] = {}
    for kind in sorted(set(scenarios)):
        rows[kind] = []
        for _ in range(1 + (scenarios.count(kind) > 3)):
            rows[kind].append(len(grades))
            level = routes.AMPLITUDE[kind] * rng.uniform(0.8, 1.05) + 1e-9
            grades.append(way_down(rng) if kind == "descent" else profile(rng, level))
    route = np.array([rng.choice(rows[kind]) for kind in scenarios])
    back = (rng.random(len(scenarios)) < 0.5) & np.array([kind != "descent" for kind in scenarios])
    start = rng.uniform(8500.0, 11500.0, len(scenarios)) + np.where(back, 5200.0, 0.0)
    return routes.Roads(
        np.stack(grades) * (0.0 if flat else 1.0),
        route,
        start,
        np.where(back, -1.0, 1.0),
        np.zeros(len(scenarios)),
    )


@dataclass
class Pausing(drivers.Driver):
    """People who let the truck fall back to the lower edge of what they like, pull up to the upper edge,
    coast in between (pulse and glide), and for moments do nothing at all. Machines: as in the older world,
    but with the patience of an economy mode."""

    def __post_init__(self) -> None:
        super().__post_init__()
        batch, n = self.target.shape
        rng = self.rng
        self.upper, self.lower = rng.uniform(0.1, 0.6, batch), rng.uniform(0.3, 1.1, batch)  # m/s
        self.ahead_s: Array = np.asarray(rng.uniform(1.5, 3.5, batch))
        self.gain: Array = np.asarray(rng.uniform(0.15, 0.30, batch))  # 1/s
        self.pulls = np.ones(batch, bool)
        self.glider = np.asarray(rng.random(batch) < 0.5)
        rests = ou_series(rng, (batch, n), self.dt, 2.5) > rng.uniform(1.0, 2.2, (batch, 1))
        often = rng.uniform(1.0, 3.0, (batch, 1)) * self.dt
        self.looks = ((rng.random((batch, n)) < often) & ~rests) | ~self.human[:, None]
        self.moods = 0.035 * ou_series(rng, (batch, n), self.dt, 4.0)

    def act(self, k: int, speed: Array, gap: Array, ratio: Array, engine_speed: Array, grade: Array) -> Array:
        u = super().act(k, speed, gap, ratio, engine_speed, grade)
        error = self.target[:, k] - speed
        self.pulls = np.where(error > self.lower, True, np.where(error < -self.upper, False, self.pulls))
        glides = self.human & self.glider & ~self.pulls & (speed > 5.0) & (error < self.lower)
        self.pedal = np.where(glides, self.pedal * 0.8, self.pedal)
        u[:, 0] = np.where(glides & (self.pedal < 0.02 * self.truck.full_command), 0.0, self.pedal)
        return u

    def _pedals(self, k: int, speed: Array, ratio: Array, engine_speed: Array, grade: Array) -> Array:
        last = self.target.shape[1] - 1
        later = np.minimum(k + np.rint(self.ahead_s / self.dt).astype(int), last)
        goal = self.target[:, k]
        coming = (self.target[np.arange(len(goal)), later] - goal) / self.ahead_s
        wish = coming + self.gain * (goal - speed) + 0.005 * self.integral
        wish = np.clip(np.nan_to_num(wish), -2.3, 1.2)
        self.wanted = np.where(self.human & self.looks[:, k], wish, self.wanted)
        return super()._pedals(k, speed, ratio, engine_speed, grade)


WORLD = World(draw_parameters, draw_roads, speed_profile, Pausing, Harness.draw, record)
