"""Which names a cause is not distinguishable from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.mismatch.mechanisms import LIBRARY, CandidateTerm, candidate_terms, is_time_varying
from deeptruck_model.mismatch.posterior.causes import Cause
from deeptruck_model.mismatch.posterior.windows import during
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Rules

RIVALS = (("drafting", 5.0), ("drag_area", 20.0), ("road_grade", 27.0), ("mass", 40.0))


def cause(term: CandidateTerm | None, gain: float = 100.0, **more: bool) -> Cause:
    return Cause("missing_physics", "headwind", gain, 0.5, 0.9, np.zeros(1), term, RIVALS, **more)


@pytest.fixture
def lasting(nothing_missing: Evidence) -> CandidateTerm:
    return next(
        s for s in candidate_terms(LIBRARY["driveline_loss"], nothing_missing) if not is_time_varying(s)
    )


def test_the_less_is_told_the_wider_the_group(nothing_missing: Evidence, lasting: CandidateTerm) -> None:
    """15 % of the gain for a law, more for what is time-varying, most for a few windows."""
    gusts = next(s for s in candidate_terms(LIBRARY["headwind"], nothing_missing) if is_time_varying(s))
    rare = during(lasting, [(0, 10.0, 20.0)], nothing_missing)
    names = [len(cause(s).not_told_from) for s in (lasting, gusts, rare)]
    assert names == [1, 2, 3]
    assert cause(None).not_told_from == cause(lasting).not_told_from


def test_few_nats_are_never_enough(lasting: CandidateTerm) -> None:
    assert cause(lasting, gain=20.0).not_told_from == ["drafting"]


def test_another_form_may_be_something_unknown(lasting: CandidateTerm) -> None:
    assert cause(lasting, other_form=True).not_told_from == ["drafting", "unknown"]
    doubted = replace(cause(lasting, other_form=True), rivals=(("unknown", 0.0),))
    assert doubted.not_told_from == ["unknown"]  # once


def test_a_name_is_believed_no_more_than_such_names_proved_right(lasting: CandidateTerm) -> None:
    alone = replace(cause(lasting), rivals=())
    assert alone.believed == min(alone.probability, Rules.most_probable[0])
    beside = replace(alone, probability=0.99, rivals=tuple((name, 1.0) for name in ("a", "b", "c")))
    assert beside.believed == Rules.most_probable[-1]
    assert replace(beside, probability=0.1).believed == 0.1
    assert replace(beside, kind="parameter_error").believed == 0.99
    assert replace(alone, effect="unknown").believed == Rules.most_probable_unknown
