"""How the force of a law may differ from its form and keep its name.

Its force is bent, begins later, ends earlier, follows slowly, or differs from drive to drive, so that names
are learned by what acts and when, not by one curve.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter

from deeptruck_exam.cases.build import DT
from deeptruck_exam.laws.law import Array

# Chosen, as it is not known how far true laws differ from their forms: wide, but what acts and when stays.
POWER, BEGINS, ENDS = (0.6, 1.7), (0.1, 0.5), (0.4, 0.9)  # exponent; quantiles of the force's own size
SLOW_S, WARM_S = (0.1, 0.8), (20.0, 200.0)  # time constants
SPREAD, GROWTH = 0.4, 0.75  # sds of the logarithm of a size: from drive to drive, and once warm
ACTS = 1e-6  # m/s^2: less is nothing


def distorted(force: Array, rng: np.random.Generator) -> Array:
    """A force along drives (drives, samples), m/s^2, changed in one or two ways; by none that leaves
    nothing."""
    ways = rng.permutation(len(WAYS))[: rng.integers(1, 3)]
    for k in ways:
        changed = WAYS[k](force, rng)
        force = changed if np.any(changed) else force
    return force


def _bent(force: Array, rng: np.random.Generator) -> Array:
    """Its size to a power, as large as before where it is largest."""
    most = max(float(np.abs(force).max()), ACTS)
    power = np.exp(rng.uniform(*np.log(POWER)))
    return np.sign(force) * most * np.abs(force / most) ** power


def _later(force: Array, rng: np.random.Generator) -> Array:
    """Nothing below some size of its own."""
    return np.sign(force) * np.maximum(np.abs(force) - _quantile(force, rng.uniform(*BEGINS)), 0.0)


def _saturated(force: Array, rng: np.random.Generator) -> Array:
    most = _quantile(force, rng.uniform(*ENDS))
    return np.clip(force, -most, most)


def _slower(force: Array, rng: np.random.Generator) -> Array:
    keep = np.exp(-DT / rng.uniform(*SLOW_S))
    out: Array = lfilter([1.0 - keep], [1.0, -keep], force, axis=1)
    return out


def _of_each_drive(force: Array, rng: np.random.Generator) -> Array:
    return force * np.exp(rng.normal(0.0, SPREAD, (len(force), 1)))


def _by_its_work(force: Array, rng: np.random.Generator) -> Array:
    """More, or less, the more it acted before."""
    keep = np.exp(-DT / rng.uniform(*WARM_S))
    heat = lfilter([1.0 - keep], [1.0, -keep], np.abs(force), axis=1)
    most = max(float(heat.max()), ACTS)
    return force * np.exp(rng.normal(0.0, GROWTH) * heat / most)


def _quantile(force: Array, share: float) -> float:
    acting = np.abs(force)[np.abs(force) > ACTS]
    return float(np.quantile(acting, share)) if len(acting) else 0.0


WAYS: tuple[Callable[[Array, np.random.Generator], Array], ...] = (
    _bent,
    _later,
    _saturated,
    _slower,
    _of_each_drive,
    _by_its_work,
)
