"""Names by what a force is like: the recogniser that is shipped, and what it makes of findings."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.posterior import naming
from deeptruck_model.mismatch.posterior.causes import Cause
from deeptruck_model.mismatch.posterior.explain import explain
from deeptruck_model.mismatch.posterior.kernel_evidence import KernelEvidence
from deeptruck_model.mismatch.posterior.kernels import NOTHING, UNKNOWN
from deeptruck_model.mismatch.posterior.naming import asked_for, recognised, renamed, with_the_rest
from deeptruck_model.mismatch.posterior.recogniser import WEIGHTS, Recogniser, recogniser
from deeptruck_model.mismatch.posterior.search import Model, Search
from deeptruck_model.mismatch.posterior.stepwise import grow
from deeptruck_model.mismatch.residual.evidence import Evidence


def lazy_brakes(e: Evidence) -> Evidence:
    """Brakes of a pressure that comes 0.6 s late, in no form of the library's."""
    late = e.lag(e["brake"], 0.5) - e["brake"]
    return replace(e, residual=e.residual - 1.2 * np.tanh(late))


def test_the_shipped_recogniser_is_small_and_knows_every_name() -> None:
    told = recogniser()
    assert WEIGHTS.stat().st_size < 1_000_000
    card = json.loads(WEIGHTS.with_suffix(".json").read_text())
    assert list(told.names) == card["names"]
    slow_or_sensor = {"acceleration_bias", "speed_scale"}
    assert set(LIBRARY) - slow_or_sensor - set(told.names) == set()
    assert (
        card["unseen_families"]["all"]["network"]["log_score"]
        > (card["unseen_families"]["all"]["evidence alone"]["log_score"])
    )


def test_probabilities_are_of_names_that_can_be(nothing_missing: Evidence) -> None:
    search = Search(lazy_brakes(nothing_missing), exclude=("brake_lag",))
    by = KernelEvidence(search, search.background(()))
    p = recogniser().probabilities(by.of(search.series.y[:, None]))[0]
    told = dict(zip(recogniser().names, p, strict=True))
    assert sum(told.values()) == pytest.approx(1.0)
    assert told["brake_lag"] < 1e-6


@pytest.mark.parametrize("model_discrepancy", [0.0, 0.02])  # of a physics truck, and of a learned one
def test_findings_are_weighed_by_what_they_are_like(
    nothing_missing: Evidence, model_discrepancy: float
) -> None:
    search = Search(replace(lazy_brakes(nothing_missing), model_discrepancy=model_discrepancy))
    found = explain(search)
    told = recognised(search, found)
    physics = [c for c in told.causes if c.kind == "missing_physics"]
    assert physics and all(c.likeness for c in physics)
    assert sum(physics[0].names.values()) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(("lost", "moves"), [(0.0, True), (20.0, False)])
def test_a_liker_name_takes_the_place_unless_its_forms_explain_far_less(
    nothing_missing: Evidence, monkeypatch: pytest.MonkeyPatch, lost: float, moves: bool
) -> None:
    e = replace(nothing_missing, residual=nothing_missing.residual - 4e-6 * nothing_missing["speed"] ** 3)
    search = Search(e)
    model = explain(search).model
    (effect,) = model.effects
    other = "drag_area" if effect != "drag_area" else "headwind"
    names = recogniser().names
    likely = np.array([[{other: 0.9, effect: 0.1}.get(name, 0.0) for name in names]])
    monkeypatch.setattr(Recogniser, "probabilities", lambda self, f: likely)
    monkeypatch.setattr(naming, "_lost", lambda *given: lost)
    assert renamed(search, model).effects == ((other,) if moves else (effect,))


def likely(told: dict[str, float]) -> NDArray[np.float64]:
    """What a recogniser says that gives these names these probabilities."""
    return np.array([[told.get(name, 0.0) for name in recogniser().names]])


@pytest.mark.parametrize(
    ("like", "gain", "left", "tells"),
    [
        ({"drag_area": 0.8}, 200.0, 0.0, "drag_area"),
        ({"drag_area": 0.8}, 3000.0, 200.0, "drag_area"),
        (
            {"drag_area": 0.8},
            3000.0,
            0.0,
            None,
        ),  # it leaves nothing over, and so does not stray from its form
        ({"drag_area": 0.8}, 20.0, 0.0, None),  # noise is more than its form may be off
        ({"drag_area": 0.1, "rolling_resistance_speed": 0.1}, 200.0, 0.0, None),  # by its forms
        ({"torque_gain": 0.9}, 200.0, 0.0, None),  # a parameter is no name of a force, whatever it is like
        ({UNKNOWN: 0.4, "rolling_resistance_speed": 0.3}, 200.0, 0.0, UNKNOWN),
    ],
)
def test_a_finding_is_told_by_its_most_probable_name_and_keeps_its_form(
    nothing_missing: Evidence,
    monkeypatch: pytest.MonkeyPatch,
    like: dict[str, float],
    gain: float,
    left: float,
    tells: str | None,
) -> None:
    e = replace(nothing_missing, residual=nothing_missing.residual - 4e-6 * nothing_missing["speed"] ** 3)
    search = Search(e)
    found = explain(search)
    cause = replace(found.causes[0], gain=gain)
    found = replace(found, causes=(cause,), left_over_gain=left)
    assert cause.term is not None and cause.term.variant.is_a_law and cause.effect != "drag_area"
    monkeypatch.setattr(Recogniser, "told", lambda self, f: likely(like))
    (told,) = recognised(search, found).causes
    assert told.effect == (tells or cause.effect) and told.term is cause.term
    assert told.nearest == (cause.effect if tells else None)


def test_one_force_under_two_names_is_as_like_the_one_as_the_other(
    nothing_missing: Evidence, monkeypatch: pytest.MonkeyPatch
) -> None:
    search = Search(lazy_brakes(nothing_missing))
    found = explain(search)
    law = search.candidate_terms(LIBRARY["brake_fade"])[0]
    late = Cause(
        "missing_physics", "brake_lag", 90.0, 1.0, found.causes[0].force, law,
        rivals=(("command_delay", 0.8), ("engine_brake", 9.0), (UNKNOWN, 0.0)),
    )  # fmt: skip
    monkeypatch.setattr(Recogniser, "told", lambda self, f: likely({"brake_lag": 0.9, "engine_brake": 0.1}))
    (told,) = recognised(search, replace(found, causes=(late,), left_over_gain=0.0)).causes
    assert dict(told.likeness)["command_delay"] == dict(told.likeness)["brake_lag"] == pytest.approx(0.45)
    assert told.effect == "brake_lag" and "command_delay" in told.not_told_from


@pytest.mark.parametrize(("again", "tells"), [(True, "road_surface"), (False, "accessory_load")])
def test_what_comes_again_at_one_place_is_told_by_its_form(
    nothing_missing: Evidence, monkeypatch: pytest.MonkeyPatch, again: bool, tells: str
) -> None:
    """Soft ground at two places of a road that was driven eight times was told as an accessory."""
    search = Search(nothing_missing)
    found = explain(Search(lazy_brakes(nothing_missing)))
    monkeypatch.setattr(Recogniser, "told", lambda self, f: likely({"accessory_load": 1.0}))
    terms = search.candidate_terms(LIBRARY["road_surface"])
    term = next(t for t in terms if t.variant.comes_again == again)
    soft = Cause("missing_physics", "road_surface", 300.0, 1.0, found.causes[0].force, term)
    (told,) = recognised(search, replace(found, causes=(soft,))).causes
    assert told.effect == tells


def test_laws_without_a_form_are_told_by_the_name_they_are_like(
    nothing_missing: Evidence, monkeypatch: pytest.MonkeyPatch
) -> None:
    search = Search(lazy_brakes(nothing_missing))
    found = explain(search)
    laws = Cause("missing_physics", UNKNOWN, 90.0, 1.0, found.causes[0].force)
    only = replace(found, causes=(laws,))
    monkeypatch.setattr(Recogniser, "told", lambda self, f: likely({"brake_lag": 0.7, UNKNOWN: 0.3}))
    (told,) = recognised(search, only).causes
    assert told.effect == "brake_lag" and told.predictable and told.nearest is None
    assert dict(told.names)[UNKNOWN] == pytest.approx(0.25 + 0.75 * 0.3)
    comes_and_goes = replace(only, causes=(replace(laws, time_varying=True),))
    assert recognised(search, comes_and_goes).causes[0].effect == UNKNOWN


def of_two_laws(e: Evidence) -> tuple[Search, Model]:
    """Brakes that fade beside a wind, as they are modelled."""
    before = Search(e)
    laws = [before.candidate_terms(LIBRARY[name])[0] for name in ("brake_fade", "headwind")]
    shapes = [t.columns @ (np.abs(t.prior.mean) + t.prior.sd) for t in laws]
    forces = [0.06 * shape / np.sqrt(np.mean(shape**2)) for shape in shapes]
    search = Search(replace(e, residual=e.residual + forces[0] + forces[1]))
    both = tuple(search.candidate_terms(LIBRARY[name])[0] for name in ("brake_fade", "headwind"))
    return search, search.model(both, frozenset())


@pytest.mark.parametrize(("nothing", "left"), [(0.9, 1), (0.1, 2)])
def test_a_law_that_is_like_nothing_more_beside_the_others_goes(
    nothing_missing: Evidence, monkeypatch: pytest.MonkeyPatch, nothing: float, left: int
) -> None:
    search, model = of_two_laws(nothing_missing)
    names = recogniser().names
    likely = np.full((1, len(names)), (1.0 - nothing) / (len(names) - 1))
    likely[0, names.index(NOTHING)] = nothing
    monkeypatch.setattr(Recogniser, "told", lambda self, f: likely)
    assert len(asked_for(search, model).named) == left


def test_where_names_leave_hardly_anything_over_none_joins_them(nothing_missing: Evidence) -> None:
    """What is left over had laws of its own and no name: the recogniser was then asked for one it had not."""
    search, model = of_two_laws(nothing_missing)
    assert with_the_rest(search, model, np.zeros(len(nothing_missing))) is model


def test_one_law_alone_is_never_nothing_more(nothing_missing: Evidence) -> None:
    search = Search(lazy_brakes(nothing_missing))
    model = grow(search, search.background(()))[0]
    assert len(model.named) == 1
    assert asked_for(search, model) is model


def test_nothing_more_is_an_answer_beside_names_alone(nothing_missing: Evidence) -> None:
    search = Search(lazy_brakes(nothing_missing))
    by, y = KernelEvidence(search, search.background(())), search.series.y[:, None]
    at = recogniser().names.index(NOTHING)
    alone, beside = (recogniser().probabilities(by.of(y, given))[0, at] for given in ((), ("brake_lag",)))
    assert alone < 1e-6 < beside
