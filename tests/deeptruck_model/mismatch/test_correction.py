"""What goes into a corrected simulator: what is of use on drives that were not fitted, and nothing else."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from deeptruck_model import trucks
from deeptruck_model.mismatch import correction
from deeptruck_model.mismatch.causes import Cause
from deeptruck_model.mismatch.evidence import Evidence
from deeptruck_model.mismatch.mechanisms import LIBRARY, Shape, comes_and_goes
from deeptruck_model.mismatch.search import Search

TRUCK = trucks.load("trucksim")


def law_and_gusts(e: Evidence) -> tuple[Shape, Shape]:
    search = Search(e)
    law = search.shapes(LIBRARY["driveline_loss"])[0]
    gusts = next(s for s in search.shapes(LIBRARY["headwind"]) if comes_and_goes(s))
    return law, gusts


@pytest.fixture
def options(nothing_missing: Evidence, monkeypatch: pytest.MonkeyPatch) -> list[tuple[set[str], set[str]]]:
    """(terms, parameters) of every correction that is driven; the simplest one drives best."""
    driven: list[tuple[set[str], set[str]]] = []

    def rmse(truck: correction.CorrectedTruck, prepared: object) -> float:
        driven.append(({t.effect for t in truck.terms}, set(truck.moved)))
        return float(len(truck.terms) + len(truck.moved))

    monkeypatch.setattr(correction, "_rmse", rmse)
    return driven


def test_of_all_that_was_found_the_part_goes_in_that_drives_best(
    nothing_missing: Evidence, options: list[tuple[set[str], set[str]]]
) -> None:
    e = nothing_missing
    law, gusts = law_and_gusts(e)
    model = Search(e).model((law, gusts), frozenset({"torque_gain", "brake_gain"}))
    causes = tuple(
        Cause(kind, effect, 90.0, 0.3, 0.9, np.zeros(len(e)), shape)
        for kind, effect, shape in (
            ("missing_physics", "driveline_loss", law),
            ("missing_physics", "headwind", gusts),
            ("parameter_error", "brake_gain", None),
        )
    )
    tuned, after = correction.correct(TRUCK, e, SimpleNamespace(causes=causes, model=model), [])
    assert set(tuned.moved) == {"torque_gain", "brake_gain"} and not tuned.terms
    laws, everything = {"driveline_loss"}, {"driveline_loss", "headwind"}
    moved, stated = {"torque_gain", "brake_gain"}, {"brake_gain"}
    assert options == [(everything, moved), (laws, moved), (everything, stated), (laws, stated)]
    assert ({t.effect for t in after.terms}, set(after.moved)) == (laws, stated)


def test_what_was_not_stated_never_goes_in(
    nothing_missing: Evidence, options: list[tuple[set[str], set[str]]]
) -> None:
    law, gusts = law_and_gusts(nothing_missing)
    model = Search(nothing_missing).model((law, gusts), frozenset())
    cause = Cause("missing_physics", "driveline_loss", 90.0, 1.0, 0.9, np.zeros(len(nothing_missing)), law)
    _, after = correction.correct(TRUCK, nothing_missing, SimpleNamespace(causes=(cause,), model=model), [])
    assert [t.effect for t in after.terms] == ["driveline_loss"] and not after.moved
    assert options == []  # there was nothing to choose


def test_no_parameter_goes_where_no_truck_is(nothing_missing: Evidence) -> None:
    stronger = 1.6 * nothing_missing.sensitivity["brake_gain"]  # brakes 2.6 times as strong
    e = replace(nothing_missing, residual=nothing_missing.residual + stronger)
    model = Search(e).model((), frozenset())
    tuned, after = correction.correct(TRUCK, e, SimpleNamespace(causes=(), model=model), [])
    assert tuned.moved["brake_gain"] == 1.0 and not after.moved
