"""Which blocks of columns are in a sum, and how large: spike and slab by Gibbs sampling.

Target: whitened y = sum over blocks that are in of X_j b_j + noise, with b_j ~ N(0, size_j^2 I), a size from
a grid, and prior odds of being in. Coefficients are integrated out, so that a state is a set of blocks with
sizes (George and McCulloch, Statistica Sinica 7, 1997). Only inner products are needed.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.special import log_ndtr

Array = NDArray[np.float64]
Places = NDArray[np.intp]
State = tuple[int, ...]  # of every block the place of its size in SIZES, or OUT

SIZES = np.array([0.15, 0.4, 1.0, 2.5])  # of a block beside its prior sd, equally likely
OUT = -1
LEAST_POWER = 0.02  # of a direction at the largest size, in units of the noise: less says nothing
SWEEPS, BURN_IN = 240, 60


@dataclass(frozen=True)
class Blocks:
    """Inner products of whitened columns: `gram` (k, k) and `pull` (k,) with the residual, of which `at` each
    block has its own; log prior odds (blocks,) of being in; and `signed` by block the products (k_j,) of its
    columns with a force whose sign is the only one that it can have, or None."""

    gram: Array
    pull: Array
    at: Sequence[Places]
    log_odds: Array
    signed: Sequence[Array | None]


@dataclass(frozen=True)
class Draws:
    """States (m, blocks) and coefficients (m, k) of the same draws, the gain of the best state, and what each
    block gains by itself at each size, (blocks, sizes), in nats."""

    states: NDArray[np.int_]
    coefficients: Array
    gain: float
    alone: Array

    @property
    def inside(self) -> NDArray[np.bool_]:
        """Which blocks are in, (m, blocks)."""
        out: NDArray[np.bool_] = self.states != OUT
        return out


class _Reduced:
    """Blocks in directions that the data can show, beside columns that are always in."""

    def __init__(self, blocks: Blocks, always: Places) -> None:
        G, c = blocks.gram, blocks.pull
        self.always = always
        H = G[np.ix_(always, always)] + np.eye(len(always))
        self.root = np.linalg.cholesky(H)
        across = solve_triangular(self.root, G[always], lower=True)
        onto = solve_triangular(self.root, c[always], lower=True)
        left, pull = G - across.T @ across, c - across.T @ onto
        self.turns: list[Array] = []
        kept = []
        for own in blocks.at:
            power, turn = np.linalg.eigh(left[np.ix_(own, own)])
            on = power * SIZES[-1] ** 2 > LEAST_POWER
            self.turns.append(turn[:, on])
            kept.append(int(on.sum()))
        ends = np.cumsum([0, *kept])
        self.at = [np.arange(a, b) for a, b in itertools.pairwise(ends)]
        whole = np.zeros((len(c), ends[-1]))
        for own, at, turn in zip(blocks.at, self.at, self.turns, strict=True):
            whole[np.ix_(own, at)] = turn
        self.whole = whole
        self.gram, self.pull = whole.T @ left @ whole, whole.T @ pull
        self.signed = [
            None if s is None else turn.T @ s for s, turn in zip(blocks.signed, self.turns, strict=True)
        ]
        self.log_odds = blocks.log_odds
        self._tables: dict[State, tuple[Array, float]] = {}

    def active(self, state: State) -> tuple[Places, Array]:
        """Directions that are in, and what each is multiplied by."""
        on = [(j, s) for j, s in enumerate(state) if s != OUT]
        if not on:
            return np.zeros(0, dtype=np.intp), np.zeros(0)
        return (
            np.concatenate([self.at[j] for j, _ in on]),
            np.concatenate([np.full(len(self.at[j]), SIZES[s]) for j, s in on]),
        )

    def table(self, state: State) -> tuple[Array, float]:
        """What every block that is out would gain at each size, (blocks, sizes) in nats, its sign counted;
        and the log evidence of the state."""
        if state not in self._tables:
            self._tables[state] = self._table(state)
        return self._tables[state]

    def _table(self, state: State) -> tuple[Array, float]:
        a, scale = self.active(state)
        P = np.eye(len(a)) + self.gram[np.ix_(a, a)] * np.outer(scale, scale)
        root = np.linalg.cholesky(P)
        across = solve_triangular(root, self.gram[a] * scale[:, None], lower=True)
        onto = solve_triangular(root, self.pull[a] * scale, lower=True)
        evidence = float(0.5 * onto @ onto - np.log(np.diag(root)).sum())
        left = self.pull - across.T @ onto
        gains = np.full((len(self.at), len(SIZES)), -np.inf)
        for j, own in enumerate(self.at):
            if state[j] == OUT and len(own):
                inner = self.gram[np.ix_(own, own)] - across[:, own].T @ across[:, own]
                gains[j] = _gains(inner, left[own], self.signed[j])
            elif state[j] == OUT:
                gains[j] = 0.0
        return gains, evidence

    def drawn(self, state: State, blocks: Blocks, unit: float, rng: np.random.Generator) -> Array:
        """Coefficients (k,) of the columns as given, from their posterior in a state: as wide as log evidence
        that is divided by `unit` makes it."""
        a, scale = self.active(state)
        W = self.whole[:, a] * scale
        E = np.zeros((len(blocks.pull), len(self.always)))
        E[self.always, np.arange(len(self.always))] = 1.0
        M = np.concatenate([E, W], axis=1)
        P = np.eye(M.shape[1]) + M.T @ blocks.gram @ M
        root = np.linalg.cholesky(P)
        wide = np.sqrt(unit) * rng.standard_normal(len(P))
        b = solve_triangular(root, M.T @ blocks.pull, lower=True) + wide
        out: Array = M @ solve_triangular(root, b, lower=True, trans=1)
        return out


def _gains(inner: Array, pull: Array, signed: Array | None) -> Array:
    """Log evidence (sizes,) of a block with these inner products beside what is in."""
    power, turn = np.linalg.eigh(inner)
    power, along = np.maximum(power, 0.0), turn.T @ pull
    s2 = SIZES[:, None] ** 2
    shrunk = s2 / (1.0 + s2 * power)
    out: Array = 0.5 * np.sum(shrunk * along**2 - np.log1p(s2 * power), axis=1)
    if signed is not None:
        onto = turn.T @ signed
        mean, sd = shrunk @ (onto * along), np.sqrt(np.maximum(shrunk @ onto**2, 1e-30))
        out = out + log_ndtr(mean / sd) + np.log(2.0)
    return out


def sample(
    blocks: Blocks, always: Places, unit: float, seed: int = 0, sweeps: int = SWEEPS, thin: int = 1
) -> Draws:
    """Draws of states and coefficients. Log evidence is divided by `unit`, as noise and forms are only nearly
    right. Columns that are `always` in have unit prior variance."""
    rng = np.random.default_rng(seed)
    r = _Reduced(blocks, always)
    state, best = _greedy(r, unit)
    states, coefficients = [], []
    for sweep in range(sweeps + BURN_IN):
        for j in rng.permutation(len(r.at)):
            state = _toggled(r, state, int(j), unit, rng)
        state = _exchanged(r, state, unit, rng)
        best = max(best, r.table(state)[1])
        if sweep >= BURN_IN and (sweep - BURN_IN) % thin == 0:
            states.append(state)
            coefficients.append(r.drawn(state, blocks, unit, rng))
    alone = r.table((OUT,) * len(r.at))[0]
    return Draws(np.array(states), np.array(coefficients), best, alone)


def _greedy(r: _Reduced, unit: float) -> tuple[State, float]:
    """Blocks put in one after the other while that is more probable than not."""
    state: State = tuple([OUT] * len(r.at))
    while True:
        gains, evidence = r.table(state)
        worth = gains / unit + r.log_odds[:, None] - np.log(len(SIZES))
        j, s = np.unravel_index(int(np.argmax(worth)), worth.shape)
        if worth[j, s] <= 0.0:
            return state, evidence
        state = _with(state, int(j), int(s))


def _with(state: State, j: int, s: int) -> State:
    return (*state[:j], s, *state[j + 1 :])


def _toggled(r: _Reduced, state: State, j: int, unit: float, rng: np.random.Generator) -> State:
    """A block out, or in at one of its sizes, given the others."""
    without = _with(state, j, OUT)
    gains = r.table(without)[0][j]
    logs = np.concatenate([[0.0], gains / unit + r.log_odds[j] - np.log(len(SIZES))])
    return _with(without, j, _pick(logs, rng) - 1)


def _exchanged(r: _Reduced, state: State, unit: float, rng: np.random.Generator) -> State:
    """One block of those that are in, or any other in its place, given the others."""
    on = [j for j, s in enumerate(state) if s != OUT]
    if not on:
        return state
    without = _with(state, int(rng.choice(on)), OUT)
    logs = r.table(without)[0] / unit + r.log_odds[:, None]
    j, s = np.unravel_index(_pick(logs.ravel(), rng), logs.shape)
    return _with(without, int(j), int(s))


def _pick(logs: Array, rng: np.random.Generator) -> int:
    p = np.exp(logs - logs.max())
    return int(np.searchsorted(np.cumsum(p), rng.random() * p.sum()))
