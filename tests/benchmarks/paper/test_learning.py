from __future__ import annotations

import numpy as np
import pytest

from benchmarks.paper import learning


def _runs(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Features (runs, samples, 4) and noise (runs, samples)."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(40, 50, 4)), rng.normal(size=(40, 50))


def test_a_probe_finds_what_a_linear_map_gives_and_nothing_in_noise() -> None:
    (fit, noise), (test, other) = _runs(0), _runs(1)
    weights = np.array([1.0, -2.0, 0.5, 0.0])
    score, low, high = learning._score(fit, test, fit @ weights + 0.5 * noise, test @ weights + 0.5 * other)
    assert low < score < high and score == pytest.approx(5.25 / 5.5, abs=0.01)  # the share that is no noise
    score, low, _ = learning._score(fit, test, noise, other)
    assert score == pytest.approx(0.0, abs=0.02) and low < 0.0


def test_a_probe_of_classes_gives_the_share_that_is_right() -> None:
    (fit, _), (test, _) = _runs(0), _runs(1)
    score, _, _ = learning._score(fit, test, np.sign(fit[..., 0]), np.sign(test[..., 0]))
    assert score > 0.97
    score, low, high = learning._score(
        fit[..., 1:], test[..., 1:], np.sign(fit[..., 0]), np.sign(test[..., 0])
    )
    assert low < 0.5 < high or score == pytest.approx(0.5, abs=0.03)


def test_learned_is_what_lies_above_the_untrained_state() -> None:
    clear, same = [0.9, 0.88, 0.92], [0.8, 0.78, 0.89]
    scores = {target: {"state": clear, "untrained": same} for target in learning.TARGETS}
    scores["gear"] = {"state": clear, "untrained": [0.8, 0.78, 0.82]}
    assert learning.learned({"ours": scores}).endswith("do not overlap: gear (ours).")
    assert learning.learned({}).endswith(": nothing.")
