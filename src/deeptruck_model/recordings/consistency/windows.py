"""Rates of change and means over windows, by which channels are compared, and what a comparison says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_model.recordings.recording import Recording

WINDOW_S, SLOW_S = 2.0, 10.0  # over which rates of change are taken, those of heights and places
LEAST, LEAST_SLOW = 10, 8  # windows that do not overlap, of WINDOW_S and of SLOW_S
MOVING_M_S, DRIVING_M_S = 1.0, 3.0
CORRELATED, SCALE = 0.7, (0.67, 1.5)
LATEST_S = 5.0  # by which one speed may be later than another


@dataclass(frozen=True)
class Doubt:
    """A contradiction between channels, with the key that settles it; `channel` is the doubtful one, `factor`
    the ratio to the expected value if that is the only error."""

    channel: str
    says: str
    wrong: bool = False
    factor: float = 1.0


def joined(recordings: Sequence[Recording], channel: str) -> Array:
    """The samples of a channel, (n,), of all recordings that have it."""
    found = [r.channels[channel] for r in recordings if channel in r.channels]
    return np.concatenate([np.zeros(0), *found])


def windows(recordings: Sequence[Recording], window_s: float, rising: str, *others: str) -> list[Array]:
    """The rate of change of a channel over non-overlapping windows, and the means of other channels
    in them."""
    out: list[list[Array]] = [[] for _ in range(1 + len(others))]
    for r in recordings:
        k = max(1, round(window_s / r.dt))
        if len(r) <= k or rising not in r.channels:
            continue
        at = np.arange(0, len(r) - k, k)
        x = r.channels[rising]
        out[0].append((x[at + k] - x[at]) / (k * r.dt))
        for part, name in zip(out[1:], others, strict=True):
            values = r.channels.get(name, np.full(len(r), np.nan))
            # what is stamped k + 1 is the mean of the step that ends there
            sums = np.concatenate([[0.0], np.cumsum(np.nan_to_num(values))])
            gaps = np.concatenate([[0], np.cumsum(np.isnan(values))])
            mean = (sums[at + k + 1] - sums[at + 1]) / k
            part.append(np.where(gaps[at + k + 1] > gaps[at + 1], np.nan, mean))
    return [np.concatenate([np.zeros(0), *part]) for part in out]


def late(speed: Array, other: Array, dt: float) -> tuple[float, float, float]:
    """By how much `other` is later than `speed`, s, both (n,) on one clock, and the rms difference before and
    after it is shifted back."""
    count = min(len(speed), len(other))
    most = min(round(LATEST_S / dt), count // 4)

    def rms(shift: int) -> float:
        a, b = speed[max(0, -shift) : count - max(0, shift)], other[max(0, shift) : count - max(0, -shift)]
        both = np.isfinite(a) & np.isfinite(b)
        return float(np.sqrt(np.mean((b - a)[both] ** 2))) if both.any() else np.inf

    best = min(range(-most, most + 1), key=lambda shift: (rms(shift), abs(shift)))
    return best * dt, rms(0), rms(best)
