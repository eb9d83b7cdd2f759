"""Speeds permitted by traffic, signs and lights: held for a while, joined by ramps, with stops."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_exam.laws.series import ou_series

FASTEST_MPS = 27.5


def profile(rng: np.random.Generator, kind: str, values: Mapping[str, Any], n: int, dt: float) -> Array:
    """Speed (n,) in m/s of one drive; `values` is `speeds` of worlds.yaml."""
    of_kind = values[kind]
    speed, out, length = _allowed(rng, of_kind), [np.empty(0)], 0
    cosine = rng.random() < 0.5
    while length < n:
        stop = speed > 0.0 and rng.random() < of_kind["stops"]
        new = 0.0 if stop else _allowed(rng, of_kind)
        rate = rng.uniform(*of_kind["pull" if new > speed else "slow"])
        m = max(2, round(1.3 * abs(new - speed) / rate / dt))
        share = np.arange(m) / m
        share = 0.5 * (1.0 - np.cos(np.pi * share)) if cosine else share
        hold = rng.uniform(2.0, 9.0) if stop else 4.0 + rng.exponential(of_kind["lasts_s"])
        out += [speed + (new - speed) * share, np.full(round(hold / dt), new)]
        speed, length = new, length + len(out[-1]) + len(out[-2])
    whole = np.concatenate(out)[:n]
    if kind == "descent" and rng.random() < values["snubbed"]:
        whole = _snubbed(rng, whole, dt)
    return _eased(rng, whole, dt, of_kind["floor_mps"])


def _allowed(rng: np.random.Generator, of_kind: Mapping[str, Any]) -> float:
    return float(rng.choice(of_kind["speeds_mps"], p=of_kind["weights"])) * rng.normal(0.99, 0.02)


def _snubbed(rng: np.random.Generator, speed: Array, dt: float) -> Array:
    """Sawtooth below the speed: accelerate to the safe speed, brake by 8 km/h, release."""
    rise, fall, depth = rng.uniform(0.10, 0.25), rng.uniform(0.6, 1.0), rng.uniform(1.4, 2.6)
    period = depth / rise + depth / fall
    phase = (np.arange(len(speed)) * dt + rng.uniform(0.0, period)) % period
    tooth = np.where(phase < depth / fall, fall * phase, depth - rise * (phase - depth / fall))
    return np.asarray(speed - tooth * np.clip(speed / 6.0 - 0.7, 0.0, 1.0))


def _eased(rng: np.random.Generator, speed: Array, dt: float, floor: float) -> Array:
    """The speed with a slow random variation and rounded corners."""
    n = len(speed)
    smooth = np.convolve(ou_series(rng, (1, n), dt, 10.0)[0], np.hanning(61) / 30.0, mode="same")
    speed = speed + 0.4 * smooth * np.clip(speed / 7.0 - 0.4, 0.0, 1.0)
    ease = np.hanning(15) / np.hanning(15).sum()
    return np.asarray(
        np.clip(np.convolve(np.pad(speed, 7, mode="edge"), ease, mode="valid"), floor, FASTEST_MPS)
    )
