"""The budget of the mismatch: the squared free-run speed error, split into parts that add up to one.

One additive model: the residual is a sum of the families' kernels, of a constant of each drive, of what is
slow in time and of noise. The variance of each is estimated by maximising the marginal likelihood (EM); the
parts are added up over windows as a free run adds them up, for draws of the posterior: a share is their mean,
and its interval their 5 % and 95 % quantiles. It describes the drives that it was fitted to.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from deeptruck_model.mismatch.posterior.kernels import kernels
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.noise import Prior, fit, whiten
from deeptruck_model.mismatch.strength import NOTABLE
from deeptruck_model.mismatch.tree import EACH_DRIVE, FAMILY, HIDDEN, LEFT_OVER, NAMES, PLACE, SLOW

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

HORIZONS_S = (40.0, 20.0, 10.0)
LEAST_WINDOWS = 3
SLOW_S, MOST_KNOTS = 30.0, 240  # spacing of the knots in time; wider where there would be more
PLACE_M, MOST_PLACES = 200.0, 160
TWICE = 0.3  # of the way that is driven again, at least, for a part of its own
DIRECTIONS = 10  # leading directions of a mechanism's kernel
TURNS, STEPS = 3, 25  # of fitting the noise beside the parts, and of EM in each
NO_COLUMNS = Prior(np.zeros(0), np.zeros(0), np.zeros(0))
KNOWN = 0.9  # of a window that must be compared
SWEEPS, DRAWS = 50, 4  # of the sampler, and draws of the coefficients in each
FIRST_SD, PRIOR_SD = 0.02, 0.005  # m/s^2: of a kernel at first; the prior weighs as one coefficient


@dataclass(frozen=True)
class Part:
    """A part of the squared speed error: its `share`, a 90 % interval, the share of the time in which its
    force acts, its force (n,), m/s^2, and its share of each drive's own error by name."""

    part: str
    share: float
    low: float
    high: float
    time_share: float
    force: Array
    drives: tuple[tuple[str, float], ...] = ()

    def to_json(self) -> dict[str, Any]:
        """An entry of `budget.parts`."""
        shares = {name: round(getattr(self, name), 4) for name in ("share", "low", "high", "time_share")}
        drives = [{"recording": name, "share": round(share, 4)} for name, share in self.drives]
        return {"part": self.part, **shares, "drives": drives}

    @staticmethod
    def read(entry: Mapping[str, Any]) -> Part:
        """An entry of `budget.parts` of verdict.json, without its force."""
        shares = {name: entry[name] for name in ("part", "share", "low", "high", "time_share")}
        drives = tuple((d["recording"], d["share"]) for d in entry["drives"])
        return Part(**shares, force=np.zeros(0), drives=drives)


@dataclass(frozen=True)
class Budget:
    """The parts, largest first and what is unexplained last, of the squared speed error after up to
    `horizon_s`, whose root mean is `speed_rmse`, m/s; `windows` of them. No parts where too few windows are
    unbroken."""

    horizon_s: float
    windows: int
    speed_rmse: float
    parts: tuple[Part, ...]

    def to_json(self) -> dict[str, Any]:
        """`budget`."""
        return {
            "horizon_s": self.horizon_s,
            "windows": self.windows,
            "speed_rmse": self.speed_rmse,
            "parts": [p.to_json() for p in self.parts],
        }

    @staticmethod
    def read(entry: Mapping[str, Any]) -> Budget:
        """`budget` of verdict.json."""
        rmse = float("nan") if entry["speed_rmse"] is None else entry["speed_rmse"]
        return Budget(entry["horizon_s"], entry["windows"], rmse, tuple(map(Part.read, entry["parts"])))

    def share(self, part: str) -> float:
        """Of a part; zero where there is none."""
        return next((p.share for p in self.parts if p.part == part), 0.0)

    def force(self, part: str, like: Array) -> Array:
        """Of a part (n,); zero where there is none."""
        return next((p.force for p in self.parts if p.part == part), np.zeros_like(like))


def budget(search: Regression, hidden: Mask, given: Evidence) -> Budget:
    """Split what the simulator as `given` is off by in the rows that are fitted. The search may be about
    refitted parameters: what that changed is a part of their families. `hidden` (n,) are rows in which an
    input acts that was not recorded, and which the search does not compare."""
    blocks = _blocks(search)
    refitted = _refitted(search.e, given)
    F = np.concatenate([features for _, features in blocks], axis=1)
    ends = np.cumsum([features.shape[1] for _, features in blocks])
    of_block = [np.arange(end - f.shape[1], end) for end, (_, f) in zip(ends, blocks, strict=True)]
    draws = _posterior(search, F, of_block)
    mean = draws.mean(axis=0)
    columns_of = {family: np.zeros(0, dtype=np.intp) for family in refitted}
    for (part, _), a in zip(blocks, of_block, strict=True):
        columns_of[part] = np.append(columns_of.get(part, a[:0]), a)
    names, at = list(columns_of), list(columns_of.values())
    e = search.e
    used = np.zeros(len(e), dtype=bool)
    used[search.rows] = True
    F = np.where(used[:, None], F, 0.0)
    refitted = {family: np.where(used, force, 0.0) for family, force in refitted.items()}
    braked = np.where(hidden, e.residual, 0.0)
    residual = np.where(used, e.residual, braked) + sum(refitted.values())
    fixed = [*refitted.values(), braked]  # (n,) each, which are taken as they are
    for horizon_s in HORIZONS_S:
        starts = _starts(search, used | hidden, round(horizon_s / e.dt))
        if len(starts) >= LEAST_WINDOWS:
            break
    else:
        return Budget(HORIZONS_S[-1], len(starts), float("nan"), ())
    steps = round(horizon_s / e.dt)
    columns = np.column_stack([F, *fixed, residual])
    added = np.concatenate([np.cumsum(columns[k : k + steps], axis=0) * e.dt for k in starts])
    products = added.T @ added
    squares = float(products[-1, -1])
    rmse = float(np.sqrt(squares / len(added)))
    families = list(refitted)
    groups = [
        np.append(a, len(mean) + families.index(name)) if name in refitted else a
        for name, a in zip(names, at, strict=True)
    ]
    groups.append(np.array([len(mean) + len(families)]))
    names.append(HIDDEN)
    spread = _shares(draws, groups, products)
    share, (low, high) = spread.mean(axis=0), np.quantile(spread, [0.05, 0.95], axis=0)
    forces = [F[:, a] @ mean[a] + refitted.get(n, 0.0) for n, a in zip(names, at, strict=False)] + [braked]
    forces.append(residual - np.sum(forces, axis=0))
    names.append(LEFT_OVER)
    by_drive = _by_drive(search, added, starts, steps, draws, groups)
    counted = used | hidden
    parts = [
        Part(
            name,
            float(share[i]),
            float(low[i]),
            float(high[i]),
            float(np.mean(np.abs(forces[i][counted]) > NOTABLE)) if name != LEFT_OVER else 1.0,
            forces[i],
            tuple((drive, float(s[i])) for drive, s in by_drive.items()),
        )
        for i, name in enumerate(names)
        if share[i] > 0.0 or name == LEFT_OVER
    ]
    parts.sort(key=lambda p: (p.part == LEFT_OVER, -p.share))
    return Budget(horizon_s, len(starts), rmse, tuple(parts))


def _shares(draws: Array, groups: Sequence[NDArray[np.intp]], products: Array) -> Array:
    """Shares of the squared error (m, parts + 1) for draws (m, k), what is unexplained last, that add up to
    one. `products` (K, K) are those of the k columns that are drawn, of those taken as they are, and of the
    error. A share is each part's marginal contribution averaged over all orders (Shapley's value of a
    quadratic form), so that what two correlated parts explain is divided between them; what two parts cancel
    of each other counts in neither."""
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


def _refitted(e: Evidence, given: Evidence) -> dict[str, Array]:
    """What refitting parameters changed of the residual (n,), m/s^2, by family; what is not linear in them is
    divided as the linear parts are."""
    linear = {p: np.nan_to_num(given.sensitivity[p]) * change for p, change in e.moved.items()}
    total = sum(np.abs(force) for force in linear.values())
    rest = np.nan_to_num(given.residual - e.residual) - sum(linear.values())
    out: dict[str, Array] = {}
    for p, force in linear.items():
        share = np.abs(force) / np.maximum(total, 1e-12)
        out[FAMILY[p]] = out.get(FAMILY[p], 0.0) + force + share * rest
    return out


def _by_drive(
    search: Regression,
    added: Array,
    starts: Sequence[int],
    steps: int,
    draws: Array,
    groups: Sequence[NDArray[np.intp]],
) -> dict[str, Array]:
    """The shares of each drive's own squared error by its name."""
    owner = np.repeat(search.e.record[np.array(starts)], steps)
    out = {}
    for i in np.unique(owner):
        own = added[owner == i]
        out[search.e.stretches[i].name] = _shares(draws, groups, own.T @ own).mean(axis=0)
    return out


def _blocks(search: Regression) -> list[tuple[str, Array]]:
    """Features (n, k), of unit mean square over the rows that are fitted, of all that has a variance of its
    own, each with the part of the budget to which it belongs."""
    e, rows = search.e, search.rows
    mechanisms: dict[str, list[Array]] = {}
    for k in kernels(search):
        if FAMILY.get(k.name) in NAMES and k.part != "in time":
            unit = k.features / (np.linalg.norm(k.features[rows]) + 1e-9)
            mechanisms.setdefault(k.name, []).append(unit)
    drive = np.stack([e.record == i for i in range(len(e.stretches))], axis=1).astype(float)
    place = _places(search)
    blocks = [
        ("sensors", _thin(search.lateness, rows)),
        *((FAMILY[name], _thin(np.concatenate(own, axis=1), rows)) for name, own in mechanisms.items()),
        (EACH_DRIVE, drive - drive[rows].mean(axis=0)),  # what all drives have is not of each
        (SLOW, _knots(search)),
        *([] if place is None else [(PLACE, place)]),
    ]
    kept = []
    for part, features in blocks:
        f = np.nan_to_num(features)
        f = f[:, np.any(np.abs(f[rows]) > 1e-9, axis=0)]
        size = np.sqrt(np.mean(np.sum(f[rows] ** 2, axis=1))) if f.shape[1] else 0.0
        if size > 0.0:
            kept.append((part, f / size))
    return kept


def _thin(features: Array, rows: NDArray[np.intp]) -> Array:
    """The leading directions of normalised features over the rows that are fitted."""
    f = np.nan_to_num(features)
    f = f / (np.linalg.norm(f[rows], axis=0) + 1e-9)
    power, turn = np.linalg.eigh(f[rows].T @ f[rows])
    kept = np.argsort(power)[::-1][:DIRECTIONS]
    out: Array = f @ turn[:, kept[power[kept] > 1e-7 * power.max(initial=0.0)]]
    return out


def _knots(search: Regression) -> Array:
    """A linear spline in time for every drive that is fitted, (n, k)."""
    e = search.e
    fitted = [s for s in e.stretches if not s.held_out]
    spacing = max(SLOW_S, sum(s.stop - s.start for s in fitted) * e.dt / MOST_KNOTS)
    parts = []
    for s in fitted:
        at = np.arange(s.stop - s.start) * e.dt
        knots = np.arange(0.0, at[-1] + spacing, spacing)
        part = np.zeros((len(e), len(knots)))
        part[s.rows] = np.maximum(1.0 - np.abs(at[:, None] - knots) / spacing, 0.0)
        parts.append(part)
    return np.concatenate(parts, axis=1)


def _places(search: Regression) -> Array | None:
    """A linear spline over road positions that more than one drive passes, (n, k); None where hardly any of
    the road is driven again."""
    e = search.e
    known = e.valid & (e["place"] >= 0.0)
    if not known.any() or np.array_equal(e["place"], e["distance"]):  # positions were not recorded
        return None
    bins = (e["place"][known] / PLACE_M).astype(int)
    passes = {b: len(np.unique(e.record[known][bins == b])) for b in np.unique(bins)}
    again = np.array([passes[b] > 1 for b in bins])
    if again.mean() < TWICE:
        return None
    last = float(e["place"][known].max())
    spacing = max(PLACE_M, last / MOST_PLACES)
    knots = np.arange(0.0, last + spacing, spacing)
    out = np.maximum(1.0 - np.abs(e["place"][:, None] - knots) / spacing, 0.0)
    out[e["place"] < 0.0] = 0.0
    return out


def _posterior(search: Regression, F: Array, at: Sequence[NDArray[np.intp]]) -> Array:
    """Draws (m, k) of the coefficients, of which those `at` one place share a variance, from their posterior
    beside the noise of the recordings.

    The noise and the first variances are those that maximise the marginal likelihood (EM); a
    Gibbs sampler over variances and coefficients follows, as one value of the variances would decide between
    what the drives do not separate. The prior of a variance is PRIOR_SD^2 over a chi-squared variable
    of one degree of freedom.
    """
    beside = _as_recorded(search)
    series, noise = beside.series, beside.background(()).fit
    sizes = np.array([len(a) for a in at])
    v = np.full(len(at), FIRST_SD**2)
    mean = np.zeros(F.shape[1])
    for turn in range(TURNS):
        if turn:  # beside the parts: noise that was fitted without them holds what is slow of them
            left = np.where(series.valid, series.y - F @ mean, 0.0)
            noise = fit(replace(series, y=left), np.zeros((len(left), 0)), NO_COLUMNS, noise)
        weight = 1.0 / (series.relative[search.rows] * noise.sigma)
        Fw = whiten(F, noise.ar, search.rows, weight)
        G, c = Fw.T @ Fw, Fw.T @ whiten(series.y, noise.ar, search.rows, weight)
        for _ in range(STEPS):
            C = np.linalg.inv(G + np.diag(1.0 / np.repeat(v, sizes)))
            mean = C @ c
            v = (_power(mean, at) + _power(np.sqrt(np.diag(C)), at) + PRIOR_SD**2) / (sizes + 1)
    rng = np.random.default_rng(0)
    draws = []
    for _ in range(SWEEPS):
        root = np.linalg.cholesky(G + np.diag(1.0 / np.repeat(v, sizes)))
        spread = rng.standard_normal((len(c), DRAWS))
        b = solve_triangular(
            root, solve_triangular(root, c, lower=True)[:, None] + spread, lower=True, trans=1
        )
        draws.append(b.T)
        v = (_power(b[:, 0], at) + PRIOR_SD**2) / rng.chisquare(sizes + 1)
    return np.concatenate(draws)


def _power(b: Array, at: Sequence[NDArray[np.intp]]) -> Array:
    """Sum of the squared coefficients of each part."""
    return np.array([float(b[a] @ b[a]) for a in at])


def _as_recorded(search: Regression) -> Regression:
    """The search whose noise is that of recordings. A learned simulator may be off by more, and slowly; but
    what it is off by is what the budget splits."""
    e = search.e
    if e.model_discrepancy == 0.0:
        return search
    return Regression(replace(e, model_discrepancy=0.0, slow_noise=e.rules.slow_noise, itself=None))


def _starts(search: Regression, counted: Mask, steps: int) -> list[int]:
    """First rows of windows, each half over the one before, that are compared throughout."""
    return [
        k
        for s in search.e.stretches
        if not s.held_out
        for k in range(s.start, s.stop - steps, max(steps // 2, 1))
        if counted[k : k + steps].mean() >= KNOWN
    ]
