"""Regression under coloured, heavy-tailed, uneven noise: what it must recover and what must not move it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter
from small_drives import loss

from deeptruck_model.mismatch.residual.noise import ORDER, Prior, Series, fit, whiten
from deeptruck_model.mismatch.rules import Rules

N, COLOUR = 4000, np.array([0.6, 0.2])


def noise(seed: int, sigma: float = 0.05) -> np.ndarray:
    innovations = sigma * np.random.default_rng(seed).standard_t(5, N)
    return lfilter([1.0], np.concatenate([[1.0], -COLOUR]), innovations)


def series(y: np.ndarray, valid=None, relative=None) -> Series:
    starts = np.zeros(len(y), dtype=bool)
    starts[[0, len(y) // 2]] = True
    valid = np.ones(len(y), dtype=bool) if valid is None else valid
    return Series(y, valid, starts, np.ones(len(y)) if relative is None else relative)


def prior(k: int, sign: float = 0.0, sd: float = 1.0) -> Prior:
    return Prior(np.zeros(k), np.full(k, sd), np.full(k, sign))


def columns(seed: int, k: int = 2) -> np.ndarray:
    steps = np.random.default_rng(seed).normal(0.0, 0.1, (N, k))
    return lfilter([1.0], [1.0, -0.98], steps, axis=0)


def test_coefficients_are_found_beside_coloured_noise() -> None:
    X, truth = columns(0), np.array([0.3, -0.2])
    found = np.array([fit(series(X @ truth + noise(seed)), X, prior(2)).b for seed in range(20)])
    assert found.mean(axis=0) == pytest.approx(truth, abs=0.01)
    assert np.abs(found - truth).max() < 0.1


def test_colour_and_size_of_the_noise_are_found() -> None:
    found = fit(series(noise(1)), np.zeros((N, 0)), prior(0))
    assert found.ar[:2] == pytest.approx(COLOUR, abs=0.06) and np.abs(found.ar[2:]).max() < 0.06
    assert found.sigma == pytest.approx(0.05, rel=0.08)
    assert np.nanstd(found.innovations) == pytest.approx(np.sqrt(5 / 3), rel=0.1)  # Student-t of 5


def test_whitening_inverts_the_autoregression() -> None:
    innovations = np.random.default_rng(2).normal(size=N)
    coloured = lfilter([1.0], np.concatenate([[1.0], -COLOUR]), innovations)
    rows = np.flatnonzero(np.arange(N) % 7 > 1)[ORDER:]
    ar = np.concatenate([COLOUR, np.zeros(ORDER - len(COLOUR))])
    assert whiten(coloured, ar, rows) == pytest.approx(innovations[rows])
    both, weight = np.stack([coloured, 2 * coloured], axis=1), np.linspace(1.0, 2.0, len(rows))
    expected = innovations[rows, None] * [1.0, 2.0] * weight[:, None]
    assert whiten(both, ar, rows, weight) == pytest.approx(expected)


def test_a_coefficient_of_impossible_sign_is_zero() -> None:
    X = columns(5)
    found = fit(series(noise(6) - 0.3 * X[:, 0] + 0.2 * X[:, 1]), X, prior(2, sign=1.0))
    assert found.b[0] == 0.0
    assert found.b[1] == pytest.approx(0.2, abs=0.05)


def test_invalid_samples_and_what_follows_them_do_not_matter() -> None:
    X, y = columns(7), noise(8)
    valid = np.ones(N, dtype=bool)
    valid[1000:1100] = False
    spoilt = y.copy()
    spoilt[1000:1100] = 1e3
    one, two = (fit(series(x + 0.3 * X[:, 0], valid), X, prior(2)) for x in (y, spoilt))
    assert two.b == pytest.approx(one.b, abs=1e-9) and two.sigma == pytest.approx(one.sigma)
    use = series(y, valid).usable()
    assert not use[1000 : 1100 + ORDER].any() and use[1100 + ORDER]
    assert not use[N // 2 : N // 2 + ORDER].any()  # nor are recordings joined


def test_doubtful_samples_count_less() -> None:
    X, y = np.ones((N, 1)), noise(9)
    y[:400] += 1.0
    relative = np.ones(N)
    relative[:400] = 30.0
    trusting, doubting = (fit(series(y, relative=r), X, prior(1)) for r in (np.ones(N), relative))
    assert abs(doubting.b[0]) < 0.5 * abs(trusting.b[0])


def test_without_noise_rounding_is_not_significant() -> None:
    X = columns(10)
    y = 1e-5 * np.sin(np.arange(N) / 7.0) + 1e-5 * X[:, 0]
    null, one = fit(series(y), X[:, :0], prior(0)), fit(series(y), X[:, :1], prior(1))
    assert null.sigma == Rules.noise_floor and loss(one) > loss(null) - 1.0


@pytest.mark.parametrize("sigma", [0.0, 0.01])
def test_a_force_that_acts_now_and_then_is_no_noise(sigma: float) -> None:
    """One wheel slip in an hour, beside nothing else, had set the autoregression and was called noise."""
    force = np.zeros(N)
    force[1000:1019] = -0.4 * np.sin(np.linspace(0.3, np.pi - 0.3, 19))
    y = force + noise(13, sigma)
    null, one = (fit(series(y), X, prior(X.shape[1])) for X in (np.zeros((N, 0)), force[:, None]))
    assert loss(one) < loss(null) - 80.0
    assert one.b == pytest.approx(1.0, abs=0.2)


def test_where_no_sample_counts_the_prior_is_all_that_is_known() -> None:
    found = fit(series(noise(6), np.zeros(N, dtype=bool)), columns(6), prior(2))
    assert (found.b == 0.0).all()
    assert found.sigma == Rules.noise_floor and np.isnan(found.innovations).all()
