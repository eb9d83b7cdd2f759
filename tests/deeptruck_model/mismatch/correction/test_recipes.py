"""What a correction consists of is what predicts drives best that were left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_drives import N, evidence

from deeptruck_model.mismatch.correction.recipes import (
    Judged,
    Recipe,
    best,
    judged,
    left_out_in_turn,
    needless,
    nested,
    pruned,
    subsets,
)
from deeptruck_model.mismatch.posterior.names import Named, Tree
from deeptruck_model.mismatch.rules import Limits, Rules


def test_the_error_of_a_drive_is_by_the_recipe_that_the_others_choose() -> None:
    """A recipe that is best on all by one lucky drive is worse on the others."""
    options = [
        Judged(Recipe(free=frozenset(free)), np.array([[x**2, 1.0] for x in errors]))
        for free, errors in (((), [1.0, 1.0, 1.0]), (["mass"], [0.0, 1.1, 1.1]))
    ]
    assert best(options, Rules()) is options[1]
    np.testing.assert_allclose(nested(options, Rules()), [1.0, 1.1, 1.1])


def test_of_recipes_that_are_nearly_as_good_the_smallest_is_taken() -> None:
    options = [
        Judged(Recipe(free=frozenset(free)), np.array([[square, 1.0]]))
        for free, square in (((), 1.0), (("mass", "drag_area"), 0.1), (("mass",), 0.102))
    ]
    assert best(options, Rules()) is options[2]
    tiny = [replace(x, errors=x.errors * (0.1 * Limits.speed_noise) ** 2) for x in options]
    assert best(tiny, Rules()) is tiny[0]


def test_a_part_that_other_drives_do_not_need_is_left_out() -> None:
    e = evidence(noise=0.01)
    folds = left_out_in_turn(replace(e, residual=e.residual - 0.2 * e["engine"]))
    whole = Recipe((), frozenset(["torque_gain", "brake_gain"]))
    *_, least = pruned(folds, whole, {"brake_gain": 0.2, "torque_gain": 0.9}.__getitem__, Rules())
    assert least.recipe.free == {"torque_gain"}
    assert least.rms <= judged(folds, whole).rms / Rules().better
    names = ("torque_gain", "brake_gain", "turbo_lag", "headwind")
    found = [Named(n, Tree({n: 0.7}), 9.0, np.zeros(N)) for n in names]
    assert needless(folds, whole, found, 0.9) == {"brake_gain", "turbo_lag"}  # this of the engine too
    assert needless(folds, whole, found, 0.6) == {"brake_gain"}
    assert needless(folds, Recipe((), frozenset(["brake_gain"])), found[1:2], 0.9) == set()  # a first one
    exact = left_out_in_turn(e)
    assert needless(exact, Recipe((), frozenset(["torque_gain"])), found[:1], 0.9) == {"torque_gain"}


def test_every_set_of_parameters_is_a_recipe() -> None:
    """The fewest that explain the error: here the pair."""
    e = evidence(noise=0.003)
    off = 0.2 * e.sensitivity["torque_gain"] + 0.3 * e.sensitivity["brake_gain"]
    options = list(subsets(left_out_in_turn(replace(e, residual=e.residual + off)), sorted(e.sensitivity)))
    assert len({x.recipe.free for x in options}) == 2 ** len(e.sensitivity) - 1
    assert best(options, Rules()).recipe.free == {"torque_gain", "brake_gain"}


def test_every_fitted_drive_is_driven_by_what_was_fitted_to_others() -> None:
    """A factor of the engine's force in all drives but the last is not what drives the last one best."""
    e = evidence(noise=0.003)
    last = np.arange(N) >= 2 * N // 3
    e = replace(e, residual=e.residual + np.where(last, -0.1, 0.1) * e["engine"])
    folds = left_out_in_turn(e)
    assert [np.unique(e.record[f.left_out]).tolist() for f in folds] == [[0], [1], [2]]
    none, free = (judged(folds, Recipe((), frozenset(x))) for x in ((), ("torque_gain",)))
    given, fitted = none.of_drives, free.of_drives
    assert given.shape == fitted.shape == (3,)
    speed = np.cumsum(e.residual[: round(Limits.horizons_s[0] / e.dt)]) * e.dt
    assert 0.3 * np.abs(speed[-1]) < given[0] < np.abs(speed[-1])
    assert fitted[2] > 1.5 * given[2]
    assert none.rms == pytest.approx(float(np.sqrt(np.mean(given**2))), rel=0.05)
