"""The paper's driving-cycle generator (section "Driving cycles for data collection"), and a drive along it.

Equations as printed, with what the text leaves open:

- N(mu_T) has no spread in the paper; it is read as a normal of mean mu_T and standard deviation `sigma_T`, s.
- The acceleration is drawn anew at every step, its statistics at the T_i.
- The soft limit v_f = m / (1 + exp((m - v_max) / 2)) is applied recursively, as printed. At 10 Hz it then
  takes 0.7 % of the speed at every step at 25 m/s, and few samples lie above 20 m/s. `soft_limit_speed` is
  the v_max of that equation alone: equal to v_max it is the printed form; the default, 15 m/s above, loses
  0.06 % a step at v_max and reaches the paper's 0 to 35 m/s.
- The road is a random walk over distance, reflected at the limits and smoothed by a moving average.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import ceil, exp
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_model import calls
from deeptruck_model.recordings import Recording
from deeptruck_model.trucks import PhysicsTruck
from deeptruck_model.trucks.compiled import entry
from deeptruck_model.trucks.driver import BRAKE, COAST, EPISODE, LOGGED, drive_along

COASTING_S = (8.0, 40.0)  # length of a coasting episode
BRAKING_LEVELS = (0.08, 1.0)  # share of full braking
LONGEST_STOP_S = 120.0  # of a braking episode that does not come to rest, as down a steep slope


@dataclass(frozen=True, kw_only=True)
class SpeedSettings:
    """Tuning parameters of the speed profile; SI."""

    v_min: float = 0.0
    v_max: float = 35.0
    mu_a_scaling: float = 0.7
    """Multiplies the mean acceleration."""
    sigma_a_scaling: float = 5.0
    """Multiplies the standard deviation of the white acceleration, before the moving average."""
    mu_T: float = 140.0  # noqa: N815 the paper's symbol
    """Mean of the time between samples of the acceleration statistics, s."""
    sigma_T: float = 40.0  # noqa: N815
    """Its standard deviation, s."""
    window: float = 3.0
    """Length of the moving average, s."""
    soft_limit_speed: float | None = None
    """v_max of the soft limit alone; None is v_max + 15 m/s, v_max itself is the printed form."""


@dataclass(frozen=True, kw_only=True)
class RoadSettings:
    """Random walk of the road's slope over distance."""

    limit: float = 0.03
    """Largest slope, rise over run."""
    step: float = 0.0015
    """Standard deviation of one step of the walk."""
    spacing: float = 10.0
    """Distance of the steps, m."""
    window: float = 200.0
    """Length of the moving average, m."""


@dataclass(frozen=True, kw_only=True)
class CycleSettings:
    """A whole driving cycle. Shares are of the time; the remainder follows the speed profile."""

    speed: SpeedSettings = field(default_factory=SpeedSettings)
    road: RoadSettings = field(default_factory=RoadSettings)
    coasting_share: float = 0.10
    """Episodes with both commands at zero, of 8 to 40 s."""
    braking_share: float = 0.08
    """Episodes of one brake command down to standstill, reckoned at 20 s each."""
    engine_brake_share: float = 0.2
    """Share of the time (in phases of minutes) in which the driver has the engine brake on."""


YARD = CycleSettings(
    speed=SpeedSettings(v_max=18.0, mu_a_scaling=0.9, mu_T=60.0, sigma_T=20.0, soft_limit_speed=30.0),
    road=RoadSettings(limit=0.0),
    braking_share=0.05,
)
"""The paper's Freightliner field run: 0 to 18 m/s on a flat test track (16 min)."""

FREEWAY = CycleSettings(
    speed=SpeedSettings(v_min=20.0, v_max=32.0, mu_T=80.0, sigma_T=25.0),
    coasting_share=0.03,
    braking_share=0.0,
)
"""The paper's Volvo field run: 20 to 30 m/s on graded freeways (24 min)."""


@entry
def _profile(
    noise: Any, holds: Any, v_min: float, v_max: float, mean_scale: float, sd_scale: float, dt: float, a: Any
) -> None:
    """The unstable stochastic speed controller; fills a (n,) with the unsmoothed acceleration."""
    v_ref = 0.5 * (v_min + v_max)
    v = v_held = v_min + noise[0] % (v_max - v_min)
    t_next, i = 0.0, 0
    for k in range(len(a)):
        if k * dt >= t_next - 1e-9:
            v_held = v
            t_next += ceil(max(holds[i] * (1.0 - abs(1.0 - v_held / v_ref)), dt))
            i += 1
        mean = 1.0 - v_held / v_ref
        sd = v_held / v_ref * (1.0 - v_held / v_max)
        a[k] = mean_scale * mean + sd_scale * sd * noise[k]
        v = max(min(v + a[k] * dt, v_max), v_min)


@entry
def _soft_limit(a: Any, v_start: float, v_min: float, v_max: float, dt: float, v: Any) -> None:
    """Re-integrate the smoothed acceleration through the printed soft limit."""
    v[0] = v_start
    for k in range(1, len(v)):
        m = max(v[k - 1] + a[k] * dt, v_min)
        v[k] = m / (1.0 + exp(0.5 * (m - v_max)))


def _moving_average(x: Array, window: int) -> Array:
    """Causal mean of the last `window` samples, or of those available at the start."""
    total = np.concatenate([[0.0], np.cumsum(x)])
    first = np.maximum(np.arange(1, len(x) + 1) - window, 0)
    stop = np.arange(1, len(x) + 1)
    return np.asarray((total[stop] - total[first]) / (stop - first))


def speed_profile(
    seconds: float,
    *,
    seed: int | np.random.Generator,
    dt: float = 0.1,
    settings: SpeedSettings | None = None,
) -> Array:
    """Target speed, m/s, (seconds / dt,). Raises InputError for invalid settings."""
    settings = settings or SpeedSettings()
    if not 0.0 <= settings.v_min < settings.v_max:
        raise InputError(f"speeds {settings.v_min:g} to {settings.v_max:g} m/s span nothing")
    rng = np.random.default_rng(seed)
    n = _samples(seconds, dt)
    noise = rng.standard_normal(n)
    holds = rng.normal(settings.mu_T, settings.sigma_T, int(seconds) + 2)
    a = np.empty(n)
    _profile(
        noise, holds, settings.v_min, settings.v_max, settings.mu_a_scaling, settings.sigma_a_scaling, dt, a
    )
    limit = settings.v_max + 15.0 if settings.soft_limit_speed is None else settings.soft_limit_speed
    v = np.empty(n)
    smooth = _moving_average(a, max(1, round(settings.window / dt)))
    _soft_limit(smooth, settings.v_min, settings.v_min, limit, dt, v)
    return v


def road_grade(
    length: float, *, seed: int | np.random.Generator, settings: RoadSettings | None = None
) -> Array:
    """Slope (rise over run) at every settings.spacing metres of a road of `length` m."""
    settings = settings or RoadSettings()
    rng = np.random.default_rng(seed)
    n = max(2, int(length / settings.spacing) + 2)
    walk = np.cumsum(rng.normal(0.0, settings.step, n)) + rng.uniform(-settings.limit, settings.limit)
    if settings.limit == 0.0:
        return np.zeros(n)
    span = 2.0 * settings.limit
    reflected = np.abs((walk + settings.limit) % (2.0 * span) - span) - settings.limit
    return _moving_average(reflected, max(1, round(settings.window / settings.spacing)))


def _samples(seconds: float, dt: float) -> int:
    if not 0.0 < dt <= seconds < 1e8:
        raise InputError(f"cannot drive {seconds:g} s at steps of {dt:g} s")
    return round(seconds / dt)


def _episodes(n: int, dt: float, settings: CycleSettings, rng: np.random.Generator) -> NDArray[Any]:
    """Coasting and braking episodes at random instants, in order."""
    rates = {COAST: settings.coasting_share / 24.0, BRAKE: settings.braking_share / 20.0}
    rows = []
    for kind, rate in rates.items():
        for start in rng.integers(0, n, rng.poisson(rate * n * dt)):
            seconds = rng.uniform(*COASTING_S) if kind == COAST else rng.uniform(0.5, 5.0)
            rows.append((float(start), kind, seconds, rng.uniform(*BRAKING_LEVELS)))
    return np.array(sorted(rows), EPISODE)


def drive_episodes(
    truck: PhysicsTruck, count: int, *, seed: int, settings: CycleSettings | None = None
) -> list[Recording]:
    """The paper's direct randomised initialisation: `count` recordings that begin in an episode.

    Coasting and braking alternate. Each recording begins settled at a uniformly random speed of the cycle's
    range, on its own road; coasting ends after 8 to 40 s, braking at standstill. Raises InputError for a
    negative count and for invalid settings.
    """
    settings = settings or CycleSettings()
    if count < 0:
        raise InputError(f"cannot drive {count} episodes")
    rng, dt = np.random.default_rng(seed), truck.dt
    low, high = settings.speed.v_min, settings.speed.v_max
    if not 0.0 <= low < high:
        raise InputError(f"speeds {low:g} to {high:g} m/s span nothing")
    found = []
    for k in range(count):
        kind = (COAST, BRAKE)[k % 2]
        speed, level = rng.uniform(low, high), rng.uniform(*BRAKING_LEVELS)
        seconds = rng.uniform(*COASTING_S) if kind == COAST else LONGEST_STOP_S
        targets = np.full(_samples(seconds, dt), speed)
        road = road_grade(high * seconds + 2000.0, seed=rng, settings=settings.road)
        episode = np.array([(0.0, kind, seconds, level)], EPISODE)
        log = drive_along(truck, targets, np.zeros(len(targets)), episode, road, settings.road.spacing)
        at_rest = np.flatnonzero(log[:, LOGGED.index("speed")] == 0.0)
        stop = at_rest[0] + 1 if len(at_rest) else len(log)
        name = f"{truck.interface.name}-{seed}-{('coasting', 'braking')[k % 2]}-{k}"
        found.append(_recording(truck, log[:stop], name, seed))
    return found


def drive(
    truck: PhysicsTruck,
    *,
    hours: float = 0.0,
    seconds: float = 0.0,
    seed: int,
    settings: CycleSettings | None = None,
    name: str | None = None,
) -> Recording:
    """Drive the truck along a generated cycle for the sum of hours and seconds; one contiguous recording.

    The road's grade acts on the truck whether or not its interface includes it; if it does not, neither grade
    nor elevation is recorded. Elevation is above the drive's lowest point. A truck with forces or command
    filters is simulated step by step, which is slower.
    """
    settings = settings or CycleSettings()
    calls.instance(truck, PhysicsTruck, "truck", "trucks.load('trucksim') makes one")
    hours, seconds = calls.number(hours, "hours", "h"), calls.number(seconds, "seconds", "s")
    total, dt = 3600.0 * hours + seconds, truck.dt
    rng = np.random.default_rng(seed)
    targets = speed_profile(total, seed=rng, dt=dt, settings=settings.speed)
    road = road_grade(float(targets.sum()) * dt * 1.2 + 2000.0, seed=rng, settings=settings.road)
    episodes = _episodes(len(targets), dt, settings, rng)
    phases = rng.random(int(len(targets) * dt / 180.0) + 1) < settings.engine_brake_share  # of three minutes
    engine_brake = np.repeat(phases.astype(float), ceil(180.0 / dt))[: len(targets)]
    log = drive_along(truck, targets, engine_brake, episodes, road, settings.road.spacing)
    return _recording(truck, log, name or f"{truck.interface.name}-{seed}", seed)


def _recording(truck: PhysicsTruck, log: Array, name: str, seed: int) -> Recording:
    """The logged signals that the truck's interface has, as a recording."""
    channels = {c: np.ascontiguousarray(log[:, i]) for i, c in enumerate(LOGGED)}
    channels["elevation"] -= channels["elevation"].min()  # the walk of a long drive leaves the earth's range
    if not truck.interface.grade:
        del channels["grade"], channels["elevation"]
    return Recording(
        name=name,
        dt=truck.dt,
        channels=channels,
        interface=truck.interface,
        notes=(f"driven by deeptruck_model.trucks.driving_cycles, seed {seed}",),
    )
