"""Names by what a force is like: the recogniser that is shipped, and what it makes of findings."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.posterior import recogniser as recognition
from deeptruck_model.mismatch.posterior.explain import explain
from deeptruck_model.mismatch.posterior.fingerprint import KernelEvidence
from deeptruck_model.mismatch.posterior.naming import recognised, renamed
from deeptruck_model.mismatch.posterior.recogniser import WEIGHTS, recogniser
from deeptruck_model.mismatch.posterior.search import Search
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


def test_findings_are_weighed_by_what_they_are_like(nothing_missing: Evidence) -> None:
    search = Search(lazy_brakes(nothing_missing))
    found = explain(search)
    told = recognised(search, found)
    physics = [c for c in told.causes if c.kind == "missing_physics"]
    assert physics and all(c.likeness for c in physics)
    assert sum(physics[0].names.values()) == pytest.approx(1.0, abs=0.05)


def test_beside_a_learned_simulator_names_stay(nothing_missing: Evidence) -> None:
    search = Search(replace(lazy_brakes(nothing_missing), model_discrepancy=0.02))
    found = explain(search)
    assert recognised(search, found) is found
    assert renamed(search, found.model) is found.model


def test_a_name_that_the_force_is_more_like_takes_the_place(
    nothing_missing: Evidence, monkeypatch: pytest.MonkeyPatch
) -> None:
    search = Search(lazy_brakes(nothing_missing))
    model = explain(search).model
    (effect,) = model.effects
    other = "command_delay" if effect != "command_delay" else "brake_lag"
    told = recognition.recogniser()
    sure = np.array([[float(name == other) for name in told.names]])
    monkeypatch.setattr(type(told), "probabilities", lambda self, f: sure)
    again = renamed(search, model)
    assert again.effects in ((other,), (effect,))  # where its own forms explain enough
    gained = again.score - search.background(()).score
    assert again is model or gained > search.rules.least_gain
