"""Spike-and-slab selection of blocks of columns, and of their sizes, by Gibbs sampling.

Target: whitened y = sum over active blocks of X_j b_j + noise, with b_j ~ N(0, size_j^2 I), a size from a
grid, and prior odds of being active. Coefficients are integrated out, so that a state is a set of blocks with
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

from deeptruck_core.arrays import Array, Mask
from deeptruck_model.trucks.compiled import entry

Places = NDArray[np.intp]
State = tuple[int, ...]  # of every block the place of its size in SIZES, or OUT

SIZES = np.array([0.15, 0.4, 1.0, 2.5])  # of a block beside its prior sd, equally likely
OUT = -1
NO_SIGN = np.zeros(0)
LEAST_POWER = 0.02  # of a direction at the largest size, in units of the noise: less says nothing
SWEEPS, BURN_IN = 240, 20
LEAST_STEP = 1e-6  # of log probability, by which another state is more probable
MOST_KNOWN = 300  # states that are remembered: a root is up to a megabyte


@dataclass(frozen=True)
class Blocks:
    """Inner products of whitened columns: `gram` (k, k) and `pull` (k,) with the residual, of which `at` each
    block has its own; log prior odds (blocks,) of being in; `signed` by block the products (k_j,) of its
    columns with a force whose sign is the only one that it can have, or None; and which blocks are a `law`
    (blocks,), whose form is approximate: parameters and drifts are not."""

    gram: Array
    pull: Array
    at: Sequence[Places]
    log_odds: Array
    signed: Sequence[Array | None]
    law: Mask


@dataclass(frozen=True)
class Draws:
    """Draws of the posterior: states (m, blocks) and coefficients (m, k).

    `alone` (blocks, sizes) is each block's own gain at each size, in nats over no active block; `space` gives
    the gains relative to any state, and log evidence was divided by `unit` in the choice of blocks.
    """

    states: NDArray[np.int_]
    coefficients: Array
    alone: Array
    space: Reduced
    unit: float

    @property
    def inside(self) -> Mask:
        """Which blocks are active, (m, blocks)."""
        out: Mask = self.states != OUT
        return out


@dataclass(frozen=True)
class _Given:
    """A state: the directions that are inside (k,) and their scale, the Cholesky root (k, k) of their
    precision, its solution for their pull, the log evidence, and gains (blocks, sizes) next to it, NaN where
    not asked for yet."""

    inside: Places
    scale: Array
    root: Array
    onto: Array
    evidence: float
    gains: Array


class Reduced:
    """Blocks in directions that the data determine, conditional on columns that are always active."""

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
        half = np.zeros((len(c), ends[-1]))  # left @ whole, of which every column has one block
        for own, at, turn in zip(blocks.at, self.at, self.turns, strict=True):
            whole[np.ix_(own, at)] = turn
            half[:, at] = left[:, own] @ turn
        self.whole, self.pull = whole, whole.T @ pull
        self.gram = np.empty((ends[-1], ends[-1]))
        for own, at, turn in zip(blocks.at, self.at, self.turns, strict=True):
            self.gram[at] = turn.T @ half[own]
        self.across, self.onto = across @ whole, onto
        self.signed = [
            NO_SIGN if s is None else turn.T @ s for s, turn in zip(blocks.signed, self.turns, strict=True)
        ]
        self.log_odds = blocks.log_odds
        self._known: dict[State, _Given] = {}

    def active(self, state: State) -> tuple[Places, Array]:
        """Directions that are active, and the factor of each."""
        on = [(j, s) for j, s in enumerate(state) if s != OUT]
        if not on:
            return np.zeros(0, dtype=np.intp), np.zeros(0)
        return (
            np.concatenate([self.at[j] for j, _ in on]),
            np.concatenate([np.full(len(self.at[j]), SIZES[s]) for j, s in on]),
        )

    def table(self, state: State) -> Array:
        """The gain of every inactive block at each size, (blocks, sizes) in nats, including its sign
        constraint."""
        given = self._given(state)
        for j in np.flatnonzero(np.isnan(given.gains[:, 0])):
            self.gains(state, int(j))
        return given.gains

    def gains(self, state: State, j: int) -> Array:
        """The gain of one block at each size relative to a state, (sizes,) in nats; minus infinity for an
        active one."""
        given = self._given(state)
        if np.isnan(given.gains[j, 0]):
            own = self.at[j]
            if state[j] != OUT:
                given.gains[j] = -np.inf
            elif not len(own):
                given.gains[j] = 0.0
            else:
                given.gains[j], along = _beside(
                    self.gram, self.pull, given.inside, given.scale, given.root, given.onto,
                    own[0], own[-1] + 1, self.signed[j],
                )  # fmt: skip
                if len(self.signed[j]):  # of the one sign that its force can have
                    given.gains[j] += log_ndtr(along) + np.log(2.0)
        out: Array = given.gains[j]
        return out

    def evidence(self, state: State) -> float:
        """The log evidence of a state relative to the empty one, nats."""
        return self._given(state).evidence

    def _given(self, state: State) -> _Given:
        if state not in self._known:
            if len(self._known) >= MOST_KNOWN:
                self._known.clear()
            a, scale = self.active(state)
            root = np.linalg.cholesky(np.eye(len(a)) + self.gram[np.ix_(a, a)] * np.outer(scale, scale))
            onto = solve_triangular(root, self.pull[a] * scale, lower=True)
            evidence = float(0.5 * onto @ onto - np.log(np.diag(root)).sum())
            gains = np.full((len(self.at), len(SIZES)), np.nan)
            self._known[state] = _Given(a, scale, root, onto, evidence, gains)
        return self._known[state]

    def drawn(self, state: State, unit: float, rng: np.random.Generator) -> Array:
        """Coefficients (k,) of the columns as given, from their posterior in a state: as wide as log evidence
        that is divided by `unit` makes it. The Cholesky factor of their precision has `root` and that of the
        directions that are in on its diagonal, and `across` below."""
        given = self._given(state)
        a, scale, root = given.inside, given.scale, given.root
        wide = np.sqrt(unit) * rng.standard_normal(len(self.always) + len(a))
        first, then = self.onto + wide[: len(self.always)], wide[len(self.always) :]
        then = then + given.onto
        inside = scale * solve_triangular(root, then, lower=True, trans=1)
        out: Array = self.whole[:, a] @ inside
        out[self.always] += solve_triangular(
            self.root, first - self.across[:, a] @ inside, lower=True, trans=1
        )
        return out


def gains_of(inner: Array, pull: Array) -> Array:
    """Log evidence (sizes,) of a block with these inner products beside what is in."""
    return _of_sizes(inner, pull, NO_SIGN)[0]


@entry
def _beside(
    gram: Array,
    pull: Array,
    inside: Places,
    scale: Array,
    root: Array,
    onto: Array,
    first: int,
    last: int,
    signed: Array,
) -> tuple[Array, Array]:
    """As `_of_sizes` for the block of the columns from `first` to `last`, beside what is in."""
    k = last - first
    inner, own, across = gram[first:last, first:last].copy(), pull[first:last].copy(), np.empty(k)
    solved = np.empty((len(inside), k))
    for i in range(len(inside)):
        for c in range(k):
            across[c] = gram[inside[i], first + c] * scale[i]
        for j in range(i):
            for c in range(k):
                across[c] -= root[i, j] * solved[j, c]
        for c in range(k):
            across[c] /= root[i, i]
            own[c] -= onto[i] * across[c]
        solved[i] = across
        for a in range(k):
            for c in range(k):
                inner[a, c] -= across[a] * across[c]
    return _of_sizes(inner, own, signed)


@entry
def _of_sizes(inner: Array, pull: Array, signed: Array) -> tuple[Array, Array]:
    """Log evidence (sizes,) of a block with these inner products, by its Cholesky factor at each size; and
    by how many standard deviations its force has the sign of `signed`, if that is not empty."""
    gains, along, n = np.zeros(len(SIZES)), np.zeros(len(SIZES)), len(pull)
    for i in range(len(SIZES)):
        upper, half, side, squares = inner.copy(), pull.copy(), np.zeros(n), 0.0
        side[: len(signed)] = signed
        for k in range(n):
            power = upper[k, k] + SIZES[i] ** -2
            if not power > 0.0:
                raise ValueError("inner products of a block are not positive definite")
            gains[i] += 0.5 * (half[k] ** 2 / power - np.log(power * SIZES[i] ** 2))
            along[i] += half[k] * side[k] / power
            squares += side[k] ** 2 / power
            for row in range(k + 1, n):
                share = upper[k, row] / power
                half[row] -= share * half[k]
                side[row] -= share * side[k]
                for c in range(row, n):
                    upper[row, c] -= share * upper[k, c]
        along[i] /= max(np.sqrt(squares), 1e-15)
    return gains, along


def sample(
    blocks: Blocks, always: Places, unit: float, law_error: float = 0.0, seed: int = 0, sweeps: int = SWEEPS
) -> Draws:
    """Draw states and coefficients. Columns in `always` are always active with unit prior variance.

    Log evidence is divided by `unit`, because the noise is approximate. In the choice of blocks the share
    `law_error` of what laws gain beside the blocks that are none is added to it: the more laws explain, the
    more does an error of their form, which another name may follow. Parameters have no such error, nor have
    coefficients, given the blocks.
    """
    rng = np.random.default_rng(seed)
    r = Reduced(blocks, always)
    alone = r.table((OUT,) * len(r.at))
    state = _greedy(r, unit)
    others = tuple(OUT if is_law else s for s, is_law in zip(state, blocks.law, strict=True))
    temperature = unit + law_error * max(r.evidence(state) - r.evidence(others), 0.0)
    states, coefficients = [], []
    for sweep in range(sweeps + BURN_IN):
        for j in rng.permutation(len(r.at))[: (len(r.at) + 1) // 2]:  # exchanges mix names; all say no more
            state = _toggled(r, state, int(j), temperature, rng)
        state = _exchanged(r, state, temperature, rng)
        if sweep >= BURN_IN:
            states.append(state)
            coefficients.append(r.drawn(state, unit, rng))
    return Draws(np.array(states), np.array(coefficients), alone, r, temperature)


def most_probable(
    r: Reduced, unit: float, log_odds: Array, start: State | None = None
) -> tuple[State, float]:
    """The state that putting blocks in, leaving them out and exchanging them one by one leads to, and its log
    probability over that of `start`, by default the empty state. A block of `start` stays in; one whose log
    prior odds (blocks,) are minus infinity stays out."""
    state = start = start or (OUT,) * len(r.at)
    odds = log_odds - np.log(len(SIZES))
    held = {j for j, s in enumerate(start) if s != OUT}
    gained, seen = 0.0, {start}
    while True:
        steps = [(state, 0.0)]
        for j in [j for j, s in enumerate(state) if s != OUT and j not in held]:
            without = _with(state, j, OUT)
            steps.append((without, -float(r.gains(without, j)[state[j]] / unit + odds[j])))
        found = []
        for there, change in steps:
            worth = change + r.table(there) / unit + odds[:, None]
            block, size = np.unravel_index(int(np.argmax(worth)), worth.shape)
            found += [(float(worth[block, size]), _with(there, int(block), int(size))), (change, there)]
        change, best = max(found, key=lambda step: step[0])
        if change <= LEAST_STEP or best in seen:  # of a force of one sign the gain depends on the order
            return state, gained
        state, gained = best, gained + change
        seen.add(best)


def _greedy(r: Reduced, unit: float) -> State:
    """Blocks put in one after the other while that is more probable than not."""
    state: State = tuple([OUT] * len(r.at))
    while True:
        gains = r.table(state)
        worth = gains / unit + r.log_odds[:, None] - np.log(len(SIZES))
        j, s = np.unravel_index(int(np.argmax(worth)), worth.shape)
        if worth[j, s] <= 0.0:
            return state
        state = _with(state, int(j), int(s))


def _with(state: State, j: int, s: int) -> State:
    return (*state[:j], s, *state[j + 1 :])


def _toggled(r: Reduced, state: State, j: int, unit: float, rng: np.random.Generator) -> State:
    """A block out, or in at one of its sizes, given the others."""
    without = _with(state, j, OUT)
    gains = r.gains(without, j)
    logs = np.concatenate([[0.0], gains / unit + r.log_odds[j] - np.log(len(SIZES))])
    return _with(without, j, _pick(logs, rng) - 1)


def _exchanged(r: Reduced, state: State, unit: float, rng: np.random.Generator) -> State:
    """One block of those that are in, or any other in its place, given the others."""
    on = [j for j, s in enumerate(state) if s != OUT]
    if not on:
        return state
    without = _with(state, int(rng.choice(on)), OUT)
    logs = r.table(without) / unit + r.log_odds[:, None]
    j, s = np.unravel_index(_pick(logs.ravel(), rng), logs.shape)
    return _with(without, int(j), int(s))


def _pick(logs: Array, rng: np.random.Generator) -> int:
    p = np.exp(logs - logs.max())
    return int(np.searchsorted(np.cumsum(p), rng.random() * p.sum()))
