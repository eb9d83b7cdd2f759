"""A slow force that no signal predicts: the road's slope, wind, or a gain that drifts.

Over minutes such a force looks like slow noise to any regression, so the search by evidence cannot see it.
It is told from
noise by its size, and its name by what size it would need to have: a slope of 1 % is a road, a wind of 40
m/s is none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from deeptruck_model.mismatch.residual.evidence import GRAVITY, Evidence

Array = NDArray[np.float64]

WIDTH_S = 8.0
NOTABLE = 0.08  # m/s^2 rms; ordinary wind alone gives a light vehicle nearly as much
NOISE = 3.0  # times what white noise would leave after smoothing
LARGEST = {
    "road_grade": 0.07,
    "headwind": 9.0,
    "torque_derate": 0.25,
}  # slope ratio, m/s, share of engine force
LEAST_S = 600.0


@dataclass(frozen=True)
class SlowForce:
    """The force (n,) in m/s^2, 0 where it is not known, its rms, and the size it would need as each possible
    name (see LARGEST for units)."""

    force: Array
    rms: float
    needed: dict[str, float]

    @property
    def possible(self) -> list[str]:
        """Names whose needed size is physically possible, the least remarkable first."""
        fits = [name for name, size in self.needed.items() if size <= LARGEST[name]]
        return sorted(fits, key=lambda name: self.needed[name] / LARGEST[name])


def slow_force(e: Evidence, left: Array, weight: Array, sigma: float, doubt: float = 0.0) -> SlowForce | None:
    """The slow part of `left` (n,), what named mechanisms and signals left over; None where it is small.

    `weight` (n,) is the weight of each sample, `sigma` the sd of one sample's noise, `doubt` the rms of what
    `left` may hold for another reason.
    """
    if e.valid.sum() * e.dt < LEAST_S:
        return None
    centred, known = _slow_part(e, left, weight)
    rms = float(np.sqrt(np.mean(centred[known] ** 2)))
    noise = NOISE * sigma / np.sqrt(2.0 * np.sqrt(np.pi) * WIDTH_S / e.dt)
    if rms < max(float(np.hypot(NOTABLE, doubt)), noise):
        return None
    speed, pull = np.maximum(e["speed"], 3.0), np.maximum(e["engine"], 0.0)
    per_wind = 2.0 * e["drag"] / speed
    needed = {
        "road_grade": rms / GRAVITY,
        "headwind": _size(centred, per_wind, known),
        "torque_derate": _size(centred, pull, known),
    }
    return SlowForce(np.where(known, centred, 0.0), rms, needed)


def _slow_part(e: Evidence, left: Array, weight: Array) -> tuple[Array, NDArray[np.bool_]]:
    """The slow part without its mean, and where it is known, both (n,)."""
    width = WIDTH_S / e.dt
    use = np.where(e.valid, weight, 0.0)
    amount = gaussian_filter1d(use, width)
    smooth = gaussian_filter1d(np.where(e.valid, left, 0.0) * use, width) / np.maximum(amount, 1e-3)
    known = e.valid & (amount > 0.2 * float(np.median(amount[e.valid])))
    return smooth - float(np.mean(smooth[known])), known


def _size(force: Array, per_unit: Array, known: NDArray[np.bool_]) -> float:
    """Rms of the amount of something that acts with `per_unit`, where it acts at all."""
    acting = known & (per_unit > 0.3 * float(np.mean(per_unit[known])))
    if not acting.any():
        return float("inf")
    return float(
        np.sqrt(np.mean(force[acting] ** 2)) / max(float(np.sqrt(np.mean(per_unit[acting] ** 2))), 1e-9)
    )
