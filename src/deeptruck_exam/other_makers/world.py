"""The world of the third forms: trucks, roads, traffic, drivers and sensors of another make."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
from scipy.signal import lfilter

from deeptruck_exam import drivers, routes, trucks
from deeptruck_exam.hidden import Array, ou_series
from deeptruck_exam.makers import World
from deeptruck_exam.sensors import KMH, LPH, RPM, Sensors, quantise
from deeptruck_model import trucks as pool

LOADS = {"freightliner": (0.85, 1.1, 1.4), "trucksim": (0.7, 1.0, 1.5), "volvo": (0.6, 0.9, 1.3)}
RAMPS = {  # mean hold s, share of stops, accelerations m/s2, decelerations m/s2
    "highway": (28.0, 0.0, (0.12, 0.35), (0.2, 0.8)),
    "suburban": (13.0, 0.4, (0.4, 0.8), (0.6, 1.6)),
    "hills": (26.0, 0.05, (0.2, 0.55), (0.3, 1.1)),
    "descent": (22.0, 0.03, (0.2, 0.45), (0.4, 1.3)),
}


def draw_parameters(name: str, rng: np.random.Generator) -> dict[str, float]:
    """Overrides of a truck that is empty, half full or full, and else log-normal about the pool's."""
    reference = pool.load(name).parameters()
    values = {}
    for part, (low, high) in trucks.SPREAD.items():
        factor = np.exp(np.clip(rng.standard_normal(), -1.8, 1.8) * np.log(high / low) / 4.0)
        values[part] = float(f"{reference[part] * np.sqrt(low * high) * factor:.5g}")
    load = float(rng.choice(LOADS[name])) * rng.uniform(0.96, 1.04)
    values["mass"] = float(f"{reference['mass'] * load:.5g}")
    values["ambient_temperature"] = float(np.round(rng.normal(11.0, 8.0), 1))
    values["brake_controller_mass"] = values["mass"]
    return values


def draw_profile(rng: np.random.Generator, amplitude: float) -> Array:
    """Grade of a road of straight slopes joined by parabolas (AASHTO, A Policy on Geometric Design of
    Highways and Streets), of standard deviation `amplitude`."""
    ends = np.cumsum(rng.gamma(2.5, 220.0, 600) + 80.0)
    position = np.arange(0.0, routes.LENGTH_M, routes.STEP_M)
    slopes = rng.standard_normal(601)
    slopes = slopes - 0.6 * np.append(0.0, slopes[:-1])  # what goes up comes down
    steps = slopes[np.searchsorted(ends, position)]
    curve = round(rng.uniform(100.0, 220.0) / routes.STEP_M)
    profile = np.convolve(steps, np.ones(curve) / curve, mode="same")
    return np.clip(amplitude * profile / profile.std(), -0.075, 0.075)


def speed_profile(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """Speed of the traffic, (n,) m/s: holds of random length joined by half waves of a cosine."""
    low, high = drivers.PLANS[scenario][0]
    hold_s, stops, rises, falls = RAMPS[scenario]
    speed, out, length = rng.uniform(low, high), [np.empty(0)], 0
    while length < n:
        stop = speed > 0.0 and rng.random() < stops
        new = 0.0 if stop else rng.uniform(low, high)
        rate = rng.uniform(*(rises if new > speed else falls))
        m = max(2, round(1.3 * abs(new - speed) / rate / dt))
        ramp = speed + (new - speed) * 0.5 * (1.0 - np.cos(np.pi * np.arange(m) / m))
        hold = rng.uniform(2.0, 9.0) if stop else 4.0 + rng.exponential(hold_s)
        out += [ramp, np.full(round(hold / dt), new)]
        speed, length = new, length + len(out[-1]) + len(out[-2])
    base = np.concatenate(out)[:n]
    wave = np.convolve(ou_series(rng, (1, n), dt, 7.0)[0], np.hanning(61) / 30.0, mode="same")
    return np.maximum(base + 0.35 * wave * np.clip(base / 8.0, 0.0, 1.0), 0.0)


@dataclass
class Intermittent(drivers.Driver):
    """People who act on events, not twice a second (Gawthrop, Loram, Lakie and Gollee, Intermittent
    Control, Biological Cybernetics 104, 2011): the pedals stay until the wish has moved far enough or has
    waited long. Machines are as in the older world."""

    def __post_init__(self) -> None:
        super().__post_init__()
        batch, n = self.target.shape
        self.looks = np.tile(~self.human[:, None], (1, n))
        self.enough = self.rng.uniform(0.10, 0.30, batch)  # m/s2
        self.waits_s = self.rng.uniform(0.8, 2.5, batch)
        self.gain = self.rng.uniform(0.15, 0.35, batch)  # 1/s
        self.moods = self.rng.uniform(0.015, 0.05, (batch, 1)) * ou_series(self.rng, (batch, n), self.dt, 3.0)
        self.since = np.zeros(batch)

    def _pedals(self, k: int, speed: Array, ratio: Array, engine_speed: Array, grade: Array) -> Array:
        ahead = min(k + round(1.5 / self.dt), self.target.shape[1] - 1)
        error = self.target[:, k] - speed
        wish = (self.target[:, ahead] - self.target[:, k]) / 1.5 + self.gain * error + 0.006 * self.integral
        wish = np.clip(np.nan_to_num(wish), -2.4, 1.2)
        self.since += self.dt
        moved = (np.abs(wish - self.wanted) > self.enough) & (self.since > 0.35)
        now = self.human & (moved | (self.since > self.waits_s))
        self.since = np.where(now, 0.0, self.since)
        self.wanted = np.where(now, wish, self.wanted)
        return super()._pedals(k, speed, ratio, engine_speed, grade)


def record(
    true: dict[str, Array],
    sensors: Sensors | None,
    truck: SimpleNamespace,
    dt: float,
    rng: np.random.Generator,
) -> dict[str, Array]:
    """One recording's channels (n,) as measured: coloured noise, a wandering clock, messages that are
    missed and held. Without sensors as they were. `distance` is never recorded."""
    channels = {name: values.copy() for name, values in true.items() if name != "distance"}
    if sensors is None:
        return channels
    _late(channels, sensors, dt, rng)
    _motion(channels, sensors, dt, rng)
    _machine(channels, sensors, truck, dt, rng)
    for name in ("speed", "acceleration", "fuel_rate", "engine_speed", "engine_torque", "grade"):
        channels[name] = _missed(channels[name], rng)
    return channels


def _late(channels: dict[str, Array], sensors: Sensors, dt: float, rng: np.random.Generator) -> None:
    n = len(channels["speed"])
    clock = np.arange(n) * dt
    late = 2.0 * sensors.jitter_s * ou_series(rng, (1, n), dt, 0.8)[0]
    for name in ("speed", "acceleration", "engine_command", "brake_command", "fuel_rate"):
        channels[name] = np.interp(clock + late, clock, channels[name])


def _motion(channels: dict[str, Array], sensors: Sensors, dt: float, rng: np.random.Generator) -> None:
    n = len(channels["speed"])

    def noise(seconds: float) -> Array:
        return ou_series(rng, (1, n), dt, seconds)[0]

    keep = np.exp(-dt / sensors.speed_lag_s)
    passed = lfilter([1.0 - keep], [1.0, -keep], channels["speed"], zi=[channels["speed"][0] * keep])[0]
    speed = np.where(channels["speed"] > 0.2, passed + sensors.speed_noise * noise(0.25), channels["speed"])
    channels["speed"] = np.maximum(quantise(speed, KMH / 256.0), 0.0)
    shakes = sensors.acceleration_noise * (0.5 + 0.03 * channels["speed"])
    shaken = channels["acceleration"] + shakes * noise(0.12) + sensors.acceleration_bias
    channels["acceleration"] = quantise(shaken, 9.81 / 1024.0)
    slope = channels["grade"] + sensors.grade_noise * noise(4.0) + sensors.grade_bias
    channels["grade"] = quantise(slope, 0.0002)
    channels["elevation"] = quantise(channels["elevation"] + sensors.elevation_noise * noise(30.0), 0.125)


def _machine(
    channels: dict[str, Array], sensors: Sensors, truck: SimpleNamespace, dt: float, rng: np.random.Generator
) -> None:
    n = len(channels["speed"])
    flow = 1.0 + sensors.fuel_noise * ou_series(rng, (1, n), dt, 0.4)[0]
    channels["fuel_rate"] = quantise(np.maximum(channels["fuel_rate"] * flow, 0.0), 0.05 * LPH)
    turns = channels["engine_speed"] + 0.2 * rng.standard_normal(n)
    channels["engine_speed"] = quantise(turns, 0.125 * RPM)
    percent = truck.reference_torque / 100.0
    wanders = sensors.torque_noise * truck.reference_torque * ou_series(rng, (1, n), dt, 1.5)[0]
    channels["engine_torque"] = quantise(channels["engine_torque"] + wanders, percent)
    channels["engine_command"] = quantise(channels["engine_command"], percent / truck.command_scale)
    step = 1.0 / 2048.0 if truck.by_deceleration else 0.4
    channels["brake_command"] = quantise(channels["brake_command"], step)


def _missed(values: Array, rng: np.random.Generator) -> Array:
    """Messages missed, one in 300, in runs of one to three; the last one before is held."""
    n = len(values)
    missed = np.zeros(n, bool)
    for at in np.flatnonzero(rng.random(n) < 1.0 / 600.0):
        missed[at + 1 : at + 1 + rng.integers(1, 4)] = True
    last = np.maximum.accumulate(np.where(missed, 0, np.arange(n)))
    return np.asarray(values[last])


def draw_roads(rng: np.random.Generator, scenarios: list[str], flat: bool) -> routes.Roads:
    """Roads as in the older world, of this world's profiles."""
    return routes.draw_roads(rng, scenarios, flat, draw_profile)


WORLD = World(draw_parameters, draw_roads, speed_profile, Intermittent, Sensors.draw, record)
