"""The world of the fourth forms: vocations of trucks, passes and river valleys, other habits at the wheel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deeptruck_exam import drivers, routes
from deeptruck_exam.field_reports.instruments import Instruments, record
from deeptruck_exam.field_reports.traffic import speed_profile
from deeptruck_exam.hidden import Array, ou_series
from deeptruck_exam.makers import World
from deeptruck_model import trucks as pool

# factors on the pool's parameters: mass, drag area, rolling resistance, full load, axle ratio, shift speeds
VOCATIONS = {
    "freightliner": (
        (0.95, 0.9, 1.0, 1.0, 1.0, 1.0),
        (1.5, 1.25, 1.1, 1.05, 1.1, 1.05),
        (1.9, 1.35, 1.2, 0.9, 1.2, 1.1),
    ),
    "trucksim": (
        (0.65, 0.8, 0.95, 0.85, 0.95, 1.0),
        (1.25, 1.1, 0.85, 1.1, 0.85, 0.93),
        (1.7, 1.2, 1.25, 1.2, 1.15, 1.05),
    ),
    "volvo": (
        (0.5, 1.1, 1.05, 0.9, 1.0, 1.0),
        (1.1, 0.85, 0.85, 1.0, 0.8, 0.93),
        (1.45, 1.15, 1.15, 1.15, 1.2, 1.0),
    ),
}
SHIFT_SPEEDS = ("upshift_low", "upshift_high", "downshift_low", "downshift_high")
OTHERS = {  # factor ranges, each truck's own
    "wheel_radius": (0.92, 1.04),
    "wheel_inertia": (0.7, 1.4),
    "engine_inertia": (0.7, 1.4),
    "friction_constant": (0.75, 1.35),
    "friction_quadratic": (0.75, 1.35),
    "accessory_power": (0.5, 2.0),
    "boost_lag": (0.5, 1.5),
    "indicated_efficiency": (0.94, 1.04),
    "driveline_efficiency": (0.975, 1.02),
    "shift_time": (0.6, 1.4),
    "shift_ramp": (0.7, 1.5),
    "front_brake_torque": (0.85, 1.3),
    "rear_brake_torque": (0.8, 1.2),
    "brake_lag": (0.7, 1.6),
    "brake_lag_rear": (0.7, 1.6),
    "brake_heat_capacity": (0.8, 1.3),
}


def draw_parameters(name: str, rng: np.random.Generator) -> dict[str, float]:
    """Overrides of a truck that was specified for a vocation: body, engine rating and axle go together."""
    reference = pool.load(name).parameters()
    chosen = np.array(VOCATIONS[name][rng.integers(3)])
    mass, drag, rolling, torque, axle, shifts = chosen * rng.uniform(0.95, 1.05, 6)
    factors = {part: rng.triangular(low, 1.0, high) for part, (low, high) in OTHERS.items()}
    factors |= {"mass": mass, "drag_area": drag, "rolling_resistance": rolling}
    factors |= {"full_load_gain": torque, "final_drive": axle}
    factors |= dict.fromkeys(SHIFT_SPEEDS, np.clip(shifts, 0.9, 1.1))
    values = {part: float(f"{reference[part] * factor:.5g}") for part, factor in factors.items()}
    warm, height = rng.triangular(-12.0, 14.0, 34.0), rng.choice([100.0, 500.0, 1400.0])
    values["ambient_temperature"] = float(np.round(warm, 1))
    density = 1.225 * np.exp(-height / 8500.0) * 288.0 / (273.0 + warm)
    values["air_density"] = float(f"{density:.4g}")
    values["brake_controller_mass"] = values["mass"]
    return values


def draw_profile(rng: np.random.Generator, amplitude: float) -> Array:
    """Grade of a road through hills of fractal heights (Voss, Fractals in Nature, 1988: spectrum with the
    power -2.4 to -3.2 of the wave number down to earthworks of some hundred metres), smoothed and limited
    by a designer."""
    n = round(routes.LENGTH_M / routes.STEP_M)
    wave = np.fft.rfftfreq(n, routes.STEP_M)
    size = np.where(wave > 1.0 / 9000.0, np.maximum(wave, 1e-9) ** -rng.uniform(1.2, 1.6), 0.0)
    height = size * np.exp(2j * np.pi * rng.random(len(wave))) * np.exp(-((wave * 230.0) ** 2))
    slope = np.fft.irfft(2j * np.pi * wave * height, n)
    limit = 2.2 * amplitude
    return np.clip(limit * np.tanh(amplitude * slope / slope.std() / limit), -0.075, 0.075)


def draw_pass(rng: np.random.Generator) -> Array:
    """Grade of a way down from a pass, driven forwards: ramps of 4 to 8 % between flatter bends."""
    n = round(routes.LENGTH_M / routes.STEP_M)
    ends = np.cumsum(rng.uniform(250.0, 1100.0, 400))
    ramps = rng.uniform(-0.075, -0.042, 401)
    ramps[rng.random(401) < 0.15] = -0.028
    steps = ramps[np.searchsorted(ends, np.arange(n) * routes.STEP_M)]
    return np.convolve(steps, np.hanning(17) / np.hanning(17).sum(), mode="same")


def draw_roads(rng: np.random.Generator, scenarios: list[str], flat: bool) -> routes.Roads:
    """One road for a kind of drive, two where five or more drives share it; two in five are driven back."""
    kinds = sorted(set(scenarios))
    grades: list[Array] = []
    rows: dict[str, range] = {}
    for kind in kinds:
        rows[kind] = range(len(grades), len(grades) + (2 if scenarios.count(kind) > 4 else 1))
        for _ in rows[kind]:
            level = routes.AMPLITUDE[kind] * rng.uniform(0.8, 1.15)
            grades.append(draw_pass(rng) if kind == "descent" else draw_profile(rng, level))
    route = np.array([rng.choice(rows[kind]) for kind in scenarios])
    start = rng.uniform(9000.0, 12500.0, len(scenarios))
    down = np.array([kind == "descent" for kind in scenarios])
    direction = np.where((rng.random(len(scenarios)) < 0.4) & ~down, -1.0, 1.0)
    start = np.where(direction < 0.0, start + 5000.0, start)
    return routes.Roads(
        np.stack(grades) * (0.0 if flat else 1.0), route, start, direction, np.zeros(len(scenarios))
    )


@dataclass
class Habitual(drivers.Driver):
    """People who are content within a band, look further ahead the faster they drive, lift early and let
    roll, and move their foot by notches. Machines are as in the older world, but see the road ahead of
    them."""

    def __post_init__(self) -> None:
        super().__post_init__()
        batch, n = self.target.shape
        self.band = self.rng.uniform(0.25, 0.9, batch)  # m/s
        self.ahead_s = self.rng.uniform(1.2, 2.8, batch)
        self.notch = self.rng.uniform(0.02, 0.05, batch) * self.truck.full_command
        self.gain = self.rng.uniform(0.18, 0.32, batch)  # 1/s
        self.foot = np.zeros(batch)
        often = self.rng.uniform(0.8, 2.0, (batch, 1))  # 1/s
        self.looks = self.rng.random((batch, n)) < np.where(self.human[:, None], often * self.dt, 1.0)
        self.moods = 0.04 * ou_series(self.rng, (batch, n), self.dt, 6.0)

    def act(self, k: int, speed: Array, gap: Array, ratio: Array, engine_speed: Array, grade: Array) -> Array:
        u = super().act(k, speed, gap, ratio, engine_speed, grade)
        moved = np.abs(u[:, 0] - self.foot) > self.notch
        closed = (u[:, 0] <= 0.0) | self.braking
        self.foot = np.where(closed, 0.0, np.where(moved | ~self.human, u[:, 0], self.foot))
        return np.stack([self.foot, u[:, 1]], axis=1)

    def _pedals(self, k: int, speed: Array, ratio: Array, engine_speed: Array, grade: Array) -> Array:
        last = self.target.shape[1] - 1
        later = np.minimum(k + np.rint(self.ahead_s / self.dt).astype(int), last)
        goal = self.target[:, k]
        coming = (self.target[np.arange(len(goal)), later] - goal) / self.ahead_s
        error = goal - speed
        outside = np.sign(error) * np.maximum(np.abs(error) - self.band, 0.0)
        wish = coming + self.gain * outside + 0.05 * error + 0.004 * self.integral
        wish = np.clip(np.nan_to_num(wish), -2.4, 1.2)
        self.wanted = np.where(self.human & self.looks[:, k], wish, self.wanted)
        return super()._pedals(k, speed, ratio, engine_speed, grade)


WORLD = World(draw_parameters, draw_roads, speed_profile, Habitual, Instruments.draw, record)
