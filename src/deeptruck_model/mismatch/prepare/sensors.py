"""Faults of sensors: between speed and accelerometer, and of the unit of speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from deeptruck_core.arrays import Array, Mask
from deeptruck_core.constants import GRAVITY
from deeptruck_core.errors import InputError
from deeptruck_core.signals import ACCELERATION, SPEED
from deeptruck_core.vehicle_kinds import CLUTCH_CLOSED
from deeptruck_model.mismatch.prepare.places import (
    driven_by_positions,
)
from deeptruck_model.mismatch.prepare.prepared import (
    Prepared,
    derivative,
    fed,
    forced,
    noise_of,
    prepare,
)
from deeptruck_model.mismatch.rules import Limits, Rules
from deeptruck_model.recordings import Recording
from deeptruck_model.recordings.consistency import accelerometer
from deeptruck_model.recordings.consistency.agreement import ACCELEROMETERS, SPEEDS, factor_of
from deeptruck_model.recordings.consistency.windows import CORRELATED
from deeptruck_model.simulators import Simulator, forced_run

SHIFTS = 4  # times that the accelerometer is shifted by the lag so far, as a fit is linear in the lag


@dataclass(frozen=True)
class Kinematics:
    """Fit of one drive's accelerometer to the derivative of its speed.

    `slope` and `offset` (m/s^2) map dv/dt to the accelerometer reading, `lag_s` is the delay of the
    accelerometer, each with its standard error; NaN if acceleration was not measured or hardly varied. The
    noise is that of one sample of speed.
    """

    speed_noise: float
    slope: float
    slope_se: float
    offset: float
    offset_se: float
    lag_s: float
    lag_se: float


def compare(speed: Array, accelerometer: Array | None, dt: float) -> Kinematics:
    """Fit accelerometer(t) = slope * dv/dt(t - lag) + offset over smoothed signals."""
    nan = float("nan")
    speed_noise = noise_of(speed)
    if accelerometer is None or np.isfinite(accelerometer).sum() < 50:
        return Kinematics(speed_noise, nan, nan, nan, nan, nan, nan)
    width = max(1.0, 1.0 / dt)
    ok = np.isfinite(accelerometer) & np.isfinite(speed)
    a = gaussian_filter1d(np.where(ok, accelerometer, 0.0), width)
    d = gaussian_filter1d(np.where(ok, derivative(np.where(ok, speed, 0.0), dt), 0.0), width)
    moving = gaussian_filter1d(ok.astype(float), width) > 0.999
    moving &= np.abs(speed) > 0.5
    if moving.sum() < Limits.least_moving or np.std(d[moving]) < 0.02:
        return Kinematics(speed_noise, nan, nan, nan, nan, nan, nan)
    jerk = np.gradient(d, dt)
    slope, offset, lag, se = _errors_in_both(a, d, jerk, moving, width)
    step = lag
    for _ in range(SHIFTS):
        shifted = _sooner(a, lag / dt)
        both = moving & np.isfinite(shifted)
        if both.sum() < Limits.least_moving:
            break
        again = _errors_in_both(shifted, d, jerk, both, width)
        if abs(again[2]) >= abs(step):  # the two are not the same signal
            break
        (slope, offset, step, se), lag = again, lag + again[2]
    return Kinematics(speed_noise, slope, se[0], offset, se[1], lag, se[2])


def _errors_in_both(
    a: Array, d: Array, jerk: Array, use: Mask, width: float
) -> tuple[float, float, float, Array]:
    """Least squares of a on (d, 1, -jerk); the standard errors count one sample per smoothing width."""
    X = np.stack([d, np.ones_like(d), -jerk], axis=1)[use]
    y = a[use]
    b, *_ = np.linalg.lstsq(X, y, rcond=None)
    for _ in range(5):  # events (wheel slip, braking jerks) must not decide
        e = y - X @ b
        w = 1.0 / (1.0 + (e / max(2.0 * np.median(np.abs(e)), 1e-9)) ** 2)
        b = np.linalg.solve((X * w[:, None]).T @ X, (X * w[:, None]).T @ y)
    e = y - X @ b
    covariance = np.linalg.inv((X * w[:, None]).T @ X) * np.average(e**2, weights=w) * 4.0 * width
    se = np.sqrt(np.diag(covariance))
    return float(b[0]), float(b[1]), float(b[2] / max(abs(b[0]), 1e-6)), se


@dataclass(frozen=True)
class SensorFault:
    """A fault of measurement: effect name, its size with standard error and unit, and one sentence. `between`
    are the two compared signals, `equation` their relation, and `channel` the faulty one."""

    effect: str
    value: float
    se: float
    unit: str
    says: str
    equation: str = "accelerometer(t) = slope * dv/dt(t - lag) + offset"
    between: tuple[str, str] = ("speed", "acceleration")
    channel: str = "acceleration"

    @property
    def is_lag(self) -> bool:
        """Whether `value` is the delay of acceleration behind speed, s."""
        return self.unit == "s"

    @property
    def is_scale(self) -> bool:
        """Whether `value` is the ratio of the speed's derivative to the accelerometer reading."""
        return self.unit == "1"

    def elsewhere(self) -> SensorFault | None:
        """The same fault attributed to the other sensor; None for a bias, which the derivative of speed
        cannot have."""
        if not (self.is_lag or (self.is_scale and self.value > 0.0)):
            return None
        (other,) = set(self.between) - {self.channel}
        says = _late(other, self.value) if self.is_lag else _scaled(other, self.value)
        return replace(self, channel=other, says=says)


def acceleration_is_measured(recordings: Sequence[Recording]) -> bool:
    """Whether the acceleration channel comes from a sensor and not from the derivative of speed."""
    for r in recordings:
        a, d = r.channels["acceleration"], derivative(r.channels["speed"], r.dt)
        both = np.isfinite(a) & np.isfinite(d)
        for shifted in (d, np.roll(d, 1), np.roll(d, -1), (d + np.roll(d, -1)) / 2):
            known = both & np.isfinite(shifted)
            if known.sum() > 20 and np.median(np.abs(a - shifted)[known]) < 1e-6:
                return False
    return any(np.isfinite(r.channels["acceleration"]).sum() > 50 for r in recordings)


def sensor_faults(recordings: Sequence[Recording], rules: Rules) -> list[SensorFault]:
    """Faults between speed and accelerometer, pooled over the recordings, without a truck model."""
    found = accelerometer.accelerometer(recordings)
    if found is not None and found.correlation < -CORRELATED:
        says = f"the accelerometer has the wrong sign: {found.slope:.2f} times the derivative of speed"
        turned = [
            replace(r, channels={**r.channels, "acceleration": -r.channels["acceleration"]})
            for r in recordings
        ]
        sign = SensorFault("acceleration_bias", -1.0, 0.0, "1", says)
        return [sign, *sensor_faults(turned, rules)]
    if found is not None and abs(found.gravity) > accelerometer.HAS_GRAVITY:
        says = (
            f"acceleration has gravity in it, {GRAVITY * found.gravity:.2f} m/s^2 times the slope of the "
            f"road, and {found.offset:+.3f} m/s^2 whatever happens: a tilt of "
            f"{accelerometer.degrees_of_tilt(found.offset):.1f} degrees"
        )
        felt = SensorFault("acceleration_bias", found.offset, 0.0, "m/s^2", says)
        level = []
        for r in recordings:  # without gravity on slopes; NaN where no grade is known
            grade = r.channels.get("grade", np.full(len(r), np.nan))
            gravity = found.offset + found.gravity * GRAVITY * np.sin(np.arctan(grade))
            channels = {**r.channels, "acceleration": r.channels["acceleration"] - gravity}
            level.append(replace(r, channels=channels))
        return [felt, *(f for f in sensor_faults(level, rules) if f.effect != felt.effect)]
    seen = [compare(r.channels["speed"], r.channels["acceleration"], r.dt) for r in recordings]
    seen = [k for k in seen if np.isfinite(k.slope)]
    if not seen:
        return []
    offset, offset_se = _pool([k.offset for k in seen], [k.offset_se for k in seen])
    slope, slope_se = _pool([k.slope for k in seen], [k.slope_se for k in seen])
    lag, lag_se = _pool([k.lag_s for k in seen], [k.lag_se for k in seen])
    faults = []
    if abs(offset) > rules.accelerometer_bias and abs(offset) > rules.sensor_sd * offset_se:
        says = f"the accelerometer is {offset:+.3f} m/s^2 off the derivative of speed whatever happens"
        faults.append(SensorFault("acceleration_bias", offset, offset_se, "m/s^2", says))
    if abs(slope - 1) > rules.speed_scale and abs(slope - 1) > rules.sensor_sd * slope_se:
        se, says = slope_se / slope**2, _scaled("speed", 1 / slope)
        faults.append(SensorFault("speed_scale", 1 / slope, se, "1", says, channel="speed"))
    if abs(lag) > rules.clock_offset_s and abs(lag) > rules.sensor_sd * lag_se:
        faults.append(SensorFault("clock_offset", lag, lag_se, "s", _late("acceleration", lag)))
    return faults


def _late(channel: str, lag_s: float) -> str:
    """Sentence that a channel is wrong because acceleration is later than speed by `lag_s`."""
    other = "speed" if channel == "acceleration" else "acceleration"
    side = "later" if (lag_s > 0.0) is (channel == "acceleration") else "earlier"
    return f"{channel} is stamped {abs(lag_s):.2f} s {side} than {other}, which fits the commands better"


def _scaled(channel: str, factor: float) -> str:
    """Sentence that a channel is wrong because speed changes `factor` times as much."""
    fits = f"{'speed' if channel == 'acceleration' else 'acceleration'} fits the commands better"
    taken = factor_of(factor, SPEEDS | ACCELEROMETERS)
    why = f"{taken} is off by as much: check the units in COLUMNS.yaml" if taken else fits
    return f"speed changes {factor:.3f} times as much as the accelerometer says: {why}"


def corrected(r: Recording, faults: Sequence[SensorFault]) -> Recording:
    """The recording with the sensor faults removed, so that they are not attributed to physics.

    An accelerometer offset needs no correction (see `observed_acceleration`).
    """
    channels = dict(r.channels)
    for fault in faults:
        x = channels[fault.channel]
        if fault.is_lag:
            late_s = fault.value if fault.channel == "acceleration" else -fault.value
            channels[fault.channel] = _sooner(x, late_s / r.dt)
        elif fault.is_scale:
            channels[fault.channel] = x / fault.value if fault.channel == "speed" else x * fault.value
    return replace(r, channels=channels)


def _sooner(x: Array, samples: float) -> Array:
    """x (n,) shifted earlier by `samples`; NaN where unknown."""
    at = np.arange(len(x), dtype=float)
    return np.interp(at + samples, at, x, left=np.nan, right=np.nan)


def _pool(values: Sequence[float], errors: Sequence[float]) -> tuple[float, float]:
    """Weighted mean over recordings; its error is at least the scatter between recordings."""
    v, w = np.array(values), 1.0 / np.maximum(np.array(errors), 1e-6) ** 2
    mean = float(np.average(v, weights=w))
    spread = (
        float(np.sqrt(np.average((v - mean) ** 2, weights=w) / max(len(v) - 1, 1))) if len(v) > 1 else 0.0
    )
    return mean, max(float(1.0 / np.sqrt(w.sum())), spread)


def by_commands(
    simulator: Simulator, drives: Sequence[Recording], faults: Sequence[SensorFault]
) -> list[SensorFault]:
    """The faults; a lag or scale between speed and acceleration is attributed to the sensor whose correction
    reduces the residual more, because the two sensors alone do not show which is wrong."""
    chosen = list(faults)
    for i, fault in enumerate(faults):
        if (other := fault.elsewhere()) is not None:
            flipped = [*chosen[:i], other, *chosen[i + 1 :]]
            own, others = _misfits(simulator, drives, (chosen, flipped))
            chosen = flipped if others < own else chosen
    return chosen


def _misfits(
    simulator: Simulator, drives: Sequence[Recording], each: Sequence[Sequence[SensorFault]]
) -> list[float]:
    """Sum of squared residuals in rows valid in all variants, for the drives corrected by each list of
    faults."""
    prepared = [corrected_drives(simulator, drives, faults, measured=True) for faults in each]
    rows = np.all([np.concatenate([p.valid for p in one]) for one in prepared], axis=0)
    out = []
    for one in prepared:
        runs = forced(simulator, one, [p.u for p in one])
        off = [p.observed - run.y[0, :, ACCELERATION] for p, run in zip(one, runs, strict=True)]
        out.append(float(np.sum(np.concatenate(off)[rows] ** 2)))
    return out


def corrected_drives(
    simulator: Simulator, drives: Sequence[Recording], faults: Sequence[SensorFault], measured: bool
) -> list[Prepared]:
    return [prepare(corrected(r, faults), measured, simulator.interface) for r in drives]


GEARS_AT_MOST = 2.0  # a simulator may drive a gear or two apart, which is no unit
NEAR, MOSTLY = 0.01, 0.6  # so near its median, relative, so often: a converter that slips has no one ratio
SAME = 0.5  # gears are whole
FEWEST = 5  # pieces of road that give a scale: one alone may be all bends
BETWEEN, BY_PLACE = ("speed", "engine_speed"), ("speed", "latitude")
PLACED = "speed is {scale:.3f} times what positions give: it is scaled"
SCALED = (
    "speed is {scale:.3f} times what engine speed gives in the simulator's gears: it is scaled, or tyres and "
    "axles are not the simulator's"
)


def check_speed_unit(simulator: Simulator, prepared: Sequence[Prepared]) -> None:
    """Raises InputError if speed and engine speed of the first drive that has both differ by the factor of a
    unit. Other factors are inconclusive, because tyres and axles differ."""
    first = next((p for p in prepared if "engine_speed" in p.recording.channels), None)
    ratios = np.zeros(0) if first is None else _ratios(simulator, first)
    if first is None or not len(ratios):
        return
    scale = float(np.median(ratios))
    if 1.0 / GEARS_AT_MOST < scale < GEARS_AT_MOST:
        return
    if unit := factor_of(scale, SPEEDS):
        raise InputError(
            f"speed of '{first.recording.name}' is {scale:.3g} times what its engine speed gives by the "
            f"simulator's gear; {unit} is off by as much: check the units in COLUMNS.yaml"
        )


def speed_scale_faults(simulator: Simulator, prepared: Sequence[Prepared], rules: Rules) -> list[SensorFault]:
    """A scale fault of speed that no accelerometer reading could confirm; empty if there is none or it cannot
    be checked. Positions check it for any truck; without them engine speed does, if the simulator has the
    truck's tyres and axles."""
    if any(p.measured_acceleration for p in prepared):
        return []
    ratios = [driven_by_positions(p) for p in prepared]
    by_place = _common_factor(ratios) if sum(map(len, ratios)) >= FEWEST else None
    if by_place is not None:
        return _beyond(by_place, rules, PLACED, "speed = k * speed by positions", BY_PLACE)
    by_engine = _common_factor([_ratios(simulator, p, same_gear=True) for p in prepared])
    return _beyond(by_engine, rules, SCALED, "speed = k * speed by engine", BETWEEN)


def _common_factor(drives: Sequence[Array]) -> tuple[float, float] | None:
    """The common factor of the ratios of all drives, each (m,), and its standard error; None if there is
    none."""
    drives = [x for x in drives if len(x)]
    if not drives:
        return None
    ratios = np.concatenate(drives)
    scale = float(np.median(ratios))
    if np.mean(np.abs(ratios / scale - 1.0) < NEAR) < MOSTLY or not 1 / GEARS_AT_MOST < scale < GEARS_AT_MOST:
        return None
    spread = float(np.median(np.abs(ratios - scale)))
    se = max(spread, float(np.std([np.median(x) for x in drives]))) / float(np.sqrt(len(drives)))
    return scale, se


def _beyond(
    found: tuple[float, float] | None, rules: Rules, says: str, equation: str, between: tuple[str, str]
) -> list[SensorFault]:
    if found is None or abs(found[0] - 1.0) <= rules.speed_scale:
        return []
    scale, se = found
    return [SensorFault("speed_scale", scale, se, "1", says.format(scale=scale), equation, between, "speed")]


def _ratios(simulator: Simulator, p: Prepared, same_gear: bool = False) -> Array:
    """Ratios of simulated to recorded engine speed (m,) while the truck moves in the `same_gear`; empty if
    the simulator or the recording lacks a channel."""
    recorded, gear = (p.recording.channels.get(name) for name in ("engine_speed", "gear"))
    if recorded is None:
        return np.zeros(0)
    inside = forced_run(simulator, p.u[None], p.w[None], fed(simulator, p.y)[None]).inside
    if "engine_speed" not in inside:
        return np.zeros(0)
    use = p.valid & (p.y[:, SPEED] > CLUTCH_CLOSED) & (recorded > 0.0)
    if same_gear and gear is not None and "gear" in inside:
        use &= np.abs(gear - inside["gear"][0]) < SAME
    out: Array = inside["engine_speed"][0][use] / recorded[use]
    return out
