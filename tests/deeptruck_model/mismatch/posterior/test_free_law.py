"""What no name explains is found as laws of the signals, and nothing is found in noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from deeptruck_model.constants import GRAVITY
from deeptruck_model.mismatch.expression import Slosh
from deeptruck_model.mismatch.mechanisms import LIBRARY, CandidateTerm, law_signal, laws, leans_on
from deeptruck_model.mismatch.mechanisms.laws import Law
from deeptruck_model.mismatch.posterior.causes import Cause
from deeptruck_model.mismatch.posterior.explain import explain
from deeptruck_model.mismatch.posterior.free_law import left_over
from deeptruck_model.mismatch.posterior.search import Search
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Rules


def swing(e: Evidence) -> np.ndarray:
    """A trailer that swings at 0.9 Hz on its hitch: too fast for a second's mean."""
    return 0.25 * Slosh((law_signal("simulated"),), 0.9, 0.1).rows(e)


def band(e: Evidence) -> np.ndarray:
    """Torque that is lost within a band of speed."""
    return -0.5 * e["engine"] * np.exp(-(((e["speed"] - 18.0) / 2.0) ** 2))


def test_in_noise_there_is_no_law(nothing_missing: Evidence) -> None:
    search = Search(nothing_missing)
    found = left_over(search, search.background(()))
    assert found.gain < Rules.weak / 2
    assert explain(search).causes == ()


def touch(e: Evidence) -> np.ndarray:
    """Brakes of which half is missing in the first second of every application."""
    since = law_signal("time since the brake was off").rows(e)
    return 0.5 * e["brake"] * np.clip(1.4 - since, 0.0, 1.0)


@pytest.mark.parametrize(
    ("force", "of"), [(swing, "simulated"), (band, "speed"), (touch, "time since the brake was off")]
)
def test_a_force_without_a_name_is_told_by_what_it_follows(
    force: Callable[[Evidence], np.ndarray], of: str, nothing_missing: Evidence
) -> None:
    e = replace(nothing_missing, residual=nothing_missing.residual + force(nothing_missing))
    search = Search(e, exclude=LIBRARY)
    found = left_over(search, search.background(()))
    assert found.lawful is not None and found.gain > 2 * Rules.weak
    assert next(iter(found.free.importance)) == of
    assert np.corrcoef(found.free.prediction, force(e))[0, 1] > 0.8
    assert [c.effect for c in explain(search).causes] == ["unknown"]


def of_law(term: CandidateTerm) -> Law:
    constants = term.variant.constants
    return constants if isinstance(constants, Law) else Law("", "", ())


def test_a_law_is_its_carrier_shared_out_among_knots(nothing_missing: Evidence) -> None:
    shared = [s for s in laws(nothing_missing) if of_law(s).carrier == "brake"]
    assert shared
    for s in shared:
        np.testing.assert_allclose(s.columns.sum(axis=1), nothing_missing["brake"], atol=1e-12)
        assert leans_on(of_law(s)) == (of_law(s).of, "brake")


def test_laws_of_signals_that_were_not_recorded_are_not_tried(nothing_missing: Evidence) -> None:
    used = {of_law(s).of for s in laws(nothing_missing)}
    assert "speed" in used and not used & {"ratio", "gap", "time since a shift"}


def test_a_law_of_a_names_own_signals_is_another_form_of_it(nothing_missing: Evidence) -> None:
    e = replace(nothing_missing, residual=nothing_missing.residual + band(nothing_missing))
    search = Search(e, exclude=LIBRARY)
    found = left_over(search, search.background(()))
    everything = Search(e)
    loss, fade = (everything.candidate_terms(LIBRARY[name])[0] for name in ("driveline_loss", "brake_fade"))
    assert found.is_form_of(loss, e) and not found.is_form_of(fade, e)
    assert not left_over(Search(nothing_missing), Search(nothing_missing).background(())).is_form_of(loss, e)


def test_a_name_of_another_form_may_also_be_something_else(nothing_missing: Evidence) -> None:
    cause = Cause("missing_physics", "driveline_loss", 90.0, 0.5, np.zeros(1), rivals=(("mass", 2.0),))
    assert cause.not_told_from == ["mass"]
    assert replace(cause, other_form=True).not_told_from == ["unknown", "mass"]


def test_a_slope_that_is_told_late_is_no_law(nothing_missing: Evidence) -> None:
    e = nothing_missing
    bumps = gaussian_filter1d(np.random.default_rng(3).normal(size=len(e)), 5.0 / e.dt)
    grade = 0.03 * bumps / bumps.std()
    told = e.lag(grade, 2.0)
    simulated = e.simulated - GRAVITY * told
    late = replace(
        e,
        simulated=simulated,
        signals=e.signals | {"grade": told, "simulated": simulated},
        residual=e.residual - GRAVITY * (grade - told),
    )
    search = Search(late, exclude=LIBRARY)
    assert left_over(search, search.background(())).gain < Rules.weak / 2
