"""What a learned truck does wrong on the recordings it keeps is no finding on others, in whatever name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.mismatch.mechanisms.variants import FromMoment
from deeptruck_model.mismatch.posterior.candidates import candidates
from deeptruck_model.mismatch.posterior.free_law import left_over
from deeptruck_model.mismatch.posterior.penalties import discrepancy_penalty
from deeptruck_model.mismatch.posterior.search import Model, Search
from deeptruck_model.mismatch.residual.evidence import Evidence


def with_limit(e: Evidence, share: float, seed: int) -> Evidence:
    """The engine gives less than the simulator knows, the more it is asked for."""
    noise = np.random.default_rng(seed).normal(0.0, 0.03, len(e))
    return replace(e, residual=noise - share * np.maximum(e["engine"] - 0.3, 0.0))


def learned(e: Evidence, own: Evidence) -> Search:
    return Search(replace(e, model_discrepancy=0.01, itself=replace(own, model_discrepancy=0.01)))


def best(search: Search) -> tuple[Model, float]:
    base = search.background(())
    model = candidates(search, base)[0]
    return model, model.score - base.score


def test_a_name_costs_what_the_truck_itself_does_wrong(nothing_missing: Evidence) -> None:
    search = learned(with_limit(nothing_missing, 0.5, 1), with_limit(nothing_missing, 0.5, 2))
    model, gain = best(search)
    assert gain > 100.0 and discrepancy_penalty(search, model) > 0.8 * gain


def test_it_costs_little_where_the_truck_was_right(nothing_missing: Evidence) -> None:
    search = learned(with_limit(nothing_missing, 0.5, 1), with_limit(nothing_missing, 0.0, 2))
    model, gain = best(search)
    assert gain > 100.0 and discrepancy_penalty(search, model) < 0.5 * gain


def test_nothing_is_to_be_paid_beside_a_physics_truck(nothing_missing: Evidence) -> None:
    search = Search(with_limit(nothing_missing, 0.5, 1))
    assert discrepancy_penalty(search, best(search)[0]) == 0.0


@pytest.mark.parametrize(("share", "dear"), [(0.5, True), (0.0, False)])
def test_laws_cost_the_same(nothing_missing: Evidence, share: float, dear: bool) -> None:
    search = learned(with_limit(nothing_missing, 0.5, 1), with_limit(nothing_missing, share, 2))
    left = left_over(search, search.background(()))
    assert left.lawful is not None and left.gain > 100.0
    assert (discrepancy_penalty(search, left.lawful) > 0.6 * left.gain) == dear


def test_masses_of_drives_cost_as_they_differ_among_those_it_keeps(nothing_missing: Evidence) -> None:
    second = nothing_missing.record == 1

    def laden(seed: int, share: float) -> Evidence:
        noise = np.random.default_rng(seed).normal(0.0, 0.03, len(second))
        inertia = -nothing_missing["simulated"]
        signals = nothing_missing.signals | {"sensitivity:mass": inertia}
        return replace(nothing_missing, signals=signals, residual=noise + share * second * inertia)

    shares = []
    for own in (laden(2, 0.0), laden(2, 0.1)):
        search = learned(laden(1, 0.1), own)
        base = search.background(())
        payload = next(m for m in search.library if m.effect == "payload_change")
        later = next(
            s
            for s in search.candidate_terms(payload)
            if isinstance(s.variant, FromMoment) and s.variant.first == 1
        )
        model = search.model((later,), base.free, base.fit)
        shares.append(discrepancy_penalty(search, model) / (model.score - base.score))
    assert shares[0] < 0.4 and shares[1] > 0.8
