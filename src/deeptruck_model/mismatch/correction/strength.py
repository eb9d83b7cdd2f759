"""The size of a force where it is largest."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from deeptruck_core.json_data import stored
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Limits

SMOOTH_S = 1.0


def visible(e: Evidence) -> NDArray[np.bool_]:
    """Rows (n,) that are compared and in which the truck moves."""
    out: NDArray[np.bool_] = e.valid & (np.abs(e["speed"]) > Limits.standing_m_s)
    return out


def acts(force: NDArray[np.float64], seen: NDArray[np.bool_], dt: float) -> NDArray[np.bool_]:
    """Rows in which a force (n,), m/s^2, acts, among the rows that are `seen`, `dt` s apart: its 1 s mean
    exceeds 35 % of its 99 % quantile, and sensor noise."""
    smooth = np.abs(uniform_filter1d(force, max(1, round(SMOOTH_S / dt))))
    if not seen.any() or smooth[seen].max() < 1e-6:
        return np.zeros(len(force), dtype=bool)
    level = 0.35 * float(np.quantile(smooth[seen], 0.99))
    out: NDArray[np.bool_] = seen & (
        smooth > max(level, min(Limits.notable, 0.5 * float(smooth[seen].max())))
    )
    return out


@dataclass(frozen=True)
class Strength:
    """The mean of a force in `unit` where it is largest, or its rms if its sign alternates."""

    value: float = field(metadata=stored(figures=4))
    unit: str
    one_way: bool
    share_of_time: float = field(metadata=stored(digits=3))


def strength(e: Evidence, force: NDArray[np.float64]) -> Strength:
    """The strength of a force (n,), m/s^2, where it is largest."""
    on = acts(force, visible(e), e.dt)
    part = e.newtons(force)[on] / e.mass * e.unit.scale if on.any() else np.zeros(1)
    one_way = bool(abs(part.mean()) > 0.5 * np.abs(part).mean())
    value = float(part.mean() if one_way else np.sqrt(np.mean(part**2)))
    return Strength(value, e.unit.name, one_way, float(on.sum() / max(e.valid.sum(), 1)))
