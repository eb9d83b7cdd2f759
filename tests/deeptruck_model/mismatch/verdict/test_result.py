"""verdict.json is written by the types alone."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_core.json_data import from_json, to_json
from deeptruck_model.mismatch.correction.fit_result import FitResult, Refitted, WithoutExogenous
from deeptruck_model.mismatch.verdict.result import Bound, Conclusion, Finding, Kind, Segment, Size, Verdict


def finding(sizes: dict[str, Size]) -> Finding:
    return Finding(
        Kind.PHYSICS, "headwind", "air_tyres_road", "headwind", "air moves against the truck", "F = 0", sizes,
        "coast both ways", ("speed",), 0.92, 0.95, ("drag_area",), in_drives=("a",), share_of_error=0.4,
        missing_input="gear",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("low", "high", "said"),
    [(-np.inf, 3.0, "gear < 3"), (2.0, np.inf, "gear > 2"), (2.0, 3.0, "gear 2 .. 3")],
)
def test_a_bound_is_open_where_it_is_infinite(low: float, high: float, said: str) -> None:
    assert str(Bound("gear", low, high, "")) == said


def test_numbers_that_json_has_not_become_null_and_those_of_numpy_plain() -> None:
    found = finding({"force": Size(float(np.nan), "N", (np.float64(1.0), np.float64(2.0)))})
    (entry,) = Verdict(Conclusion.PHYSICS, (found,)).to_json()["findings"]
    assert entry["parameters"]["force"] == {"value": None, "unit": "N", "ci95": [1.0, 2.0]}
    assert type(entry["parameters"]["force"]["ci95"][0]) is float and type(entry["kind"]) is str


def test_a_finding_is_read_as_it_was_written() -> None:
    found = finding({"speed": Size(3.4, "m/s", (3.0, 3.8))})
    (entry,) = Verdict(Conclusion.PHYSICS, (found,)).to_json()["findings"]
    assert from_json(Finding, entry) == found


def test_no_newtons_without_a_mass() -> None:
    assert to_json(Segment("a", 1.0, 2.0, 0, None, 0, 1, 1.0))["mean_force_n"] is None


def test_a_fit_is_read_as_it_was_written() -> None:
    fit = FitResult(
        ("a",), 40.0, 3, ("headwind",),
        without_exogenous=WithoutExogenous(("gap",), 0.3), offered="as_given",
        refit={"mass": Refitted(0.1, (0.05, 0.15), 11000.0, "kg", (10500.0, 11500.0))},
    )  # fmt: skip
    assert from_json(FitResult, to_json(fit)) == fit
