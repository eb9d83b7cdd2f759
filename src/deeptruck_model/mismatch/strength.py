"""Size of a force while it acts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from deeptruck_model.mismatch.residual.evidence import Evidence

SMOOTH_S = 1.0
NOTABLE = 0.02  # m/s^2: the noise of ordinary sensors over a second
STANDING_M_S = 0.1  # slower, a truck may stand: a force has no visible effect there


def visible(e: Evidence) -> NDArray[np.bool_]:
    """Rows (n,) that are compared and in which the truck moves."""
    out: NDArray[np.bool_] = e.valid & (np.abs(e["speed"]) > STANDING_M_S)
    return out


def acts(force: NDArray[np.float64], seen: NDArray[np.bool_], dt: float) -> NDArray[np.bool_]:
    """Where a force (n,), m/s^2, acts among the rows that are `seen`, a period of `dt` s apart: where its
    1 s mean exceeds 35 % of its 99 % quantile, and sensor noise."""
    smooth = np.abs(uniform_filter1d(force, max(1, round(SMOOTH_S / dt))))
    if not seen.any() or smooth[seen].max() < 1e-6:
        return np.zeros(len(force), dtype=bool)
    level = 0.35 * float(np.quantile(smooth[seen], 0.99))
    out: NDArray[np.bool_] = seen & (smooth > max(level, min(NOTABLE, 0.5 * float(smooth[seen].max()))))
    return out


@dataclass(frozen=True)
class Strength:
    """The mean of a force in `unit` while it acts, or its rms where it goes forward and back."""

    value: float
    unit: str
    one_way: bool
    share_of_time: float

    def to_json(self) -> dict[str, Any]:
        """`strength` of an entry of `findings`."""
        rounded = {"value": float(f"{self.value:.4g}"), "share_of_time": round(self.share_of_time, 3)}
        return vars(self) | rounded

    @staticmethod
    def read(entry: Mapping[str, Any] | None) -> Strength | None:
        """From verdict.json; None where a finding has none."""
        return None if entry is None else Strength(**entry)
