"""What a base teaches: laws alone, laws beside others that are known, and what their own names leave."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_exam.effects import EFFECTS
from deeptruck_exam.teaching.samples import UNKNOWN, Samples, samples
from deeptruck_model.mismatch import LIBRARY, NOTHING

pytestmark = pytest.mark.long  # half a minute: a truck is driven, and two hundred laws along its drives


@pytest.fixture(scope="module")
def base() -> Samples:
    return samples("third", 41)


def test_answers_are_names_parameters_and_nothing_more(base: Samples) -> None:
    parameters = {"mass", "drag_area", "rolling_resistance", "torque_gain", "brake_gain"}
    assert set(base.names.tolist()) <= set(LIBRARY) | parameters | {UNKNOWN, NOTHING}
    named = ~np.isin(base.names, [NOTHING, UNKNOWN])
    laws = [EFFECTS.get(law.removesuffix("~")) for law in base.laws[named]]
    of_laws = [law.name == name for law, name in zip(laws, base.names[named], strict=True) if law is not None]
    assert len(of_laws) > 150 and all(of_laws)


def test_nothing_more_is_missing_beside_names_alone(base: Samples) -> None:
    given = base.fingerprint.given.there
    nothing = base.names == NOTHING
    assert nothing.sum() > 30 and given[nothing].all()
    assert (given & ~nothing).sum() > 60 and (~given).sum() > 150


def test_a_known_name_explains_what_is_its_own(base: Samples) -> None:
    """Beside its own name far less of a law is left than it was."""
    f = base.fingerprint
    told = (base.names == NOTHING) & (f.given.explained > 100.0)
    assert told.sum() > 20
    assert np.median(f.held.nats.max(axis=0)[told] / f.given.explained[told]) < 0.4
