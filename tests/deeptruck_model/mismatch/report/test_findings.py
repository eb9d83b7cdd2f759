"""What a finding tells of its sizes."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from deeptruck_model.mismatch.finding import Size
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.mechanisms.air_and_tyres import WarmsInTime
from deeptruck_model.mismatch.mechanisms.brakes import Keeps, RubsFree
from deeptruck_model.mismatch.mechanisms.variants import Gate, Gated, PerRecording, Static, Sum
from deeptruck_model.mismatch.posterior.causes import Cause, Explanation
from deeptruck_model.mismatch.posterior.search import Search
from deeptruck_model.mismatch.report import findings, sizes
from deeptruck_model.mismatch.report.wording import force
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.result import Bound, Regime


def test_times_of_every_part_of_a_shape_are_told(nothing_missing: Evidence) -> None:
    """A brake that rubs for 30 s after its release was told without them, as another part stood beside."""
    gated = Gated(Static(Keeps(3.0)), Gate("speed", "above", 7.0))
    term: Any = SimpleNamespace(variant=Sum((Static(Keeps(30.0)), Static(RubsFree(200.0)), gated)))
    told = {name: size.value for name, size in sizes.picked(term, nothing_missing).items()}
    assert told == {"keeps_s": 30.0, "frees_m": 200.0}


def test_a_shape_of_one_part_tells_its_own(nothing_missing: Evidence) -> None:
    term: Any = SimpleNamespace(variant=Static(WarmsInTime(0.6)))
    assert sizes.picked(term, nothing_missing) == {"tau_s": Size(0.6, "s", picked=True)}


@pytest.mark.parametrize(("known", "unit"), [(True, "N"), (False, "m/s^2")])
def test_without_a_mass_no_force_is_told_in_newtons(
    nothing_missing: Evidence, known: bool, unit: str
) -> None:
    e = replace(nothing_missing, mass_known=known)
    search = Search(e)
    steady = next(t for t in search.candidate_terms(LIBRARY["dragging_brake"]) if t.parts[0].per_mass)
    model = search.model((steady,), frozenset())
    cause = Cause("missing_physics", "dragging_brake", 90.0, 1.0, np.full(len(e), -0.2), steady)
    x: Any = SimpleNamespace(model=model, causes=(cause,))
    found = findings.from_cause(cause, e, x, {})
    told = [*str(found.says).split(), *(size.unit for size in found.parameters.values())]
    assert unit in told and ("N" in told) == known


@pytest.mark.parametrize(("mass_kg", "said"), [(20000.0, "400 N"), (None, "0.02 m/s²")])
def test_what_would_have_been_seen_is_in_newtons_where_the_mass_is_known(
    mass_kg: float | None, said: str
) -> None:
    assert force(0.02, mass_kg) == said


def test_what_only_a_held_out_recording_has_gets_no_size(nothing_missing: Evidence) -> None:
    """It was not fitted: the page said 0 N, 95 %: -6800 to 6800."""
    search = Search(nothing_missing.to_fit())
    terms = search.candidate_terms(LIBRARY["dragging_brake"])
    term = next(t for t in terms if isinstance(t.variant, PerRecording))
    model = search.model((term,), frozenset())
    cause = Cause("missing_physics", "dragging_brake", 100.0, 1.0, term.columns.sum(axis=1), term)
    explanation = cast(Explanation, SimpleNamespace(model=model, causes=(cause,)))
    found = findings.from_cause(cause, nothing_missing, explanation, {})
    assert "force[a]" in found.parameters and "force[b]" not in found.parameters


def test_parameters_that_moved_far_beside_a_force_are_told(nothing_missing: Evidence) -> None:
    """A push that more torque made up for was told as a loss, and nothing of the torque."""
    e = replace(nothing_missing, moved={"torque_gain": 0.2, "drag_area": 0.01})
    search = Search(e)
    term = search.candidate_terms(LIBRARY["driveline_loss"])[0]
    model = search.model((term,), frozenset(search.parameters))
    far = {p for p in search.parameters if abs(e.total_change(p, model.moved(p))) >= 0.05}
    assert far == {"torque_gain"}
    cause = Cause("missing_physics", "driveline_loss", 100.0, 1.0, np.full(len(e), -0.1), term)
    for causes, told in (((cause,), True), ((cause, replace(cause, effect="torque_gain")), False)):
        x: Any = SimpleNamespace(model=model, causes=causes)
        said = str(findings.from_cause(cause, e, x, {}).says)
        assert ("Its size holds beside torque_gain +20 %" in said) == told
        assert "drag_area" not in said


def test_a_force_that_no_signal_predicts_is_told_with_the_driving_it_acts_in(
    nothing_missing: Evidence,
) -> None:
    """An axle that pushed after braking was 'F = f(t)', though a table further down had where it acts."""
    cause = Cause("missing_physics", "unknown", 500.0, 1.0, np.ones(len(nothing_missing)), time_varying=True)
    x: Any = SimpleNamespace(causes=(cause,), model=SimpleNamespace(free=frozenset()))
    found = findings.from_cause(cause, nothing_missing, x, {})
    after_braking = Regime((Bound("braking power over 60 s", 2.1, np.inf, "W/kg"),), 0.49, 0.02)
    told = findings.with_regime(found, [after_braking])
    assert told.depends_on == ("braking power over 60 s",)
    assert "49 % of it is in 2 % of the time, where braking power over 60 s > 2.1 W/kg" in str(told.says)
    assert findings.with_regime(found, [replace(after_braking, share_of_time=0.4)]) == found
    assert findings.with_regime(found, []) == found


def test_a_parameter_that_is_suspected_is_told_by_what_tells_a_wrong_one() -> None:
    """A drag area may be wrong, or change."""
    wrong, changing = (
        findings.suspicion(Cause(kind, "drag_area", 10.0, 1.0, np.zeros(3)))
        for kind in ("parameter_error", "missing_physics")
    )
    assert "both ways" in wrong.would_be_told_by and "before and after" in changing.would_be_told_by
