"""Recorded channels unused by the simulator that predict the slow parts or those that differ by drive.

A channel is a witness if a linear function of it, fitted to the other drives, predicts a drive that was left
out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.json_data import stored
from deeptruck_core.signals import FELT, FELT_SD
from deeptruck_model.mismatch.mechanisms.families import EACH_DRIVE, SLOW
from deeptruck_model.mismatch.posterior.budget import Budget
from deeptruck_model.mismatch.posterior.posterior import SLOW_S
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.prepare.prepared import Prepared
from deeptruck_model.mismatch.residual.forced import Grid
from deeptruck_model.mismatch.rules import Limits

Array = NDArray[np.float64]

LEAST_DRIVES = {EACH_DRIVE: Limits.witness_drives, SLOW: Limits.witness_drives_slow}


@dataclass(frozen=True)
class Witness:
    """A channel, the part of the budget that it explains, and the share of that part's variance that it
    predicts on left-out drives."""

    channel: str
    part: str
    share: float = field(metadata=stored(digits=3))


def witnesses(search: Regression, prepared: Sequence[Prepared], found: Budget) -> tuple[Witness, ...]:
    """The channels that predict a constant per drive or a slow drift, best first, if that part has a share of
    at least `rules.witness`."""
    e, rules = search.e, search.rules
    taken = {"speed", "acceleration", FELT, FELT_SD}
    for p in prepared:
        taken |= {*p.recording.interface.u, *p.recording.interface.w}
    names = {n for p in prepared for n, x in p.recording.channels.items() if np.isfinite(x).any()} - taken
    block = max(1, round(e.dt / prepared[0].dt))
    grid = Grid(prepared, [s.held_out for s in e.drives], block)
    out = []
    for part in (EACH_DRIVE, SLOW):
        force = found.force(part, e.residual)
        if found.share(part) < rules.witness:
            continue
        for name in sorted(names):
            x = grid.stack(
                [p.recording.channels.get(name, np.full(len(p.recording), np.nan)) for p in prepared]
            )
            share = _predicted(search, force, x, part)
            if share > rules.witness:
                out.append(Witness(name, part, share))
    return tuple(sorted(out, key=lambda w: -w.share))


def _predicted(search: Regression, force: Array, x: Array, part: str) -> float:
    """Share of the variance of a force's means (n,) that a linear function of a channel (n,) predicts,
    each drive by a fit to the others; zero where too few drives have the channel."""
    e, used = search.e, np.zeros(len(search.e), dtype=bool)
    used[search.rows] = True
    means, owner = [], []
    for i, s in enumerate(e.drives):
        length = s.stop - s.start if part == EACH_DRIVE else max(1, round(SLOW_S / e.dt))
        for begin in range(s.start, s.stop - length + 1, max(length, 1)):
            rows = np.arange(begin, begin + length)
            rows = rows[used[rows] & np.isfinite(x[rows])]
            if len(rows) >= Limits.witness_known * length:
                means.append((float(x[rows].mean()), float(force[rows].mean())))
                owner.append(i)
    drives = np.unique(owner)
    if len(drives) < LEAST_DRIVES[part]:
        return 0.0
    a, b, of = *np.array(means).T, np.array(owner)
    error = np.zeros(len(b))
    for i in drives:
        here, there = of == i, of != i
        spread = float(np.var(a[there]))
        if spread <= 0.0:
            return 0.0
        slope = float(np.mean((a[there] - a[there].mean()) * (b[there] - b[there].mean()))) / spread
        error[here] = b[here] - b[there].mean() - slope * (a[here] - a[there].mean())
    total = float(np.sum((b - b.mean()) ** 2))
    return 1.0 - float(np.sum(error**2)) / total if total > 0.0 else 0.0
