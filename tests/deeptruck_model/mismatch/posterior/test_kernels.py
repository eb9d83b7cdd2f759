"""A name as a kernel: what its candidate terms may do, in few directions."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from small_drives import N, evidence

from deeptruck_model.mismatch.mechanisms import LIBRARY, candidate_terms
from deeptruck_model.mismatch.posterior import kernels as k
from deeptruck_model.mismatch.posterior.kernels import Kernel, kernels
from deeptruck_model.mismatch.posterior.regression import FREE, Regression
from deeptruck_model.mismatch.rules import Limits

FEW = ("clock_offset", "headwind", "drag_area", "engine_brake", "brake_fade")


@cache
def search() -> Regression:
    return Regression(evidence(), exclude=set(LIBRARY) - set(FEW))


def named(name: str, part: str = "law") -> Kernel:
    (found,) = (x for x in kernels(search()) if (x.name, x.part) == (name, part))
    return found


def test_there_is_one_of_every_name_of_every_parameter_and_of_no_name() -> None:
    names = {x.name for x in kernels(search())}
    assert names <= {*FEW, "torque_gain", "brake_gain", k.UNKNOWN}
    assert {"headwind", "torque_gain", "brake_gain", k.UNKNOWN} <= names
    assert kernels(search()) is kernels(search())


def test_a_parameter_is_its_sensitivity_times_what_is_plausible() -> None:
    own = named("brake_gain", "parameter")
    expected = FREE["brake_gain"] * search().e.sensitivity["brake_gain"]
    np.testing.assert_allclose(own.features, expected[:, None])


def test_few_directions_hold_what_the_forms_do() -> None:
    """Nearly all of every form of a headwind that does not vary in time."""
    features = named("headwind").features.astype(float)
    assert features.shape[1] <= k.WITH_ERROR
    for term in candidate_terms(LIBRARY["headwind"], search().e):
        if not term.varies_in_time:
            left = term.columns - features @ np.linalg.lstsq(features, term.columns, rcond=None)[0]
            assert np.sum(left**2) < 1e-3 * np.sum(term.columns**2)


def test_what_varies_in_time_is_a_kernel_of_its_own_and_less_probable() -> None:
    law, varying = named("headwind"), named("headwind", "in time")
    assert law.features.shape[1] < varying.features.shape[1] <= k.IN_TIME
    assert varying.chance == pytest.approx(Limits.not_always * law.chance)


def test_a_law_holds_its_own_force_times_functions_of_signals() -> None:
    """A brake that fades, and does so twice as much at speed; not beside a learned simulator."""
    rows, e = search().rows, search().e
    learned = Regression(replace(e, model_discrepancy=0.05), exclude=set(LIBRARY) - set(FEW))
    (law,) = (x.features for x in kernels(learned) if (x.name, x.part) == ("brake_fade", k.LAWS))
    faster = (law[:, 0] * (1.0 + np.tanh((e["speed"] - 15.0) / 5.0)))[rows].astype(float)
    left = []
    for X in (named("brake_fade").features[rows].astype(float), law[rows].astype(float)):
        left.append(float(np.sum((faster - X @ np.linalg.lstsq(X, faster, rcond=None)[0]) ** 2)))
    assert left[0] < 0.3 * left[1] and left[1] > 0.03 * np.sum(faster**2)
    assert named("brake_fade").features.shape[1] <= k.WITH_ERROR


def test_only_a_force_that_can_have_no_other_sign_has_one() -> None:
    signed = [x for x in kernels(search()) if x.sign is not None]
    assert {x.name for x in signed} <= {"engine_brake", "brake_fade"} and signed
    for x in signed:
        assert x.sign is not None and x.sign.shape == (N,)


def test_features_are_stored_in_single_precision_and_orthogonal() -> None:
    features = named("headwind").features
    assert features.dtype == np.float32
    part = features[search().rows].astype(float)
    gram = part.T @ part
    scale = np.sqrt(np.diag(gram))
    np.testing.assert_allclose(gram / np.outer(scale, scale), np.eye(len(gram)), atol=2e-2)


def test_rows_that_are_left_out_leave_the_kernels_as_they_are() -> None:
    rows = np.zeros(N, dtype=bool)
    rows[100:200] = True
    other = k.without(search(), rows)
    assert kernels(other) is kernels(search())
    assert not set(other.rows) & set(range(100, 200))
    assert set(range(100, 200)) <= set(search().rows)


def test_the_order_of_forms_does_not_matter() -> None:
    terms = candidate_terms(LIBRARY["engine_brake"], search().e)
    made = (k._of_terms(search(), own, k._factors(search())) for own in (terms, terms[::-1]))
    for one, other in zip(*made, strict=True):
        assert (one.part, one.chance) == (other.part, other.chance)
        np.testing.assert_array_equal(one.features, other.features)


def test_what_no_name_explains_holds_no_force_of_a_parameter() -> None:
    rows, e = search().rows, search().e
    free = named(k.UNKNOWN).features[rows]
    for force in e.sensitivity.values():
        own = force[rows]
        power = np.linalg.norm(free, axis=0) * np.linalg.norm(own)
        assert np.abs(own @ free).max() < 1e-3 * power.max()
