"""Which blocks are in a sum: found by inner products alone."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import pytest

from deeptruck_model.mismatch.posterior.sampler import (
    OUT,
    SIZES,
    Blocks,
    Draws,
    Reduced,
    most_probable,
    sample,
)

N = 400
RNG = np.random.default_rng(0)
X = RNG.standard_normal((N, 12)) * 0.5
BLOCKS = [np.arange(k, k + 3) for k in range(0, 12, 3)]
NONE = np.zeros(0, dtype=np.intp)
LAW = np.arange(4) != 3


def problem(
    y: np.ndarray, columns: np.ndarray = X, signed: Sequence[np.ndarray | None] = (None,) * 4
) -> Blocks:
    return Blocks(columns.T @ columns, columns.T @ y, BLOCKS, np.log(np.full(4, 0.05)), signed, LAW)


def drawn(y: np.ndarray, columns: np.ndarray = X, **more: Sequence[np.ndarray | None]) -> Draws:
    return sample(problem(y, columns, **more), NONE, 1.0, sweeps=100)


def noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(N)


def test_the_block_that_acts_is_in_and_its_coefficients_are_found() -> None:
    b = np.array([1.0, -0.8, 0.5])
    found = drawn(X[:, 3:6] @ b + noise(1))
    assert found.inside.mean(axis=0)[1] > 0.95
    assert found.inside.mean(axis=0)[[0, 2, 3]].max() < 0.2
    mean, sd = found.coefficients[:, 3:6].mean(axis=0), found.coefficients[:, 3:6].std(axis=0)
    assert np.all(np.abs(mean - b) < 3.5 * sd)


def test_of_noise_nothing_is_in() -> None:
    assert np.mean([drawn(noise(seed)).inside.any(axis=1).mean() for seed in range(5)]) < 0.3


def test_blocks_of_one_shape_share_the_probability() -> None:
    alike = X.copy()
    alike[:, 6:9] = alike[:, 3:6]
    inside = drawn(alike[:, 3:6] @ np.array([1.0, -0.8, 0.5]) + noise(2), alike).inside
    assert inside[:, 1:3].any(axis=1).mean() > 0.95
    assert 0.2 < inside[:, 1].mean() < 0.8


def test_a_force_of_the_other_sign_is_less_probable() -> None:
    pull = X[:, 3:6].T @ (X[:, 3:6] @ np.ones(3))
    signs = [(None, side * pull, None, None) for side in (1.0, -1.0)]
    y = X[:, 3:6] @ np.full(3, 0.15) + noise(3)
    right, wrong = (drawn(y, signed=s).inside[:, 1].mean() for s in signs)
    assert wrong < right


def test_the_gain_of_a_block_is_its_log_evidence() -> None:
    y = X[:, 3:6] @ np.ones(3) + noise(4)
    r = Reduced(problem(y), NONE)
    gains = r.table((OUT,) * 4)
    assert r.evidence((OUT,) * 4) == 0.0
    state = (OUT, 2, OUT, OUT)
    assert r.evidence(state) == pytest.approx(gains[1, 2], abs=1e-6)
    C = np.eye(N) + X[:, 3:6] @ X[:, 3:6].T  # size one
    dense = 0.5 * y @ y - 0.5 * y @ np.linalg.solve(C, y) - 0.5 * np.linalg.slogdet(C)[1]
    assert gains[1, 2] == pytest.approx(float(dense), abs=1e-6)


def test_columns_that_are_always_in_take_their_part_first() -> None:
    y = 2.0 * X[:, 0] + noise(5)
    blocks = problem(y)
    free = Blocks(blocks.gram, blocks.pull, BLOCKS[1:], blocks.log_odds[1:], (None,) * 3, LAW[1:])
    found = sample(free, np.arange(3), 1.0, sweeps=40)
    assert found.coefficients[:, 0].mean() == pytest.approx(2.0, abs=0.3)
    assert found.inside.mean() < 0.2


def test_draws_are_repeatable() -> None:
    y = X[:, 3:6] @ np.ones(3) + noise(6)
    assert np.array_equal(drawn(y).states, drawn(y).states)


def test_the_most_probable_state_is_that_of_an_exhaustive_search() -> None:
    y = X[:, 3:6] @ np.ones(3) + X[:, 6:9] @ np.full(3, 0.6) + noise(6)
    r = Reduced(problem(y), NONE)
    each = itertools.product(range(OUT, len(SIZES)), repeat=4)

    def worth(state: tuple[int, ...]) -> float:
        return r.evidence(state) + sum(
            r.log_odds[j] - np.log(len(SIZES)) for j in range(4) if state[j] != OUT
        )

    best = max(each, key=worth)
    found, gained = most_probable(r, 1.0, r.log_odds)
    assert found == best
    assert gained == pytest.approx(worth(best), abs=1e-6)
    held = (OUT, OUT, OUT, 0)
    assert most_probable(r, 1.0, r.log_odds, held)[0][3] == 0
    without = np.where(np.arange(4) == 1, -np.inf, r.log_odds)
    assert most_probable(r, 1.0, without)[0][1] == OUT


def test_steps_whose_gains_depend_on_their_order_end() -> None:
    """As those of forces of one sign: in a circle each of these four is worth it."""
    gains = {(OUT, OUT): (1.0, -1.0), (0, OUT): (0.0, 1.0), (OUT, 0): (-1.0, 0.0)}

    class Circle:
        at = BLOCKS[:2]

        def table(self, state: tuple[int, ...]) -> np.ndarray:
            each = np.full((2, len(SIZES)), -np.inf)
            each[:, 0] = [
                x if s == OUT else -np.inf for x, s in zip(gains.get(state, (0, 0)), state, strict=True)
            ]
            return each

        def gains(self, state: tuple[int, ...], j: int) -> np.ndarray:
            return self.table(state)[j]

    state, gained = most_probable(Circle(), 1.0, np.full(2, np.log(len(SIZES))))  # type: ignore[arg-type]
    assert state == (OUT, 0) and gained == pytest.approx(3.0)
