"""How sure a name is beside laws that have none, and what stands beside 'unknown'."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from deeptruck_model.mismatch.mechanisms import LIBRARY, CandidateTerm, candidate_terms, is_time_varying
from deeptruck_model.mismatch.posterior import explain, stepwise
from deeptruck_model.mismatch.posterior.causes import Cause
from deeptruck_model.mismatch.posterior.search import Search
from deeptruck_model.mismatch.posterior.slow_force import SlowForce
from deeptruck_model.mismatch.posterior.windows import during, within
from deeptruck_model.mismatch.residual.evidence import Evidence


def cause(e: Evidence, gain: float = 200.0, term: CandidateTerm | None = None) -> Cause:
    rivals = (("headwind", 10.0), ("accessory_load", 150.0))
    effect = term.mechanism.effect if term is not None else "torque_derate"
    return Cause("missing_physics", effect, gain, 0.9, np.zeros(len(e)), term, rivals)


@pytest.fixture(scope="module")
def gusts(nothing_missing: Evidence) -> CandidateTerm:
    terms = Search(nothing_missing).candidate_terms(LIBRARY["dragging_brake"])
    return next(s for s in terms if is_time_varying(s))


@pytest.mark.parametrize("recorded", [True, False])
def test_a_road_that_was_driven_once_may_be_no_road_where_slopes_are_known(
    nothing_missing: Evidence, recorded: bool
) -> None:
    e = nothing_missing
    e = replace(e, signals=e.signals | ({"grade": np.zeros(len(e))} if recorded else {}))
    term = next(s for s in Search(e).candidate_terms(LIBRARY["road_grade"]) if is_time_varying(s))
    (road,) = explain._unverified(e, [cause(e, term=term)])
    assert ("unknown" in road.not_told_from) == recorded
    assert (road.names.get("unknown") == road.names[road.effect]) == recorded
    (other,) = explain._unverified(e, [cause(e)])
    assert "unknown" not in other.not_told_from


@pytest.mark.parametrize(
    ("model_discrepancy", "slopes", "told"),
    [(0.0, True, "torque_derate"), (0.03, True, None), (0.03, False, "road_grade")],
)
def test_a_slow_force_beside_a_learned_truck_is_its_own_where_slopes_are_recorded(
    nothing_missing: Evidence,
    monkeypatch: pytest.MonkeyPatch,
    model_discrepancy: float,
    slopes: bool,
    told: str | None,
) -> None:
    e = replace(nothing_missing, model_discrepancy=model_discrepancy, itself=nothing_missing)
    if slopes:
        e = replace(e, signals=e.signals | {"grade": np.zeros(len(e))})
    slow = SlowForce(
        0.1 * np.sin(np.arange(len(e)) / 300.0), 0.07, {"road_grade": 0.007, "torque_derate": 0.1}
    )
    monkeypatch.setattr(explain, "slow_force", lambda *found: slow)
    search = Search(e)
    left: Any = SimpleNamespace(prediction=np.zeros(len(e)))
    causes = explain._with_slow_force(search, search.background(()), left, [])
    assert [c.effect for c in causes] == ([told] if told else [])


def test_few_windows_are_sought_without_what_comes_and_goes_too(
    nothing_missing: Evidence, gusts: CandidateTerm, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []
    monkeypatch.setattr(stepwise, "_now_and_then", lambda search, base, bare: asked.append(base) or base)
    monkeypatch.setattr(stepwise, "_gains_in_windows", lambda search, model, without: True)
    search = Search(nothing_missing)
    bare, varying = search.background(()), search.background((gusts,))
    assert stepwise._rare(search, bare, bare) == [bare]
    assert asked == [bare]
    assert stepwise._rare(search, varying, bare) == [varying, bare]
    assert asked == [bare, varying, bare]
    law = next(
        s for s in candidate_terms(LIBRARY["driveline_loss"], nothing_missing) if not is_time_varying(s)
    )
    lasting = search.background((law,))
    assert stepwise._rare(search, lasting, bare) == [lasting, bare]  # and in place of a law


@pytest.mark.parametrize("now_and_then", [False, True])
def test_they_are_sought_in_place_of_names_that_gain_in_windows_alone(
    nothing_missing: Evidence, now_and_then: bool
) -> None:
    e, spans = nothing_missing, [(0, 100.0, 108.0), (1, 300.0, 308.0)]
    inside = within(spans, e) if now_and_then else np.ones(len(e), dtype=bool)
    search = Search(replace(e, residual=e.residual - 0.3 * np.abs(e["engine"]) * inside))
    law = next(s for s in search.candidate_terms(LIBRARY["driveline_loss"]) if not is_time_varying(s))
    law = during(law, spans, e) if now_and_then else law
    bare, named = (search.model(names, frozenset()) for names in ((), (law,)))
    assert named.score > bare.score + 20.0
    assert stepwise._gains_in_windows(search, named, bare) == now_and_then


def test_what_gave_way_to_windows_is_tried_again_beside_them(
    nothing_missing: Evidence, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A wind had given way to an event of seconds, and parameters were biased in its place."""
    e = nothing_missing
    search = Search(replace(e, residual=e.residual - 0.12 * np.abs(e["engine"]) * (e["speed"] > 19.0)))
    bare = search.background(())
    monkeypatch.setattr(stepwise, "_rare", lambda search, base, bare: [bare])
    model, _ = stepwise.grow(search, bare)
    assert model.named and model.score > bare.score + 20.0


def test_an_engine_brake_whose_stages_nobody_told_acts_where_the_engine_is_asked_for_nothing(
    nothing_missing: Evidence,
) -> None:
    e = nothing_missing
    stages = [s for s in Search(e).candidate_terms(LIBRARY["engine_brake"]) if is_time_varying(s)]
    asked = e["engine_command"] > 0.1 * np.nanmax(e["engine_command"])
    assert stages and asked.any()
    for s in stages:
        assert s.columns.shape[1] > 3 and np.abs(s.columns[asked]).max() < 1e-12


def test_what_has_no_name_is_one_finding(nothing_missing: Evidence) -> None:
    """A verdict had listed `unknown` twice: what is time-varying, and what the signals predict."""
    push = np.full(len(nothing_missing), 0.1)
    named = replace(cause(nothing_missing), share=0.6)
    unknown = [
        Cause("missing_physics", "unknown", gain, share, push) for gain, share in ((90.0, 0.2), (120.0, 0.3))
    ]
    lag, one = explain._one_unknown([named, *unknown])
    assert (lag.effect, one.effect, one.gain, one.share) == ("torque_derate", "unknown", 120.0, 0.5)
    assert one.force == pytest.approx(2.0 * push)
    assert explain._one_unknown([named, unknown[0]]) == [named, unknown[0]]


def heavier(nothing_missing: Evidence, discrepancy: float) -> Search:
    """Evidence of a load half as heavy again, of which a little looks like another gain of the engine."""
    e = nothing_missing
    lighter = e["brake"] + e["drag"] - e["engine"]
    residual = e.residual + 0.25 * lighter - 0.05 * e.sensitivity["torque_gain"]
    known = {**e.sensitivity, "mass": lighter}
    return Search(replace(e, residual=residual, sensitivity=known, model_discrepancy=discrepancy))


def test_a_load_beside_a_learned_simulator_is_told_by_as_few_parameters_as_it_takes(
    nothing_missing: Evidence,
) -> None:
    free = {}
    for discrepancy in (0.0, 0.02):
        search = heavier(nothing_missing, discrepancy)
        null, both = (search.model((), frozenset(p)) for p in ((), ("mass", "torque_gain")))
        assert both.score > search.model((), frozenset({"mass"})).score
        free[discrepancy] = explain._fewest_parameters(search, both, null).free
    assert free == {0.0: {"mass", "torque_gain"}, 0.02: {"mass"}}
