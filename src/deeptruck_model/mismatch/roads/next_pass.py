"""Tests how well the force of one pass over a road predicts that of another, ahead of the windows that
matched.

Windows of 6 km locate the road. Their agreement is no evidence, because they were selected for it. The 2 km
ahead were not selected: there the force of the other pass is used as the slope of this pass.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from deeptruck_model._io.json_data import stored
from deeptruck_model.mismatch.roads.windows import STEP_M, WIDTH, Windows, turned
from deeptruck_model.mismatch.rules import Limits

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

SEAM, AHEAD = 5, 20  # steps: a slow force is smoothed over 8 s on either side; and what is predicted
RESAMPLED = 1000


@dataclass(frozen=True)
class NextPass:
    """The result over `km` ahead: the force (rms, m/s^2), what remains of it after subtracting that of the
    other pass, and the 95 % interval of the relative reduction, over recordings (over segments if there are
    fewer than three). A road that two passes share counts once for each."""

    km: float
    rms: float = field(metadata=stored(digits=4))
    left: float = field(metadata=stored(digits=4))
    smaller_ci95: tuple[float, float] = field(metadata=stored(digits=3))

    @property
    def shown(self) -> bool:
        """Whether the 95 % interval of the reduction by the other pass lies above 0."""
        return self.smaller_ci95[0] > 0.0


def next_pass(windows: Windows, here: Indices, there: Indices, reverse: NDArray[np.bool_]) -> NextPass | None:
    """What the pass of windows `there` (k,) predicts ahead of windows `here`, which matched them, in the
    opposite direction if `reverse`. None if hardly any of the roads continues."""
    both: list[tuple[int, Array, Array]] = []
    last = -AHEAD  # segments of one road do not overlap
    for i, j, back in zip(here, there, reverse, strict=True):
        pair = _ahead(windows, i, j, back) if i - last >= AHEAD or not _same(windows, i, last) else None
        if pair is not None:
            both.append((int(windows.profile[i]), *pair))
            last = i
    if len(both) < Limits.least_stretches:
        return None
    owner = np.array([k for k, _, _ in both])
    before, after = (np.array([np.mean(x**2) for x in column]) for column in _columns(both))
    return NextPass(
        round(AHEAD * STEP_M / 1000.0 * len(both), 1),
        float(np.sqrt(before.mean())),
        float(np.sqrt(after.mean())),
        _smaller(before, after, owner),
    )


def _columns(both: list[tuple[int, Array, Array]]) -> tuple[list[Array], list[Array]]:
    return [own for _, own, _ in both], [own - other for _, own, other in both]


def _ahead(w: Windows, i: int, j: int, reverse: bool) -> tuple[Array, Array] | None:
    """The force ahead of window i, and that of the pass of window j in this driving direction, (AHEAD,) each
    minus the mean of its window; None if a profile ends."""
    far = SEAM + AHEAD
    k, m = i + far, j - far if reverse else j + far
    if not (_same(w, i, k) and _same(w, j, m)):
        return None
    own = w.values[k][WIDTH - AHEAD :] - w.values[i].mean()
    other = turned(w.values[m : m + 1])[0] if reverse else w.values[m]
    mean = -w.values[j].mean() if reverse else w.values[j].mean()
    return own, other[WIDTH - AHEAD :] - mean


def _same(w: Windows, i: int, k: int) -> bool:
    """Whether both windows are from one profile."""
    return 0 <= k < len(w.at) and bool(w.profile[i] == w.profile[k])


def _smaller(before: Array, after: Array, owner: Indices) -> tuple[float, float]:
    rng = np.random.default_rng(0)
    names = np.unique(owner)
    if len(names) < 3:
        owner = names = np.arange(len(owner))
    groups = [np.flatnonzero(owner == k) for k in names]
    gains = []
    for _ in range(RESAMPLED):
        rows = np.concatenate([groups[g] for g in rng.integers(0, len(groups), len(groups))])
        gains.append(1.0 - np.sqrt(after[rows].mean() / max(before[rows].mean(), 1e-12)))
    low, high = np.quantile(gains, [0.025, 0.975])
    return float(low), float(high)
