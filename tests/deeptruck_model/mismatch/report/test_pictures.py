"""The picture of a finding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_drives import evidence

from deeptruck_model.mismatch import Mismatch
from deeptruck_model.mismatch.report.pictures import binned, picture
from deeptruck_model.mismatch.verdict.result import Conclusion, Finding, Kind, Verdict

PER_SPEED = -0.005  # m/s^2 for 1 m/s


def found(effect: str, *rivals: str, depends_on: str = "speed") -> tuple[Mismatch, Finding]:
    """A finding that is exact, beside another one whose force is as large."""
    e = evidence()
    force, other = PER_SPEED * e["speed"], 0.2 * np.sin(np.arange(len(e)) / 50.0)
    f = Finding(
        Kind.PHYSICS, effect, "air_tyres_road", effect, "", "", {}, "", (depends_on,), 0.9, 0.9,
        credible_set=(effect, *rivals), force=force,
    )  # fmt: skip
    beside = replace(f, effect="load_slosh", force=other)
    e = replace(e, residual=e.residual + force + other)
    return Mismatch(Verdict(Conclusion.PHYSICS, (f, beside)), e, {}, None, ()), f


def test_bins_have_the_mean_of_the_force_and_its_error() -> None:
    rng = np.random.default_rng(0)
    x, noise = rng.uniform(0.0, 10.0, 8000), rng.normal(0.0, 0.3, 8000)
    bins = list(binned(x, 2.0 * x + noise, x < 9.0))
    assert max(at for _, at, *_ in bins) < 9.0 and len(bins) > 10
    assert np.mean([abs(middle - 2.0 * at) < error for _, at, middle, error in bins]) > 0.8
    assert [at for _, at, *_ in binned(np.round(x), noise, x < 2.4)] == [0.0, 1.0, 2.0]  # one bin a value
    assert list(binned(x, noise, np.zeros(8000, dtype=bool))) == []


@pytest.mark.parametrize(("rival", "lines"), [("", 1), ("torque_gain", 2), ("headwind", 2), ("unknown", 1)])
def test_the_law_and_the_next_name_are_drawn(rival: str, lines: int) -> None:
    drawn = picture(*found("rolling_resistance_speed", *filter(None, [rival])))
    assert drawn is not None and drawn.svg.count("<polyline") == lines
    assert drawn.rival == (rival.replace("_", " ") if lines == 2 else "")


@pytest.mark.parametrize(
    ("depends_on", "units", "over"),
    [
        ("speed", "km/h", "speed, km/h"),
        ("time since braking", "m/s", "time since braking, s"),
        ("engine torque", "m/s", "engine force per mass, m/s²"),
        ("gap", "m/s", "speed, m/s"),  # which was not recorded
    ],
)
def test_the_variable_is_that_of_the_law(depends_on: str, units: str, over: str) -> None:
    drawn = picture(*found("rolling_resistance_speed", depends_on=depends_on), units)
    assert drawn is not None and drawn.over == over


def test_nothing_compared_has_no_picture() -> None:
    whole, f = found("headwind")
    e = replace(evidence(), valid=np.zeros(len(evidence()), dtype=bool))
    assert picture(replace(whole, evidence=e), None) is None
    assert picture(replace(whole, evidence=None), f) is None
    assert picture(whole, None) is not None
