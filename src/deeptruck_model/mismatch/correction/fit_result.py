"""The benefit of a correction, which is `fit` of verdict.json: errors of free runs, the intervals of their
improvement, and the strength of forces.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import uniform_filter1d

from deeptruck_core.arrays import Array, Indices, Mask
from deeptruck_core.json_data import HIDDEN, SPARSE, stored
from deeptruck_model.mismatch.folders import AS_GIVEN
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Limits

SMOOTH_S = 1.0

Interval = tuple[float, float]


def visible(e: Evidence) -> Mask:
    """Rows (n,) that are compared and in which the truck moves."""
    out: Mask = e.valid & (np.abs(e["speed"]) > Limits.standing_m_s)
    return out


def acts(force: Array, seen: Mask, dt: float) -> Mask:
    """Rows in which a force (n,), m/s^2, acts, among the rows that are `seen`, `dt` s apart: its 1 s mean
    exceeds 35 % of its 99 % quantile, and sensor noise."""
    smooth = np.abs(uniform_filter1d(force, max(1, round(SMOOTH_S / dt))))
    if not seen.any() or smooth[seen].max() < 1e-6:
        return np.zeros(len(force), dtype=bool)
    level = 0.35 * float(np.quantile(smooth[seen], 0.99))
    out: Mask = seen & (smooth > max(level, min(Limits.notable, 0.5 * float(smooth[seen].max()))))
    return out


@dataclass(frozen=True)
class Strength:
    """The mean of a force in `unit` where it is largest, or its rms if its sign alternates, with its 95 %
    interval if it was drawn."""

    value: float = field(metadata=stored(figures=4))
    unit: str
    one_way: bool
    share_of_time: float = field(metadata=stored(digits=3))
    ci95: Interval | None = field(default=None, metadata=stored(figures=4, sparse=True))


def strength(e: Evidence, force: Array, drawn: Array | None = None) -> Strength:
    """The strength of a force (n,), m/s^2, where it is largest; `drawn` are draws (m,) of its size, in which
    the mean is 1."""
    on = acts(force, visible(e), e.dt)
    part = e.newtons(force)[on] / e.mass * e.unit.scale if on.any() else np.zeros(1)
    one_way = bool(abs(part.mean()) > 0.5 * np.abs(part).mean())
    value = float(part.mean() if one_way else np.sqrt(np.mean(part**2)))
    ends = None
    if drawn is not None:
        low, high = np.sort(value * np.quantile(drawn, [0.025, 0.975]))
        ends = (float(low) if one_way else max(float(low), 0.0), float(high))
    return Strength(value, e.unit.name, one_way, float(on.sum() / max(e.valid.sum(), 1)), ends)


@dataclass(frozen=True)
class Errors:
    """Errors of free runs, (windows, steps), and the recording and sample at which each starts."""

    speed: Array
    acceleration: Array
    recording: Indices
    start: Indices

    def rmse(self) -> Rmse:
        """Root mean square over all windows and steps."""
        speed, acceleration = (float(np.sqrt(np.mean(x**2))) for x in (self.speed, self.acceleration))
        return Rmse(speed, acceleration)

    def of_runs(self) -> Array:
        """Rms speed error of each run, m/s, (windows,)."""
        return np.asarray(np.sqrt(np.mean(self.speed**2, axis=1) + Limits.least_error**2))


@dataclass(frozen=True)
class Rmse:
    """Root mean square errors of speed (m/s) and acceleration (m/s^2) in free runs."""

    speed: float = field(metadata=stored(key="speed_rmse"))
    acceleration: float = field(metadata=stored(key="acceleration_rmse"))


@dataclass(frozen=True)
class FreeRunErrors:
    """Errors in the same free runs of the simulator as given, with all parameters refitted and no effect
    added, and corrected."""

    before: Rmse
    parameters_only: Rmse
    after: Rmse


@dataclass(frozen=True)
class Improvement:
    """95 % intervals of the relative improvement of the speed error, over the given number of recordings."""

    ci95: Interval = field(metadata=stored(key="improvement_ci95"))
    over_parameters_ci95: Interval = field(metadata=stored(key="improvement_over_parameters_ci95"))
    recordings: int = field(metadata=stored(key="improvement_recordings"))


@dataclass(frozen=True)
class Refitted:
    """A parameter in the refit without effects: its relative `change` from the simulator as given with a 95 %
    interval, and its value and interval in `unit` if the simulator states it."""

    change: float = field(metadata=stored(key="relative"))
    change_ci95: Interval = field(metadata=stored(key="relative_ci95"))
    value: float | None = field(default=None, metadata=stored(sparse=True))
    unit: str = field(default="", metadata=stored(sparse=True))
    ci95: Interval | None = field(default=None, metadata=stored(sparse=True))


@dataclass(frozen=True)
class WithoutExogenous:
    """Rms speed error, m/s, of the corrected simulator without `signals`, the signals beyond the protocol
    that it needs, such as a gap; they count as not recorded."""

    signals: tuple[str, ...]
    after: float


@dataclass(frozen=True)
class FitResult:
    """The effect of the correction on `windows` free runs of `horizon_s` on the held-out recordings.

    `errors` and `improvement` are None if no recording is long enough for a free run.
    """

    held_out: tuple[str, ...]
    horizon_s: float
    windows: int
    corrected: tuple[str, ...]  # effects and parameters that the corrected simulator holds
    # relative changes of its parameters
    corrected_parameters: Mapping[str, float] = field(
        default_factory=dict, metadata=stored(key="refitted", sparse=True)
    )
    # their 95 % intervals
    corrected_intervals: Mapping[str, Interval] = field(
        default_factory=dict, metadata=stored(key="refitted_ci95", sparse=True)
    )
    # strengths of the forces that it adds, by the finding's name, or `unknown`, along the fitted drives
    corrected_forces: Mapping[str, Strength] = field(
        default_factory=dict, metadata=stored(key="added", sparse=True)
    )
    # mechanisms whose forms stand for what is added without an accepted name
    forms: tuple[str, ...] = field(default=(), metadata=stored(key="added_forms", sparse=True))
    # the simulator has no parameters: what refits them scales its forces instead
    scales_forces: bool = field(default=False, metadata=SPARSE)
    # None where it needs nothing beyond the protocol
    without_exogenous: WithoutExogenous | None = field(default=None, metadata=SPARSE)
    errors: FreeRunErrors | None = field(default=None, metadata=stored(flat=True))
    improvement: Improvement | None = field(default=None, metadata=stored(flat=True))
    # speed, m/s, that a relative change of 1 of a parameter adds in 40 s at `Limits.high_speed`
    at_high_speed: Mapping[str, float] = field(default_factory=dict, metadata=stored(figures=3, sparse=True))
    refit: Mapping[str, Refitted] = field(
        default_factory=dict, metadata=SPARSE
    )  # all parameters, refitted alone
    tolerance: float = field(default=math.nan, metadata=HIDDEN)  # m/s, up to which a simulator is good enough
    validated: bool = False
    offered: str = AS_GIVEN  # the best along held-out drives; `validated` where that is not the one as given
