"""What an ideal observer could tell from the evidence of a case: the ruler of the mismatch tool.

The true force of a case is one more block of the tool's own posterior, with the prior odds of a mechanism. A
case is attainable where the most probable set with that force in the place of its name is `AHEAD` times the
evidence temperature, in log evidence, before the most probable set of names without it. In the company of the
same other blocks the force, its name's kernels and the best rival are then compared: the share of the true
force's gain that its name has is what the name's laws hold.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.arrays import Array
from deeptruck_exam.cases.build import DT
from deeptruck_model.mismatch.posterior.kernels import Kernel
from deeptruck_model.mismatch.posterior.names import Compared
from deeptruck_model.mismatch.posterior.posterior import NO_NAME, Posterior
from deeptruck_model.mismatch.posterior.sampler import OUT, SIZES, Reduced, State, most_probable
from deeptruck_model.mismatch.residual.evidence import Grid

AHEAD = 3.0  # evidence temperatures
TRUE = "the true force"
LEAST = 1e-3  # m/s^2, rms of a force that is one


@dataclass(frozen=True)
class Ideal:
    """What the evidence of one case holds. `ahead`: log probability of the best set with the true force over
    the best set that has neither it nor its name; `tool_ahead` the same of the tool's own best set. Gains
    (nats) beside the same other blocks: of the force, of its `name`'s kernels, of the best `rival`."""

    ahead: float
    tool_ahead: float
    force_nats: float
    name_nats: float
    rival_nats: float
    rival: str

    @property
    def attainable(self) -> bool:
        """Whether the data show the true force."""
        return self.ahead >= AHEAD

    @property
    def held(self) -> float:
        """The share of the true force's gain that its name's laws hold."""
        return self.name_nats / self.force_nats


def with_events(c: Compared) -> Posterior:
    """The posterior over all rows of the fitted drives, those of events too, without new draws."""
    p, e = c.posterior, c.fitted
    regression = copy(p.regression)
    regression.e, regression.series = (
        e,
        replace(p.regression.series, y=np.where(e.valid, e.residual, 0.0), valid=e.valid),
    )
    regression.rows = np.flatnonzero(regression.series.usable())
    return replace(
        p, regression=regression, noise=replace(p.noise, innovations=np.nan_to_num(p.noise.innovations))
    )


def true_force(c: Compared, extra: Mapping[str, Array]) -> Array:
    """The acceleration (n,) that the hidden effects caused in the rows of a comparison, from that at every
    `DT` of each recording, m/s^2."""
    drives, e = c.drives, c.posterior.regression.e
    grid = Grid(drives.prepared, drives.held_out, round(e.dt / drives.prepared[0].dt))
    parts = []
    for p in drives.prepared:
        force = extra[p.recording.name]
        parts.append(np.interp(p.recording.time - p.recording.start_s, np.arange(len(force)) * DT, force))
    return grid.stack(parts)


def ideal(p: Posterior, force: Array, name: str, accepted: Collection[str] = ()) -> Ideal | None:
    """Compare with the true force (n,), m/s^2, of `name`, for which names in `accepted` may be said too. None
    if there is no force."""
    if float(np.sqrt(np.mean(force[p.regression.rows] ** 2))) < LEAST:
        return None
    r = p.beside([Kernel(TRUE, force[:, None])])
    unit = p.regression.rules.evidence_temperature
    names = [*(k.name for k in p.of), TRUE]
    own = np.array([n == name for n in names])
    right = np.array([n == name or n in accepted for n in names])
    true = len(names) - 1

    def best(out: NDArray[np.bool_]) -> tuple[State, float]:
        return most_probable(r, unit, np.where(out, -np.inf, r.log_odds))

    is_true = np.arange(len(names)) == true
    alone = [OUT] * len(names)
    alone[true] = int(np.argmax(r.table(tuple(alone))[true]))
    start = tuple(alone)
    with_force, worth = most_probable(r, unit, np.where(own, -np.inf, r.log_odds), start)
    worth += float(r.evidence(start) / unit + r.log_odds[true] - np.log(len(SIZES)))
    other, of_other = best(own)
    if of_other > worth and other[true] != OUT:
        with_force, worth = other, of_other
    _, without = best(right | is_true)
    _, of_tool = best(is_true)
    company = tuple(OUT if j == true else s for j, s in enumerate(with_force))
    table = np.where(np.isfinite(gains := r.table(company)), gains, -np.inf).max(axis=1)
    named = np.array([n not in NO_NAME for n in names])
    rivals = np.where(named & ~right & ~is_true, table, -np.inf)
    rival = int(np.argmax(rivals))
    return Ideal(
        ahead=worth - without,
        tool_ahead=of_tool - without,
        force_nats=float(table[true]),
        name_nats=_together(r, company, unit, np.where(own, r.log_odds, -np.inf)),
        rival_nats=float(rivals[rival]),
        rival=names[rival],
    )


def _together(r: Reduced, company: State, unit: float, odds: Array) -> float:
    """The gain (nats) of the best set of a name's blocks beside others."""
    state, _ = most_probable(r, unit, np.where(np.isfinite(odds), 0.0, -np.inf), company)
    return r.evidence(state) - r.evidence(company)
