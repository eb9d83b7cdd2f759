"""Error budget: splits the squared free-run speed error into parts that add up to one.

The parts are those of the posterior. Their mean forces, which a correction removes, are integrated over
windows as in a free run. The interval of a share lies between the 5 % and 95 % quantiles of the draws. The
budget holds for the drives it was fitted to.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from deeptruck_core.arrays import Array, Indices, Mask
from deeptruck_core.json_data import stored
from deeptruck_model.mismatch.mechanisms.families import FAMILY, HIDDEN, LEFT_OVER, SENSORS, UNKNOWN
from deeptruck_model.mismatch.posterior.posterior import Posterior
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.noise import TAIL
from deeptruck_model.mismatch.rules import Limits


@dataclass(frozen=True)
class DriveShare:
    """The share of a part in the squared speed error of one drive."""

    recording: str
    share: float = field(metadata=stored(digits=4))


@dataclass(frozen=True)
class Part:
    """A part of the squared speed error: its `share` with a 90 % interval, the share of compared time in
    which its force is notable (1 for the unexplained part), the force (n,), m/s^2, and its share in the error
    of each drive."""

    part: str
    share: float = field(metadata=stored(digits=4))
    low: float = field(metadata=stored(digits=4))
    high: float = field(metadata=stored(digits=4))
    time_share: float = field(metadata=stored(digits=4))
    force: Array = field(default_factory=lambda: np.zeros(0), metadata=stored(hidden=True))
    drives: tuple[DriveShare, ...] = ()


@dataclass(frozen=True)
class Budget:
    """The parts of the squared speed error after up to `horizon_s`, largest first, the unexplained part last.

    `speed_rmse`, m/s, is the root mean square of the residual integrated over the `windows` windows. There
    are no parts if too few windows are free of gaps. `persistent` is the unexplained share in excess of that
    of white noise.
    """

    horizon_s: float
    windows: int
    speed_rmse: float
    parts: tuple[Part, ...]
    persistent: float = field(default=0.0, metadata=stored(digits=4, later=True))

    def share(self, part: str) -> float:
        """The share of a part; zero if it is not in the budget."""
        return next((p.share for p in self.parts if p.part == part), 0.0)

    def ends(self, part: str) -> tuple[float, float] | None:
        """The 90 % interval of the share of a part; None if it is not in the budget."""
        return next(((p.low, p.high) for p in self.parts if p.part == part), None)

    def force(self, part: str, like: Array) -> Array:
        """The force of a part (n,); zero if it is not in the budget."""
        return next((p.force for p in self.parts if p.part == part), np.zeros_like(like))


def budget(p: Posterior, given: Evidence, of: Mask | None = None) -> Budget:
    """Split the simulator's error, as in the evidence `given`, into parts over the fitted rows.

    If the regression used estimated parameters, the change due to them counts in their families. The
    residual in rows in which an unrecorded brake acts is the part HIDDEN. Rows of events count as no error:
    what acts for seconds is not in the budget. Shares are of the mean in the draws `of` (m,), from which the
    forces of findings are too; intervals are of all draws.
    """
    regression, e = p.regression, p.regression.e
    columns, draws, part_of = _columns(p)
    fixed = _estimated(regression, given)
    used = np.zeros(len(e), dtype=bool)
    used[regression.rows] = True
    hidden = np.zeros(len(e), dtype=bool) if given.hidden is None else given.hidden & ~e.held_out
    counted = used | hidden
    braked = np.where(hidden, e.residual, 0.0)
    fixed = {part: np.where(used, force, 0.0) for part, force in fixed.items()} | {HIDDEN: braked}
    residual = np.where(used, given.residual, braked)
    for horizon_s in Limits.horizons_s:
        starts = _starts(regression, counted, round(horizon_s / e.dt))
        if len(starts) >= Limits.least_windows:
            break
    else:
        return Budget(Limits.horizons_s[-1], len(starts), float("nan"), ())
    steps = round(horizon_s / e.dt)
    names = list(dict.fromkeys([*part_of, *fixed]))
    groups = [
        np.array(
            [k for k, part in enumerate(part_of) if part == name]
            + [len(part_of) + k for k, part in enumerate(fixed) if part == name],
            dtype=np.intp,
        )
        for name in names
    ]
    whole = np.nan_to_num(np.column_stack([*columns, *fixed.values(), residual]), copy=False)
    whole[~used, : len(part_of)] = 0.0
    by_drive = {
        i: _products(whole, [k for k in starts if e.record[k] == i], steps, e.dt)
        for i in np.unique(e.record[np.array(starts)])
    }
    products = np.sum(list(by_drive.values()), axis=0)
    rmse = float(np.sqrt(products[-1, -1] / (len(starts) * steps)))
    middle = (draws if of is None else draws[of]).mean(axis=0, keepdims=True)
    (share,) = _shares(middle, groups, products)
    low, high = np.quantile(_shares(draws, groups, products), [0.05, 0.95], axis=0)
    low, high = np.minimum(low, share), np.maximum(high, share)  # of what is in few draws
    drives = {e.drives[i].name: _shares(middle, groups, own)[0] for i, own in by_drive.items()}
    mean = np.concatenate([middle[0], np.ones(len(fixed))])
    of_part = np.zeros((len(mean), len(groups)))
    for i, a in enumerate(groups):
        of_part[a, i] = mean[a]
    forces = [*(whole[:, :-1] @ of_part).T]
    forces.append(residual - np.sum(forces, axis=0))
    names.append(LEFT_OVER)
    parts = [
        Part(
            name,
            float(share[i]),
            float(low[i]),
            float(high[i]),
            float(np.mean(np.abs(forces[i][counted]) > Limits.notable)) if name != LEFT_OVER else 1.0,
            forces[i],
            tuple(DriveShare(drive, float(s[i])) for drive, s in drives.items()),
        )
        for i, name in enumerate(names)
        if share[i] > 0.0 or name == LEFT_OVER
    ]
    parts.sort(key=lambda part: (part.part == LEFT_OVER, -part.share))
    persistent = max(float(share[-1]) - _white(p, starts, steps) / max(float(products[-1, -1]), 1e-12), 0.0)
    return Budget(horizon_s, len(starts), rmse, tuple(parts), persistent)


def _white(p: Posterior, starts: Sequence[int], steps: int) -> float:
    """Expected squared speeds, summed over windows, of integrated white noise with the variance of the
    innovations."""
    variance = TAIL / (TAIL - 2.0) * (p.noise.sigma * p.regression.series.relative * p.regression.e.dt) ** 2
    return float(sum(np.cumsum(variance[k : k + steps]).sum() for k in starts))


def _columns(p: Posterior) -> tuple[list[Array], Array, list[str]]:
    """Blocks of columns (n, k) that are nonzero in any draw, their coefficients (m, k), and the part of each
    column. Those that follow recorded channels without being a mechanism, such as form errors, have no known
    part."""
    b = p.draws.coefficients
    always = p.always.shape[1]
    own: list[Array] = [p.always]
    at = [np.arange(always)]
    parts = [FAMILY[name] for name in p.regression.parameters]
    parts += [SENSORS] * (always - p.form_error - len(parts)) + [UNKNOWN] * p.form_error
    for k, place in zip(p.of, p.at, strict=True):
        part = FAMILY.get(k.name, k.name)
        if np.abs(b[:, place]).max(initial=0.0) > 0.0:
            own.append(k.features)
            at.append(place)
            parts += [part] * len(place)
    return own, b[:, np.concatenate(at)], parts


def _products(columns: Array, starts: Sequence[int], steps: int, dt: float) -> Array:
    """Inner products (k, k) of columns integrated over windows."""
    out = np.zeros((columns.shape[1], columns.shape[1]))
    for k in starts:
        added = np.cumsum(columns[k : k + steps], axis=0) * dt
        out += added.T @ added
    return out


def _shares(draws: Array, groups: Sequence[Indices], products: Array) -> Array:
    """Shares of the squared error (m, parts + 1) for draws (m, k), the unexplained part last, which add up to
    one.

    `products` (K, K) are those of the k drawn columns, of the fixed columns, and of the error. A share is
    each part's marginal contribution averaged over all orders (Shapley's value of a quadratic form), so that
    what two correlated parts explain is divided between them. Negative ones are set to zero and the others
    scaled to what all explain, so that parts that cancel each other count only by their sum.
    """
    one, zero = np.ones((len(draws), len(products) - draws.shape[1] - 1)), np.zeros((len(draws), 1))
    parts = np.hstack([draws, one, zero])
    left = np.hstack([-draws, -one, zero + 1.0])
    squares = max(float(products[-1, -1]), 1e-12)  # of a simulator that is exact
    beside = left @ products
    met = parts * (products[-1] + beside) / squares
    gained = np.maximum(np.stack([met[:, a].sum(axis=1) for a in groups], axis=1), 0.0)
    rest = np.sum(left * beside, axis=1) / squares
    explained, together = 1.0 - rest, gained.sum(axis=1)
    some = (together > 0.0) & (explained > 0.0)
    scale = np.where(some, explained / np.where(some, together, 1.0), 0.0)
    return np.column_stack([gained * scale[:, None], np.where(some, rest, 1.0)])


def _estimated(regression: Regression, given: Evidence) -> dict[str, Array]:
    """The fixed columns (n,), m/s^2, by family: the change of the residual by estimated parameters, including
    their prior means. Its nonlinear part is divided in proportion to the linear parts."""
    e = regression.e
    X, prior = regression.design()
    linear = {p: np.nan_to_num(given.sensitivity[p]) * change for p, change in e.moved.items()}
    total = sum(np.abs(force) for force in linear.values())
    rest = np.nan_to_num(given.residual - e.residual) - sum(linear.values())
    out: dict[str, Array] = {}
    for p, force in linear.items():
        share = np.abs(force) / np.maximum(total, 1e-12)
        out[FAMILY[p]] = out.get(FAMILY[p], 0.0) + force + share * rest
    each = itertools.zip_longest(regression.parameters, np.nan_to_num(X).T * prior.mean[:, None])
    for name, force in each:
        family = FAMILY.get(name, SENSORS)
        out[family] = out.get(family, 0.0) + force
    return out


def _starts(regression: Regression, counted: Mask, steps: int) -> list[int]:
    """First rows of half-overlapping windows that are compared throughout."""
    return [
        k
        for s in regression.e.drives
        if not s.held_out
        for k in range(s.start, s.stop - steps, max(steps // 2, 1))
        if counted[k : k + steps].mean() >= Limits.least_compared
    ]
