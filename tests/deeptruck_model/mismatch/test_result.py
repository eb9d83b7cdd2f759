"""verdict.json is written by the types alone, and stays what outside programs read."""

from __future__ import annotations

import importlib.resources
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from found_mismatches import VERDICTS, mismatch

from deeptruck_model import mismatch as tool
from deeptruck_model.mismatch.finding import Finding, Kind, Size, Suspicion
from deeptruck_model.mismatch.fit_result import Chosen, FitResult
from deeptruck_model.mismatch.posterior.causes import Cause
from deeptruck_model.mismatch.posterior.road_lock import RoadLock
from deeptruck_model.mismatch.report import findings
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.result import Bound, Conclusion, Mismatch, Verdict
from deeptruck_model.mismatch.sentence import Sentence

SCHEMA = json.loads(importlib.resources.files(tool).joinpath("verdict.schema.json").read_text())
KEPT = Path(__file__).parent / "verdicts"  # as they were written before there were types
SIZES = {"road_grade": 0.0123, "headwind": 3.4, "torque_derate": 0.11}
ROAD = RoadLock(12.8, 6.4, 0.87654, 0.41234)


def kept(name: str) -> Any:
    return json.loads((KEPT / f"{name}.json").read_text())


def equal(one: Any, other: Any) -> bool:
    """The same keys and values, but for the last digits of a computer's arithmetic."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(equal(v, other[k]) for k, v in one.items())
    if isinstance(one, list):
        return len(one) == len(other) and all(map(equal, one, other))
    if isinstance(one, float):
        return isinstance(other, float) and one == pytest.approx(other, rel=1e-6)
    return type(one) is type(other) and bool(one == other)


def had(finding: dict[str, Any]) -> dict[str, Any]:
    """The entries that a finding had then; its strength in numbers came later."""
    return {name: entry for name, entry in finding.items() if name != "strength"}


def slow_cause(e: Evidence, kind: str) -> Cause:
    """A force that no signal predicts, named by its size, by the road, or not at all."""
    force = 0.1 * np.sin(e["elapsed"] / 30.0)
    more: dict[str, Any] = {
        "slow": {"effect": "headwind", "needed": SIZES, "nearest": "road_grade"},
        "road": {"effect": "road_grade", "needed": SIZES, "road": ROAD},
        "time_varying": {"effect": "unknown", "time_varying": True, "nearest": "headwind"},
    }[kind]
    return Cause("missing_physics", gain=50.0, share=0.7, force=force, **more)


@pytest.fixture(scope="module")
def physics() -> Mismatch:
    return mismatch("missing_physics")


@pytest.mark.parametrize("kind", ["missing_physics", "unknown", "parameter_error", "measurement_fault"])
def test_a_finding_has_the_entries_it_had(kind: str) -> None:
    assert equal([had(f) for f in mismatch(kind).verdict["findings"]], kept("findings")[kind])


def test_a_strength_is_the_one_in_words_and_is_read_back() -> None:
    (found,) = mismatch("missing_physics").result.findings
    assert found.strength is not None and found.strength.unit == "N" and found.strength.one_way
    assert f"{found.strength.value:+.0f} N on average while it acts" in str(found.says)
    assert f"{100 * found.strength.share_of_time:.0f} % of the time" in str(found.says)
    again = Finding.read(found.to_json()).strength
    assert again is not None and again.value == pytest.approx(found.strength.value, rel=1e-3)
    assert mismatch("measurement_fault").result.findings[-1].strength is None


@pytest.mark.parametrize("kind", ["slow", "road", "time_varying"])
def test_a_slow_force_has_the_entries_it_had(kind: str, physics: Mismatch) -> None:
    assert physics.evidence is not None and physics.explanation is not None
    cause = slow_cause(physics.evidence, kind)
    found = findings.from_cause(cause, physics.evidence, physics.explanation, {})
    (entry,) = Verdict(Conclusion.PHYSICS, (found,)).to_json()["findings"]
    assert equal([had(entry)], kept("findings")[kind])


@pytest.mark.parametrize("name", ["parameters_off", "nothing_missing"])
def test_what_a_run_wrote_is_read_and_written_again(name: str) -> None:
    was = kept(name)
    again = Verdict.read(was).to_json()
    assert again.pop("suspicions") == []  # not told then
    assert (again["segments"], again["regimes"]) == ([], [])  # where it acts is not read
    assert again | {"segments": was["segments"], "regimes": was["regimes"]} == was


def test_suspicions_are_read_and_written_again() -> None:
    told = Verdict(Conclusion.NOTHING, suspicions=(Suspicion("headwind", 53.2, "drive both ways"),))
    entry = told.to_json()
    jsonschema.validate(entry, SCHEMA)
    assert entry["suspicions"] == [
        {"effect": "headwind", "evidence_nats": 53.2, "would_be_told_by": "drive both ways"}
    ]
    assert Verdict.read(entry).suspicions == told.suspicions


@pytest.mark.parametrize("kind", VERDICTS)
def test_every_verdict_keeps_to_the_schema(kind: str) -> None:
    jsonschema.validate(json.loads(json.dumps(mismatch(kind).verdict, allow_nan=False)), SCHEMA)


def test_a_segment_and_a_regime_are_written_rounded_and_in_words(physics: Mismatch) -> None:
    verdict = physics.verdict
    acts = {"recording": "drive <0>", "start_s": 20.0, "end_s": 50.0, "finding": 0, "mean_force_n": 1200.0}
    assert verdict["segments"][0] == acts
    where = {"where": "brake > 0.3 m/s^2", "share_of_error": 0.7, "share_of_time": 0.1}
    assert verdict["regimes"] == [where]


@pytest.mark.parametrize(
    ("low", "high", "said"),
    [(-np.inf, 3.0, "gear < 3"), (2.0, np.inf, "gear > 2"), (2.0, 3.0, "gear 2 .. 3")],
)
def test_a_bound_is_open_where_it_is_infinite(low: float, high: float, said: str) -> None:
    assert str(Bound("gear", low, high, "")) == said


def test_numbers_that_json_has_not_become_null_and_those_of_numpy_plain() -> None:
    sizes = {"force": Size(float(np.nan), "N", (np.float64(1.0), np.float64(2.0)))}
    air = Sentence.of("air moves")
    found = Finding(Kind.PHYSICS, "headwind", air, "F = 0", sizes, 0.9, Sentence.of("coast"), ())
    (entry,) = Verdict(Conclusion.PHYSICS, (found,)).to_json()["findings"]
    assert entry["parameters"]["force"] == {"value": None, "unit": "N", "ci95": [1.0, 2.0]}
    assert type(entry["parameters"]["force"]["ci95"][0]) is float and type(entry["kind"]) is str


def test_what_a_correction_holds_the_mean_of_is_read_as_it_was_written() -> None:
    fit = FitResult(("a",), 40.0, 3, Chosen.FINDINGS, ("headwind",), False, by_mean=("headwind",))
    again = FitResult.read(fit.to_json())
    assert again == fit and "by_mean" not in replace(fit, by_mean=()).to_json()
