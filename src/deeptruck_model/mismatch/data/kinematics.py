"""Acceleration from speed and accelerometer together, and the faults that show between those two alone.

No truck model enters here, so what this finds is a fault of a sensor and never missing physics.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Kinematics:
    """What speed and accelerometer say of each other in one drive.

    `slope` and `offset` (m/s^2) map dv/dt to the accelerometer, `lag_s` is by how much the accelerometer is
    late, with standard errors; NaN where acceleration was not measured or hardly varied. Noise is that of one
    sample.
    """

    speed_noise: float
    acceleration_noise: float
    slope: float
    slope_se: float
    offset: float
    offset_se: float
    lag_s: float
    lag_se: float


def noise_of(x: Array) -> float:
    """White noise of a smooth signal from its third differences, robust against events."""
    d = np.diff(x[np.isfinite(x)], 3)
    return float(1.4826 * np.median(np.abs(d)) / np.sqrt(20.0)) if len(d) > 8 else 0.0


def derivative(speed: Array, dt: float) -> Array:
    """Mean acceleration over the step that ends at each sample, as a Simulator reports it; first repeated."""
    d = np.diff(speed) / dt
    return np.concatenate([d[:1], d]) if len(d) else np.zeros_like(speed)


def observed_acceleration(speed: Array, accelerometer: Array | None, dt: float) -> Array:
    """Slow part from speed, fast part from the accelerometer.

    What the two differ by is smoothed and added to the accelerometer: a true acceleration passes unchanged,
    and an accelerometer's offset is gone. At the ends it is reflected: to hold its last sample there would be
    to trust one difference of a noisy speed for seconds.
    """
    slow = derivative(speed, dt)
    if accelerometer is None:
        return slow
    ratio = noise_of(speed) / max(noise_of(accelerometer), 1e-6)
    width = float(np.clip(1.5 * ratio, 0.0, 3.0)) / dt
    if width < 0.5:
        return slow
    bad = ~np.isfinite(accelerometer)
    fast = np.where(bad, slow, accelerometer)
    out: Array = fast + gaussian_filter1d(slow - fast, width, mode="reflect")
    return out


def compare(speed: Array, accelerometer: Array | None, dt: float) -> Kinematics:
    """Fit accelerometer(t) = slope * dv/dt(t - lag) + offset over smoothed signals."""
    nan = float("nan")
    speed_noise = noise_of(speed)
    if accelerometer is None or np.isfinite(accelerometer).sum() < 50:
        return Kinematics(speed_noise, nan, nan, nan, nan, nan, nan, nan)
    width = max(1.0, 1.0 / dt)
    ok = np.isfinite(accelerometer) & np.isfinite(speed)
    a = gaussian_filter1d(np.where(ok, accelerometer, 0.0), width)
    d = gaussian_filter1d(np.where(ok, derivative(np.where(ok, speed, 0.0), dt), 0.0), width)
    moving = gaussian_filter1d(ok.astype(float), width) > 0.999
    moving &= np.abs(speed) > 0.5
    base = (speed_noise, noise_of(accelerometer))
    if moving.sum() < 100 or np.std(d[moving]) < 0.02:
        return Kinematics(*base, nan, nan, nan, nan, nan, nan)
    slope, offset, lag, se = _errors_in_both(a, d, np.gradient(d, dt), moving, width)
    return Kinematics(*base, slope, se[0], offset, se[1], lag, se[2])


def _errors_in_both(
    a: Array, d: Array, jerk: Array, use: NDArray[np.bool_], width: float
) -> tuple[float, float, float, Array]:
    """Least squares of a on (d, 1, -jerk); standard errors count one sample per smoothing width."""
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
