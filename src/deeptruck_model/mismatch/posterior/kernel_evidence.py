"""Residuals asked of every kernel at once: what kernel_features are made of.

All of it needs inner products of whitened features alone, so that thousands of residuals along the same
drives cost seconds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr, logsumexp

from deeptruck_model.mismatch.posterior.kernel_features import SIZES, Given, KernelFeatures, Seen
from deeptruck_model.mismatch.posterior.kernels import Kernel, kernels
from deeptruck_model.mismatch.posterior.regression import Model, Regression
from deeptruck_model.mismatch.residual.noise import TAIL, whiten

Array = NDArray[np.float64]
Places = NDArray[np.intp]

SIGNED_ROWS = 150  # at which a sign is looked at, where the force is ...
ACTING = 0.2  # ... of its largest, or more; and it counts for nothing by ...
FEW_ROWS = 20  # ... fewer


@dataclass(frozen=True)
class _Directions:
    """A kernel beside what is given, turned so that its directions are independent: the power of each (d,),
    how features become directions (features, d), what the given block takes from them (features, given), and
    signed features at some rows (rows, d), or None."""

    power: Array
    turn: Array
    given: Array
    signed: Array | None


class KernelEvidence:
    """Kernels along the drives of a search, whitened by the noise of a model once for all residuals."""

    def __init__(self, search: Regression, model: Model) -> None:
        self.kernels: tuple[Kernel, ...] = kernels(search)
        X, prior, _ = search.design(search.model((), frozenset()))
        blocks = [X * prior.sd, *(k.features for k in self.kernels)]
        ends = np.cumsum([b.shape[1] for b in blocks])
        self._of: list[Places] = [
            np.arange(end - b.shape[1], end) for end, b in zip(ends, blocks, strict=True)
        ]
        self._rows = search.rows
        self._ar = model.fit.ar
        weight = np.sqrt((TAIL + 1) / (TAIL + model.fit.innovations[self._rows] ** 2))
        self._weight = weight / (search.series.relative[self._rows] * model.fit.sigma)
        self._features = self._whitened(np.concatenate(blocks, axis=1))
        self._gram = self._features.T @ self._features
        self._signed = [_where_signed(k, self._rows) for k in self.kernels]
        self._mean = X @ prior.mean

    def of(self, residuals: Array, beside: Sequence[str] = (), quiet: float | None = None) -> KernelFeatures:
        """What every kernel gives for residuals (n, N), m/s^2, with kernels of names that are given. `quiet`
        is the sum of squares that noise alone leaves; else that of the number of rows."""
        left = self._whitened(residuals - self._mean[:, None])
        onto, squares = self._features.T @ left, np.einsum("ij,ij->j", left, left)
        quiet = float(len(self._rows)) if quiet is None else quiet
        given = self._given(onto, beside)
        free = given
        for j, k in enumerate(self.kernels):
            free = self._with(*free, j, 1.0) if k.part == "parameter" else free
        turned, freely = (self._beside(onto, squares, block) for block in (given, free))
        held, loose = _seen(*turned, quiet), _seen(*freely, quiet)
        chance = np.array([k.chance for k in self.kernels])
        known = self._known(onto, given, held, turned) if beside else _nothing_given(residuals.shape[1])
        return KernelFeatures(tuple(k.key for k in self.kernels), chance, held, loose, known)

    def _known(
        self,
        onto: Array,
        given: tuple[Places, Array],
        held: Seen,
        turned: tuple[list[_Directions], list[Array], Array],
    ) -> Given:
        """What the given names explain of the first residual, and where the best kernel beside them acts."""
        at, scale = given
        bare = self._given(onto, ())
        explained = self._explained(onto[:, 0], at, scale) - self._explained(onto[:, 0], *bare)
        precision = np.eye(len(at)) + self._gram[np.ix_(at, at)] * np.outer(scale, scale)
        taken = np.linalg.solve(precision, onto[at, 0] * scale) * scale
        theirs = self._features[:, at[len(bare[0]) :]] @ taken[len(bare[0]) :]
        best = int(np.argmax(held.nats[:, 0]))
        d, size = turned[0][best], SIZES[held.size[best, 0]]
        own = d.turn @ (size**2 * turned[1][best][:, 0] / (1.0 + size**2 * d.power))
        left = self._features[:, self._of[1 + best]] @ own
        sizes = np.linalg.norm(theirs) * np.linalg.norm(left)
        overlap = float(np.abs(theirs) @ np.abs(left)) / max(float(sizes), 1e-12)
        n = onto.shape[1]
        return Given(np.full(n, True), np.full(n, max(explained, 0.0)), np.full(n, overlap))

    def squares(self, residual: Array) -> float:
        """The sum of squares of a whitened residual (n,)."""
        return float(np.sum(self._whitened(residual - self._mean) ** 2))

    def force(self, residual: Array, name: str, beside: Sequence[str] = ()) -> Array:
        """Posterior mean of a name's force (n,), m/s^2, in a residual (n,), beside the kernels of others, by
        that of its kernels, and of their sizes, that explains most."""
        onto = self._features.T @ self._whitened(residual - self._mean)
        given = self._given(onto[:, None], beside)
        own = [(j, s) for j, k in enumerate(self.kernels) if k.name == name for s in SIZES]
        if not own:
            return np.zeros(len(residual))
        j, size = max(own, key=lambda js: self._explained(onto, *self._with(*given, *js)))
        at, scale = self._with(*given, j, size)
        precision = np.eye(len(at)) + self._gram[np.ix_(at, at)] * np.outer(scale, scale)
        b = np.linalg.solve(precision, onto[at] * scale) * scale
        out: Array = self.kernels[j].features @ b[len(given[0]) :]
        return out

    def _whitened(self, x: Array) -> Array:
        return whiten(x, self._ar, self._rows, self._weight)

    def _given(self, onto: Array, names: Sequence[str]) -> tuple[Places, Array]:
        """Features that are given, and what each is multiplied by: sensors, held parameters, and the kernel
        of each name, at the size that explains most of the first residual beside those before it."""
        at, scale = self._of[0], np.ones(len(self._of[0]))
        for name in names:
            own = [(j, s) for j, k in enumerate(self.kernels) if k.name == name for s in SIZES]
            if own:
                explains = [self._explained(onto[:, 0], *self._with(at, scale, j, s)) for j, s in own]
                at, scale = self._with(at, scale, *own[int(np.argmax(explains))])
        return at, scale

    def _with(self, at: Places, scale: Array, j: int, size: float) -> tuple[Places, Array]:
        more = self._of[1 + j]
        return np.concatenate([at, more]), np.concatenate([scale, np.full(len(more), size)])

    def _explained(self, onto: Array, at: Places, scale: Array) -> float:
        """Log evidence of features together, beside noise alone."""
        precision = np.eye(len(at)) + self._gram[np.ix_(at, at)] * np.outer(scale, scale)
        pull = onto[at] * scale
        return float(0.5 * pull @ np.linalg.solve(precision, pull) - 0.5 * np.linalg.slogdet(precision)[1])

    def _beside(
        self, onto: Array, squares: Array, given: tuple[Places, Array]
    ) -> tuple[list[_Directions], list[Array], Array]:
        """Each kernel's directions, what residuals have along them, each (d, N), and the squares left (N,),
        beside what is given."""
        at, scale = given
        precision = np.eye(len(at)) + self._gram[np.ix_(at, at)] * np.outer(scale, scale)
        pull = onto[at] * scale[:, None]
        taken = np.linalg.solve(precision, pull)
        directions, along = [], []
        for j, own in enumerate(self._of[1:]):
            across = self._gram[np.ix_(own, at)] * scale
            inner = self._gram[np.ix_(own, own)] - across @ np.linalg.solve(precision, across.T)
            power, turn = np.linalg.eigh(inner)
            signed = self._signed[j]
            turned = None if signed is None else signed @ turn
            directions.append(_Directions(np.maximum(power, 0.0), turn, across, turned))
            along.append(turn.T @ (onto[own] - across @ taken))
        return directions, along, squares - np.einsum("ij,ij->j", pull, taken)


def _nothing_given(n: int) -> Given:
    return Given(np.full(n, False), np.zeros(n), np.zeros(n))


def _seen(directions: list[_Directions], along: list[Array], squares: Array, quiet: float) -> Seen:
    noise = np.ones(len(squares))
    nats = _nats(directions, along, noise)
    noise = np.minimum(quiet / np.maximum(_left(directions, along, squares, nats), 1e-9), 1.0)
    nats = _nats(directions, along, noise)
    size = np.argmax(nats, axis=1)
    identified, sign = (np.stack(x) for x in zip(*_signs(directions, along, size, noise), strict=True))
    return Seen(logsumexp(nats, axis=1) - np.log(len(SIZES)), sign, size, identified, noise)


def _nats(directions: list[_Directions], along: list[Array], noise: Array) -> Array:
    """Log evidence (k, sizes, N) of every kernel of every size, at a precision of the noise (N,)."""
    out = np.empty((len(directions), len(SIZES), len(noise)))
    for j, (d, a) in enumerate(zip(directions, along, strict=True)):
        for i, size in enumerate(SIZES):
            precision = 1.0 + size**2 * d.power[:, None] * noise
            out[j, i] = 0.5 * np.sum((noise * size * a) ** 2 / precision - np.log(precision), axis=0)
    return out


def _left(directions: list[_Directions], along: list[Array], squares: Array, nats: Array) -> Array:
    """The sum of squares (N,) that the best kernel leaves."""
    left = squares.copy()
    best, size = np.unravel_index(nats.reshape(-1, len(squares)).argmax(axis=0), nats.shape[:2])
    for j in np.unique(best):
        its = best == j
        s, power = SIZES[size[its]], directions[j].power[:, None]
        q = s**2 * power
        left[its] -= np.sum((s * along[j][:, its]) ** 2 * (2.0 + q) / (1.0 + q) ** 2, axis=0)
    return left


def _signs(
    directions: list[_Directions], along: list[Array], size: NDArray[np.intp], noise: Array
) -> list[tuple[Array, Array]]:
    """How many directions of each kernel the data identify, and the evidence of its sign in nats, each (N,):
    the share of its posterior that has it, by the rows where it acts, for each identified direction."""
    out = []
    for d, a, best in zip(directions, along, size, strict=True):
        s = SIZES[best]
        precision = 1.0 + noise * s**2 * d.power[:, None]
        identified = np.maximum(np.sum(1.0 - 1.0 / precision, axis=0), 1.0)
        if d.signed is None:
            out.append((identified, np.zeros(len(noise))))
            continue
        mean = d.signed @ (noise * s * a / precision) * s
        sd = np.sqrt(d.signed**2 @ (1.0 / precision)) * s + 1e-9
        out.append((identified, identified * np.mean(log_ndtr(mean / sd) - np.log(0.5), axis=0)))
    return out


def _where_signed(kernel: Kernel, rows: Places) -> Array | None:
    """Features (m, k) at some rows where the name acts, times the sign that its force has there."""
    if kernel.sign is None or not len(rows):
        return None
    size = np.abs(kernel.sign[rows])
    acting = rows[size > ACTING * np.quantile(size, 0.98)]
    if len(acting) < FEW_ROWS:
        return None
    some = acting[np.linspace(0, len(acting) - 1, SIGNED_ROWS).astype(int)]
    out: Array = np.sign(kernel.sign[some])[:, None] * kernel.features[some]
    return out
