"""The form that is told is the one that was fitted."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from deeptruck_model.mismatch.mechanisms import LIBRARY, CandidateTerm
from deeptruck_model.mismatch.mechanisms.variants import (
    Gate,
    Gated,
    OwnCurve,
    PerRecording,
    Spline,
    Static,
    Sum,
    Variant,
)
from deeptruck_model.mismatch.report import form
from deeptruck_model.mismatch.residual.evidence import PER_KILOGRAM, Evidence
from deeptruck_model.mismatch.sentence import Sentence

TIME, SPEED = OwnCurve(2, (0.2, 6.0), 1.0), OwnCurve(4, (60.0, 130.0), 1.0)


def term(variant: Variant) -> CandidateTerm:
    prior: Any = None
    return CandidateTerm(LIBRARY["engine_brake"], variant, (), np.zeros((0, 0)), prior, 1.0)


def told(variant: Variant) -> str:
    return str(Sentence.of(*form.curved(term(variant), PER_KILOGRAM)))


def test_the_known_form_alone_needs_no_word() -> None:
    assert told(Static()) == ""
    assert form.equation(term(Static())) == LIBRARY["engine_brake"].equation


def test_one_curve_is_told_with_when_it_acts() -> None:
    assert told(SPEED) == ". It is a curve of its own over engine speed while coasting with the brake on"
    assert form.equation(term(SPEED)) == "F = f1(engine speed)"


def test_a_sum_tells_each_part_and_its_own_regime() -> None:
    variant = Sum((Gated(SPEED, Gate("speed", "above", 4.4)), TIME, Static()))
    said = told(variant)
    assert said.startswith(". It is the sum of a curve of its own over engine speed while coasting with the")
    assert "brake on where the speed is above 4.4 m/s, a curve of its own over time while coasting" in said
    assert said.endswith(" and the known form")
    equation = form.equation(term(variant))
    assert equation.startswith("F = f1(engine speed) + f2(time) + F0;  F0: F = -c n(w) r")


def test_a_regime_of_all_is_not_told_of_each() -> None:
    gate = Gate("speed", "above", 4.4)
    assert "4.4" not in told(Sum((Gated(SPEED, gate), Gated(TIME, gate))))


def test_what_belongs_to_a_place_says_how_places_are_known(nothing_missing: Evidence) -> None:
    own = Spline("distance", (4,), ("a", "b"), 100.0, 0.2, 0.5)
    again = term(replace(own, shared=True))
    assert form.at_places(term(own), nothing_missing) == ""
    assert "taken to start at one place" in form.at_places(again, nothing_missing)
    elsewhere = nothing_missing.signals | {"place": nothing_missing["distance"] + 300.0}
    said = form.at_places(again, replace(nothing_missing, signals=elsewhere))
    assert "told by positions" in said and "elsewhere with its mean" in said


def test_a_size_that_varies_is_said_where_it_was_fitted() -> None:
    varies = term(Spline("elapsed", (4, 3), ("a", "b"), 30.0, 0.1, 0.5))
    along = term(Spline("distance", (4,), ("a",), 100.0, 0.2, 0.5))
    own = term(PerRecording(("a", "b"), 0.5))
    assert form.courses(varies) == ". Its size varies in time"
    assert form.courses(along) == ". Its size varies along the road"
    assert form.courses(own) == ". Its size is each recording's own"
    assert form.courses(term(Static())) == ""
    assert form.equation(varies) == f"{LIBRARY['engine_brake'].equation}; size varies in time"
