"""What is told of a force that no mechanism's own form tells."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.posterior.causes import Cause
from deeptruck_model.mismatch.posterior.search import Search
from deeptruck_model.mismatch.report import findings
from deeptruck_model.mismatch.report.wording import apart
from deeptruck_model.mismatch.residual.evidence import Evidence


def test_a_name_by_likeness_tells_which_form_stands_for_it(nothing_missing: Evidence) -> None:
    e = nothing_missing
    search = Search(e)
    term = search.candidate_terms(LIBRARY["headwind"])[0]
    x: Any = SimpleNamespace(
        model=search.model((term,), frozenset()),
        causes=(),
        left_over=SimpleNamespace(importance={"speed": 0.9, "brake": 0.05}, r2=0.4),
    )
    by_form = Cause(
        "missing_physics", "drag_area", 90.0, 1.0, np.full(len(e), -0.2), term,
        nearest="headwind", found_as="headwind", likeness=(("drag_area", 0.6), ("headwind", 0.4)),
    )  # fmt: skip
    told = findings.from_cause(by_form, e, x, {})
    assert (told.effect, told.nearest, told.laws_r2) == ("drag_area", "headwind", None)
    assert str(told.says).endswith("the form that fits it best is that of headwind")
    assert "headwind" in told.cannot_be_told_from
    assert "Only likeness" not in apart(told) and apart(told).startswith("It is not distinguishable from")
    by_laws = replace(by_form, term=None, nearest=None, found_as="unknown")
    told = findings.from_cause(by_laws, e, x, {})
    assert (told.nearest, told.laws_r2, told.equation) == (None, 0.4, "F = f(speed)")
    assert str(told.says).endswith("no form that is known here fits it")
