"""What goes in is driven where it was not fitted, and has the sizes that drive better there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from deeptruck_model import trucks
from deeptruck_model.mismatch.correction import recipes
from deeptruck_model.mismatch.fit_result import Chosen, Errors
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.mechanisms.variants import Static
from deeptruck_model.mismatch.posterior.causes import Cause
from deeptruck_model.mismatch.posterior.search import Model, Search
from deeptruck_model.mismatch.residual.evidence import Evidence, Stretch
from deeptruck_model.mismatch.rules import Rules

TRUCK = trucks.load("trucksim")


def run(size: float) -> Errors:
    """A free run of one step with this error."""
    one = np.full((1, 1), size)
    return Errors(one, one, np.zeros(1, dtype=np.intp), np.zeros(1, dtype=np.intp))


def test_each_correction_is_driven_where_it_was_not_fitted(
    nothing_missing: Evidence, monkeypatch: pytest.MonkeyPatch
) -> None:
    e = nothing_missing
    ends = np.linspace(0, len(e), 9).astype(int)
    drives = [Stretch(f"d{k}", ends[k], ends[k + 1], 0.0, k > 5) for k in range(8)]
    e = replace(e, stretches=tuple(drives))
    seen: list[tuple[list[str], list[int]]] = []

    def fitted(self: object, simulator: object, search: Search, shares: object) -> list[int]:
        return np.unique(search.e.record[search.series.valid]).tolist()

    monkeypatch.setattr(recipes.Recipe, "corrected", fitted)

    def driven(jobs: Sequence[tuple[Any, Any]], _: float) -> list[Errors]:
        seen.extend((list(names), made) for made, names in jobs)
        return [run(0.0)] * len(jobs)

    monkeypatch.setattr(recipes, "free_runs", driven)
    prepared: Any = [f"d{k}" for k in range(6)]
    trials = recipes.Trials(TRUCK, recipes.folds_of(e, prepared), None, e.rules, 20.0)
    trials.errors([recipes.Recipe((), (), frozenset())])
    assert sorted(name for names, _ in seen for name in names) == prepared
    for names, on in seen:
        assert not {f"d{k}" for k in on} & set(names) and len(on) == 4


@pytest.mark.parametrize(
    ("recordings", "for_driving", "taken"), [(3, 0.2, True), (3, 0.295, False), (1, 0.2, False)]
)
def test_sizes_fitted_to_free_runs_go_in_where_they_are_clearly_better_unseen(
    monkeypatch: pytest.MonkeyPatch, recordings: int, for_driving: float, taken: bool
) -> None:
    """Along what they were fitted to, as where recordings are few, they always drive better."""
    monkeypatch.setattr(
        recipes.Trials,
        "errors",
        lambda self, some: [run(for_driving if r.for_driving else 0.3) for r in some],
    )
    folds: Any = [recipes.Fold(None, ())] * recordings  # type: ignore[arg-type]
    probable = recipes.Recipe((), (), frozenset({"mass"}))
    trials = recipes.Trials(TRUCK, folds, None, Rules(), 20.0)
    assert trials.with_better_sizes([probable]) == [replace(probable, for_driving=taken)]


@pytest.mark.parametrize(
    ("kept", "free", "what", "whole"),
    [
        (("headwind",), {"mass", "drag_area"}, Chosen.LAWS, True),
        (("headwind",), {"mass"}, Chosen.FINDINGS, False),
        ((), {"mass"}, Chosen.LAWS, False),
        (("headwind",), set(), Chosen.LAWS, False),
    ],
)
def test_a_correction_is_whole_with_every_force_parameter_and_law_that_was_found(
    kept: tuple[str, ...], free: set[str], what: Chosen, whole: bool
) -> None:
    terms: Any = {n: SimpleNamespace(mechanism=LIBRARY[n], variant=Static()) for n in ("headwind",)}
    none = np.zeros(1)
    causes = (
        Cause("missing_physics", "headwind", 50.0, 0.4, none, terms["headwind"]),
        Cause("parameter_error", "mass", 40.0, 0.3, none),
        Cause("missing_physics", "unknown", 70.0, 0.3, none),
    )
    x: Any = SimpleNamespace(causes=causes, lawful=object())
    recipe = recipes.Recipe((), tuple(terms[n] for n in kept), frozenset(free), what)
    assert recipes.holds(recipe, x) == whole


@pytest.mark.parametrize(("times", "taken"), [(1.5, True), (10.0, False)])
def test_sizes_for_driving_that_no_truck_can_have_are_not_used(
    nothing_missing: Evidence, monkeypatch: pytest.MonkeyPatch, times: float, taken: bool
) -> None:
    e = replace(nothing_missing, residual=nothing_missing.residual + 0.3 * nothing_missing["engine"])

    def larger(search: Search, model: Model, horizon_s: float) -> Model:
        return replace(model, fit=replace(model.fit, b=times * model.fit.b))

    monkeypatch.setattr(recipes.output_error, "refitted", larger)
    probable = recipes.Recipe((), (), frozenset({"torque_gain"}))
    wanted = replace(probable, for_driving=True)
    a, b = (r.corrected(TRUCK, Search(e), None).moved["torque_gain"] for r in (probable, wanted))
    assert a == pytest.approx(0.3, abs=0.05) and b == pytest.approx(times * a if taken else a, rel=0.01)
