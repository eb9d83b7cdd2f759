"""Random series and spells in time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from deeptruck_exam.effects.law import Array


def ou_series(rng: np.random.Generator, shape: tuple[int, int], dt: float, time_constant: float) -> Array:
    """Unit-variance coloured noise along the last axis."""
    keep = np.exp(-dt / time_constant)
    white = rng.standard_normal(shape)
    white[:, 0] /= np.sqrt(1.0 - keep**2)
    return np.asarray(lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], white, axis=-1))


def behind(values: Array, time_constant: float, dt: float) -> Array:
    """First-order lag from rest at the first value."""
    keep = np.exp(-dt / max(time_constant, 1e-3))
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values, zi=[values[0] * keep])[0])


def some_drives(rng: np.random.Generator, batch: int, share: float) -> NDArray[np.bool_]:
    """A share of the recordings, one of the last two (held out) always among them, never all."""
    count = int(np.clip(round(share * batch), 2, batch - 1))
    order = [batch - 1 - int(rng.integers(2)), *rng.permutation(batch - 2).tolist()]
    chosen = np.zeros(batch, bool)
    chosen[order[:count]] = True
    return chosen


def davenport(rng: np.random.Generator, shape: tuple[int, int], dt: float, per_hz: Array) -> Array:
    """Unit-variance series of Davenport's spectrum along the last axis; `per_hz` (batch, 1) is the reduced
    frequency of 1 Hz."""
    hertz = np.fft.rfftfreq(shape[1], dt)[None, 1:]
    reduced = per_hz * hertz
    power = reduced**2 / (1.0 + reduced**2) ** (4.0 / 3.0) / hertz
    lines = np.sqrt(power) * np.exp(2j * np.pi * rng.random(power.shape))
    series = np.fft.irfft(np.concatenate([np.zeros((shape[0], 1)), lines], axis=1), shape[1], axis=1)
    return np.asarray(series / np.maximum(series.std(axis=1, keepdims=True), 1e-9))


SAMPLE_S = 0.25  # of gusts


def arrivals(rng: np.random.Generator, shape: tuple[int, int], mean_s: float, decay_s: float) -> Array:
    """Shot noise of unit mean, samples SAMPLE_S apart: each gust comes at once and dies away."""
    hits = rng.poisson(SAMPLE_S / mean_s, shape) * rng.exponential(1.0, shape)
    hits[:, 0] += decay_s / mean_s  # as if it had blown before
    keep = np.exp(-SAMPLE_S / decay_s)
    return np.asarray(lfilter([1.0], [1.0, -keep], hits, axis=1)) * (1.0 - keep) * mean_s / SAMPLE_S


def spells(
    rng: np.random.Generator, batch: int, on: tuple[float, float], off: tuple[float, float]
) -> tuple[Array, Array]:
    """Starts and ends (batch, 40), s, of spells that come and go; some began before the drive."""
    lengths = np.stack([rng.uniform(*off, (batch, 40)), rng.uniform(*on, (batch, 40))], axis=2)
    edges = np.cumsum(lengths.reshape(batch, 80), axis=1) - rng.uniform(0.0, sum(on), (batch, 1))
    return edges[:, ::2], edges[:, 1::2]


def within(spans: tuple[Array, Array], at: float | Array) -> Array:
    """1 inside one of the spans, else 0; `at` is a time, or a place for each drive."""
    where = np.asarray(at, float).reshape(-1, 1)
    return np.asarray(((spans[0] <= where) & (where < spans[1])).any(axis=1).astype(float))
