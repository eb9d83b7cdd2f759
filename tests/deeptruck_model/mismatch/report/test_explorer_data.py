"""Columns of the page's explorer."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
import pytest

from deeptruck_model.mismatch.correction.fit_result import Errors
from deeptruck_model.mismatch.report.explorer_data import along, packed


def unpacked(column: dict[str, Any]) -> np.ndarray[Any, np.dtype[np.float64]]:
    codes = np.frombuffer(base64.b64decode(column["codes"]), "<u2")
    return np.where(codes == 65535, np.nan, column["low"] + column["by"] * codes)


def test_a_column_is_kept_to_a_65_thousandth_of_its_range() -> None:
    x = np.random.default_rng(0).normal(12.0, 5.0, 500)
    x[40:60] = np.nan
    column = packed(x, 0.1, 1)
    assert column["step"] == 0.1
    np.testing.assert_allclose(unpacked(column), x, atol=float(np.nanmax(x) - np.nanmin(x)) / 65534)


@pytest.mark.parametrize(("x", "kept"), [(np.full(6, 3.5), 3.5), (np.full(6, np.nan), np.nan)])
def test_what_is_constant_or_unknown_is_kept(x: np.ndarray[Any, Any], kept: float) -> None:
    np.testing.assert_array_equal(unpacked(packed(x, 0.1, 1)), np.full(6, kept))


def test_means_are_those_of_known_samples_and_an_end_that_is_too_short_is_left_out() -> None:
    column = packed(np.array([1.0, 3.0, np.nan, 5.0, np.nan, np.nan, 9.0]), 0.1, 2)
    assert column["step"] == 0.2
    np.testing.assert_allclose(unpacked(column), [2.0, 5.0, np.nan], atol=1e-4)


def test_the_free_runs_of_one_drive_stand_where_they_began() -> None:
    speed = np.array([[1.0, 1.0], [2.0, 2.0], [3.0, 3.0]])
    errors = Errors(speed, speed, np.array([0, 1, 1]), np.array([0, 2, 3]))
    np.testing.assert_array_equal(along(errors, 1, 6), [np.nan, np.nan, 2.0, 2.0, 3.0, np.nan])
