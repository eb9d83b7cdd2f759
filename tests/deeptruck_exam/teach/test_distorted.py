"""Distorted forces still act where and as they did, and never do nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from deeptruck_exam.teach.distorted import WAYS, distorted

DRIVES, SAMPLES = 4, 1200


def pulls() -> np.ndarray:
    """A force against motion that comes and goes, another size in every drive."""
    t = np.arange(SAMPLES) * 0.1
    return -np.arange(1, DRIVES + 1)[:, None] * 0.05 * np.maximum(np.sin(t / 7.0), 0.0)


@given(st.integers(0, 10_000))
@example(1249)  # what begins above one size and is cut at a smaller one would be nothing
def test_it_is_another_force_that_is_much_like_the_first(seed: int) -> None:
    force = pulls()
    other = distorted(force, np.random.default_rng(seed))
    assert other.shape == force.shape and np.isfinite(other).all()
    assert not np.allclose(other, force)
    alike = float(np.sum(other * force) / np.sqrt(np.sum(other**2) * np.sum(force**2)))
    assert alike > 0.5


@pytest.mark.parametrize("way", WAYS)
def test_nothing_stays_nothing_and_no_force_turns_round(way: object) -> None:
    rng = np.random.default_rng(3)
    assert not np.any(way(np.zeros((DRIVES, SAMPLES)), rng))  # type: ignore[operator]
    assert (way(pulls(), rng) <= 0.0).all()  # type: ignore[operator]


def test_the_same_seed_distorts_alike() -> None:
    a, b = (distorted(pulls(), np.random.default_rng(5)) for _ in range(2))
    assert np.array_equal(a, b)
