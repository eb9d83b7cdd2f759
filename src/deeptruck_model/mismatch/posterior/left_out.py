"""What acts at a time of its own, shown by blocks of the same drives that were left out of its fit.

No other drive has the same gust, load or stuck valve. So every second block of a drive is predicted by a fit
to the others, without the cause and with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.fit_result import Interval
from deeptruck_model.mismatch.mechanisms import CandidateTerm, is_time_varying
from deeptruck_model.mismatch.posterior.search import Model, Search
from deeptruck_model.mismatch.residual.evidence import Evidence

Array = NDArray[np.float64]

BLOCK_S = 5.0  # shorter than knots are apart; longer than the noise remembers
PARTS = 2  # of the blocks, each left out in turn
FEWEST = 4  # blocks in which a cause acts, below which nothing is said
ACTS = 1e-6  # m/s^2: less is nothing
BOOTSTRAPS, SEED = 1000, 0


@dataclass(frozen=True)
class LeftOut:
    """Errors of the acceleration, rms in m/s^2, in `blocks` of `block_s` that were left out and in which a
    cause acts: `without` it and `with_it`; `ci95` is the interval of the relative improvement."""

    block_s: float
    blocks: int
    without: float
    with_it: float
    ci95: Interval

    @property
    def shown(self) -> bool:
        """Whether the cause surely predicts what it has not seen."""
        return self.ci95[0] > 0.0

    def __str__(self) -> str:
        return (
            f". In blocks of {self.block_s:.0f} s left out of the same drives the error of the acceleration "
            f"is {self.with_it:.3f} m/s^2 with it and {self.without:.3f} without"
        )

    def to_json(self) -> dict[str, Any]:
        """`left_out_blocks` of an entry of `findings`."""
        errors = {"without": round(self.without, 4), "with_it": round(self.with_it, 4)}
        return vars(self) | errors | {"ci95": tuple(round(x, 3) for x in self.ci95)}

    @staticmethod
    def read(entry: Mapping[str, Any] | None) -> LeftOut | None:
        """From verdict.json; None where a finding has none."""
        if entry is None:
            return None
        low, high = entry["ci95"]
        return LeftOut(**{**entry, "ci95": (low, high)})


def of_its_time(term: CandidateTerm) -> bool:
    """Whether other drives cannot show a term: it acts in windows, or varies in time."""
    return term.variant.acts_in_windows or is_time_varying(term)


def left_out(e: Evidence, model: Model, term: CandidateTerm) -> LeftOut | None:
    """What blocks left out of the fitted drives say of a term of a model; None where it acts in too few."""
    others = tuple(t for t in model.named if t is not term)
    block = (e.record * 10_000 + np.floor(e["elapsed"] / BLOCK_S)).astype(int)
    errors = np.full((2, len(e)), np.nan)
    for part in range(PARTS):
        away = block % PARTS == part
        search = Search(e, only=~away)
        for k, named in enumerate((others, model.named)):
            predicted = search.prediction(search.model(named, model.free))
            errors[k, away] = (e.residual - predicted)[away]
    acting = e.valid & (np.abs(term.columns).max(axis=1) > ACTS) & np.isfinite(errors).all(axis=0)
    place, counts = np.unique(block[acting], return_inverse=True, return_counts=True)[1:]
    if len(counts) < FEWEST:
        return None
    squares = np.zeros((2, len(counts)))
    np.add.at(squares.T, place, errors[:, acting].T ** 2)
    without, with_it = np.sqrt(squares.sum(axis=1) / counts.sum())
    return LeftOut(BLOCK_S, len(counts), float(without), float(with_it), _interval(squares))


def _interval(squares: Array) -> Interval:
    """95 % interval of 1 - rms with / rms without, over resampled blocks."""
    rng = np.random.default_rng(SEED)
    n = squares.shape[1]
    sums = squares[:, rng.integers(0, n, (BOOTSTRAPS, n))].sum(axis=2)  # (2, bootstraps)
    gained = 1.0 - np.sqrt(sums[1] / np.maximum(sums[0], ACTS**2))
    low, high = np.quantile(gained, [0.025, 0.975])
    return float(low), float(high)


__all__ = ["LeftOut", "left_out", "of_its_time"]
