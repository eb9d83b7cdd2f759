"""Sizes for driving: right where the truth is, and free runs' own where fast changes mislead."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.mismatch.correction import output_error
from deeptruck_model.mismatch.posterior.search import Search
from deeptruck_model.mismatch.residual.evidence import Evidence

FREE = frozenset({"torque_gain", "brake_gain"})


def moved(e: Evidence) -> tuple[float, float]:
    """The torque gain's change that is most probable, and the one for driving."""
    search = Search(e, only=~e.held_out)
    model = search.model((), FREE)
    return model.moved("torque_gain"), output_error.refitted(search, model, 20.0).moved("torque_gain")


def test_a_gain_that_is_right_is_the_same_for_driving(nothing_missing: Evidence) -> None:
    stronger = replace(
        nothing_missing, residual=nothing_missing.residual + 0.1 * nothing_missing.sensitivity["torque_gain"]
    )
    probable, driving = moved(stronger)
    assert probable == pytest.approx(0.1, abs=0.01) and driving == pytest.approx(0.1, abs=0.02)


def test_what_acts_on_slow_changes_alone_has_its_size_by_free_runs(nothing_missing: Evidence) -> None:
    """An engine that is a tenth stronger on average and no stronger in quick changes, beside little noise."""
    e, engine = nothing_missing, nothing_missing.sensitivity["torque_gain"]
    quick = np.random.default_rng(1).normal(0.0, 0.2, len(e))
    e = replace(
        e,
        sensitivity={**e.sensitivity, "torque_gain": engine + quick},
        residual=0.01 * e.residual + 0.1 * engine,
    )
    probable, driving = moved(e)
    assert probable < 0.07 and driving == pytest.approx(0.1, abs=0.01)


def test_where_no_row_counts_sizes_stay_those_of_the_priors(nothing_missing: Evidence) -> None:
    search = Search(nothing_missing, only=np.zeros(len(nothing_missing), dtype=bool))
    model = search.model((), FREE)
    assert output_error.refitted(search, model, 20.0) is model
