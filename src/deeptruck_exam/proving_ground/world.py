"""The world of the seventh forms: trucks by the catalogue, laps of a proving ground, trackers of speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deeptruck_exam import drivers, routes
from deeptruck_exam.fleet_trials import world as fleet
from deeptruck_exam.hidden import Array, ou_series
from deeptruck_exam.makers import World
from deeptruck_exam.proving_ground.loggers import draw, record
from deeptruck_exam.proving_ground.traffic import speed_profile
from deeptruck_model import trucks as pool

BALLAST = {  # mass over the reference: unladen, part, reference and full load of a test
    "freightliner": (0.82, 1.15, 1.5, 1.85),
    "trucksim": (0.6, 0.95, 1.35, 1.75),
    "volvo": (0.48, 0.75, 1.1, 1.45),
}
BODIES = {"box": 1.0, "curtain": 1.06, "tank": 0.86, "flat bed": 0.92, "car carrier": 1.2}  # drag area
LABELS = (0.78, 0.88, 1.0, 1.13, 1.28)  # rolling resistance by classes of the tyres' label
RATINGS = (0.88, 0.95, 1.0, 1.07, 1.14)  # full load of one engine family
AXLES = (0.92, 0.96, 1.0, 1.05, 1.11)  # final drives on the list
TREADS = {"new": 1.012, "half worn": 1.0, "worn": 0.984}  # radius of the tyres
BRAKES = (0.9, 1.0, 1.14)
TOLERANCES = {  # logarithmic, of parts off one line
    **dict.fromkeys(("indicated_efficiency", "full_load_gain"), 0.015),
    **dict.fromkeys(("drag_area", "rolling_resistance", "front_brake_torque", "rear_brake_torque"), 0.04),
    **dict.fromkeys(("wheel_inertia", "engine_inertia", "friction_constant", "friction_quadratic"), 0.1),
    **dict.fromkeys(("shift_time", "brake_lag", "brake_lag_rear", "engine_brake_torque"), 0.12),
    **dict.fromkeys(("accessory_power", "boost_lag"), 0.25),
}


def draw_parameters(name: str, rng: np.random.Generator) -> dict[str, float]:
    """Overrides of a truck: one line of each catalogue, tolerances of production, a day's air."""
    reference = pool.load(name).parameters()
    brakes = float(rng.choice(BRAKES))
    factors = {
        "mass": float(rng.choice(BALLAST[name])) * rng.uniform(0.98, 1.02),
        "drag_area": BODIES[str(rng.choice(list(BODIES)))],
        "rolling_resistance": float(rng.choice(LABELS)),
        "full_load_gain": float(rng.choice(RATINGS)),
        "final_drive": float(rng.choice(AXLES)),
        "wheel_radius": TREADS[str(rng.choice(list(TREADS)))] * float(rng.choice([0.96, 1.0, 1.04])),
        "front_brake_torque": brakes,
        "rear_brake_torque": brakes,
        "brake_heat_capacity": brakes,
    }
    for part, spread in TOLERANCES.items():
        factors[part] = factors.get(part, 1.0) * np.exp(spread * np.clip(rng.standard_normal(), -2.0, 2.0))
    values = {part: float(f"{reference[part] * factor:.5g}") for part, factor in factors.items()}
    warm, pressure = rng.uniform(-5.0, 33.0), rng.normal(99000.0, 1500.0)
    values["ambient_temperature"] = float(np.round(warm, 1))
    values["air_density"] = float(f"{pressure / (287.05 * (273.15 + warm)):.4g}")
    values["brake_controller_mass"] = values["mass"]
    return values


def draw_profile(rng: np.random.Generator, amplitude: float) -> Array:
    """Grade of a lap driven again and again: test hills of one slope each with eased feet, up and down."""
    lap = round(rng.uniform(3200.0, 6400.0) / routes.STEP_M)
    profile, at = np.zeros(lap), 0
    while at < lap - 12:
        half = round(rng.uniform(90.0, 420.0) / routes.STEP_M)
        up = float(rng.choice([0.5, 0.8, 1.0, 1.3]))
        down = float(rng.choice([0.5, 0.8, 1.0, 1.3]))
        back = round(half * up / down)
        side = rng.choice([-1.0, 1.0])
        hill = np.concatenate([np.full(half, side * up), np.full(back, -side * down)])[: lap - at]
        profile[at : at + len(hill)] = hill
        at += len(hill) + round(rng.exponential(140.0) / routes.STEP_M)
    ease = np.hanning(11) / np.hanning(11).sum()
    smooth = np.convolve(np.tile(profile, 3), ease, mode="same")[lap : 2 * lap]
    smooth = smooth - smooth.mean() + 0.05 * np.sin(2.0 * np.pi * np.arange(lap) / lap)
    cells = round(routes.LENGTH_M / routes.STEP_M)
    laps = np.tile(smooth, cells // lap + 1)[:cells]
    return np.clip(amplitude * laps / laps.std(), -0.075, 0.075)


def draw_way_down(rng: np.random.Generator) -> Array:
    """Grade of the way down for brake tests, driven forwards: measured slopes and short landings."""
    cells = round(routes.LENGTH_M / routes.STEP_M)
    grade, at = np.empty(cells), 0
    while at < cells:
        end = at + round(rng.uniform(500.0, 1800.0) / routes.STEP_M)
        grade[at:end] = -rng.uniform(0.044, 0.066)
        at = end + round(rng.uniform(40.0, 120.0) / routes.STEP_M)
        grade[end:at] = -0.022
    return np.clip(np.convolve(grade, np.hanning(9) / np.hanning(9).sum(), mode="same"), -0.075, -0.015)


def draw_roads(rng: np.random.Generator, scenarios: list[str], flat: bool) -> routes.Roads:
    """Laid out as in the fifth world, of this world's laps."""
    return fleet.draw_roads(rng, scenarios, flat, draw_profile, draw_way_down)


@dataclass
class Tracking(drivers.Driver):
    """Test drivers follow the aid's line: some by small steps of the pedal that they leave alone while they
    are within a tolerance, some closely and early. Machines are those of the first world."""

    def __post_init__(self) -> None:
        super().__post_init__()
        rng, (batch, n) = self.rng, self.target.shape
        self.steps = np.where(rng.random(batch) < 0.5, rng.uniform(0.03, 0.08, batch), 0.005)
        self.tolerance = np.where(
            self.steps > 0.01, rng.uniform(0.3, 0.7, batch), rng.uniform(0.0, 0.15, batch)
        )
        self.ahead_s = rng.uniform(0.8, 2.2, batch)
        self.gain = rng.uniform(0.2, 0.4, batch)
        often = np.where(self.steps > 0.01, rng.uniform(0.6, 1.5, batch), rng.uniform(2.0, 4.0, batch))
        self.looks = (rng.random((batch, n)) < often[:, None] * self.dt) | ~self.human[:, None]
        self.moods = 0.02 * ou_series(rng, (batch, n), self.dt, 3.0)
        self.notch = np.zeros(batch)

    def act(self, k: int, speed: Array, gap: Array, ratio: Array, engine_speed: Array, grade: Array) -> Array:
        u = super().act(k, speed, gap, ratio, engine_speed, grade)
        step = self.steps * self.truck.full_command
        moves = np.abs(u[:, 0] - self.notch) > 0.75 * step
        self.notch = np.where(
            u[:, 0] <= 0.0, 0.0, np.where(moves, np.rint(u[:, 0] / step) * step, self.notch)
        )
        u[:, 0] = np.clip(np.where(self.human, self.notch, u[:, 0]), 0.0, self.truck.full_command)
        return u

    def _pedals(self, k: int, speed: Array, ratio: Array, engine_speed: Array, grade: Array) -> Array:
        last = self.target.shape[1] - 1
        later = np.minimum(k + np.rint(self.ahead_s / self.dt).astype(int), last)
        goal = self.target[:, k]
        coming = (self.target[np.arange(len(goal)), later] - goal) / self.ahead_s
        error = goal - speed
        outside = np.sign(error) * np.maximum(np.abs(error) - self.tolerance, 0.0)
        wish = np.clip(coming + self.gain * outside + 0.006 * self.integral, -2.4, 1.2)
        wish = np.where((goal < 0.3) & (speed < 3.0), -0.7, wish)  # or idling would creep on
        self.wanted = np.where(self.human & self.looks[:, k], wish, self.wanted)
        return super()._pedals(k, speed, ratio, engine_speed, grade)


WORLD = World(draw_parameters, draw_roads, speed_profile, Tracking, draw, record)
