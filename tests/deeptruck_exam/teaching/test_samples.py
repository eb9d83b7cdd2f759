"""What a base teaches: laws alone, laws beside others that are known, and what their own names leave."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_exam.effects import EFFECTS
from deeptruck_exam.teaching.samples import UNKNOWN, Samples, samples
from deeptruck_model.mismatch import LIBRARY, NOTHING

pytestmark = pytest.mark.long  # minutes: two trucks are driven, and laws along the drives of each


@pytest.fixture(scope="module", params=[("third", 41), ("first", 7)], ids=["third", "first"])
def base(request: pytest.FixtureRequest) -> Samples:
    return samples(*request.param)


def test_answers_are_names_parameters_and_nothing_more(base: Samples) -> None:
    parameters = {"mass", "drag_area", "rolling_resistance", "torque_gain", "brake_gain"}
    assert set(base.names.tolist()) <= set(LIBRARY) | parameters | {UNKNOWN, NOTHING, "grade_bias"}
    assert {UNKNOWN, NOTHING, "mass"} <= set(base.names.tolist())
    named = ~np.isin(base.names, [NOTHING, UNKNOWN])
    laws = [EFFECTS.get(law.removesuffix("~")) for law in base.laws[named]]
    of_laws = [law.name == name for law, name in zip(laws, base.names[named], strict=True) if law is not None]
    assert len(of_laws) > 150 and all(of_laws)


def test_an_answer_is_among_the_names_of_its_fingerprint(base: Samples) -> None:
    assert np.isfinite(base.fingerprint.held.nats).all()
    assert set(base.names.tolist()) <= base.fingerprint.names | {UNKNOWN, NOTHING}


def test_nothing_more_is_missing_beside_names_alone(base: Samples) -> None:
    given = base.fingerprint.given.there
    nothing = base.names == NOTHING
    assert nothing.sum() > 30 and given[nothing].all()
    assert (given & ~nothing).sum() > 60 and (~given).sum() > 150


def test_a_known_name_explains_what_is_its_own(base: Samples) -> None:
    """Beside its own name less is left of a law than beside a name it is taken for, of many less than half.

    How much is left of most depends on the laws that are drawn, as some have a form of their own.
    """
    f = base.fingerprint
    told = f.given.explained > 100.0
    left = f.held.nats.max(axis=0)[told] / f.given.explained[told]
    own = base.names[told] == NOTHING
    assert own.sum() > 20 and (~own).sum() > 20
    assert np.median(left[own]) < np.median(left[~own])
    assert np.mean(left[own] < 0.5) > 0.25
