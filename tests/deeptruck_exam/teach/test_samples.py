"""What a base gives: laws alone, laws beside others that are known, and what their own names leave."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_exam.grammar import grammar
from deeptruck_exam.laws import EFFECTS
from deeptruck_exam.laws.catalogue import UNKNOWN
from deeptruck_exam.teach.samples import Samples, samples
from deeptruck_model.mismatch import LIBRARY, NOTHING

pytestmark = pytest.mark.long  # a minute: trucks are driven, and laws added along their drives

PARAMETERS = {"mass", "drag_area", "rolling_resistance", "torque_gain", "brake_gain"}


@pytest.fixture(scope="module")
def base() -> Samples:
    return samples("grammar", 41)


def test_answers_are_names_parameters_and_nothing_more(base: Samples) -> None:
    named = set(base.names.tolist())
    assert named <= set(LIBRARY) | PARAMETERS | {UNKNOWN, NOTHING, "grade_bias"}
    assert {UNKNOWN, NOTHING, "mass"} <= named and len(named & set(grammar.names())) > 20
    assert np.isfinite(base.kernels.held.nats).all()
    assert named <= base.kernels.names | {UNKNOWN, NOTHING}


def test_nothing_more_is_missing_beside_names_alone(base: Samples) -> None:
    given, nothing = base.kernels.given.there, base.names == NOTHING
    assert nothing.sum() > 20 and given[nothing].all()
    assert (given & ~nothing).sum() > 40 and (~given).sum() > 150


def test_a_known_name_explains_what_is_its_own(base: Samples) -> None:
    """Beside its own name less is left of a law than beside a name it is taken for."""
    f = base.kernels
    large = f.given.explained > 100.0
    left = f.held.nats.max(axis=0)[large] / f.given.explained[large]
    own = base.names[large] == NOTHING
    assert own.sum() > 15 and (~own).sum() > 15
    assert np.median(left[own]) < np.median(left[~own])


def test_the_laws_of_the_score_are_judged_and_none_is_trained_on(
    base: Samples, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deeptruck_exam.teach.samples.MINUTES", 1.0)
    judged = samples("laws", 43)
    assert {EFFECTS[law].name for law in judged.laws.tolist()} == set(judged.names.tolist())
    assert len(judged.laws) > 45 and not set(judged.laws.tolist()) & set(base.laws.tolist())
