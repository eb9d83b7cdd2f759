"""Forms that stand for forces of the draws."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_drives import N, evidence, posterior_of, regression

from deeptruck_model.mismatch.correction.from_draws import (
    _forms,
    _nameless,
    _options,
    _simplest,
    _stated,
    simplest_terms,
)
from deeptruck_model.mismatch.mechanisms import LIBRARY, build, candidate_term
from deeptruck_model.mismatch.mechanisms.courses import ALWAYS, Where
from deeptruck_model.mismatch.posterior.kernels import UNKNOWN, kernels
from deeptruck_model.mismatch.posterior.names import names
from deeptruck_model.mismatch.posterior.posterior import posterior
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.residual.expression import rows_of
from deeptruck_model.mismatch.rules import Limits


def test_few_forms_stand_for_a_force_that_is_a_sum_of_many() -> None:
    search = Regression(evidence())
    options = search.candidate_terms(LIBRARY["dragging_brake"])
    force = sum(np.nan_to_num(t.columns).sum(axis=1) for t in options)
    taken = _forms(search, options, force)
    assert 1 <= len(taken) <= Limits.most_forms
    X = np.concatenate([np.nan_to_num(t.columns) for t in taken], axis=1)[search.rows]
    left = force[search.rows] - X @ np.linalg.lstsq(X, force[search.rows], rcond=None)[0]
    assert np.sum(left**2) < 0.1 * np.sum(force[search.rows] ** 2)


def test_whatever_may_be_in_has_a_term_and_noise_has_none() -> None:
    e = evidence()
    quiet = posterior_of("none")
    lost = evidence(-0.3 * np.maximum(e["engine"], 0.0) * (e["speed"] > 18.0))
    loud = posterior(regression(lost), sweeps=40)
    assert len(simplest_terms(quiet)) <= 1
    assert simplest_terms(loud)


def test_a_force_without_a_name_is_corrected_by_forms_of_any_mechanism() -> None:
    """Findings state only what is in; a correction takes what adds up to the force, whatever its name."""
    features = next(k.features for k in kernels(regression(evidence())) if k.name == UNKNOWN)
    force = features @ np.random.default_rng(1).standard_normal(features.shape[1])
    force *= 0.3 / force.std()
    p = posterior(regression(evidence(force)), sweeps=80)
    assert p.probability(UNKNOWN) == 1.0 and not simplest_terms(p)
    parts = _nameless(p, np.ones(len(p.draws.states), dtype=bool), set())
    assert parts and not any(part.paths for part in parts)
    terms = [candidate_term(part.mechanism, part.variant, p.regression.e) for part in parts]
    columns = np.concatenate([t.columns for t in terms], axis=1)[p.regression.rows]
    left = (
        force[p.regression.rows] - columns @ np.linalg.lstsq(columns, force[p.regression.rows], rcond=None)[0]
    )
    assert np.sum(left**2) < 0.3 * np.sum(force[p.regression.rows] ** 2)


def test_a_force_in_one_condition_is_corrected_there_only() -> None:
    """A brake drags at high speed, as none of its laws does; the truck runs with it step by step."""
    p, m = posterior_of("none"), LIBRARY["dragging_brake"]
    e, drags = p.regression.e, -0.1 * (p.regression.e["speed"] > 20.0)
    term = _simplest(p.regression, _options(p, m, drags, general=True), drags)
    (where,) = {v.course for v in term.variants}
    assert isinstance(where, Where) and where.signal == "speed" and not where.below
    assert where.above == pytest.approx(20.0, abs=1.0)
    always = -0.1 * np.ones(N)
    (v,) = _simplest(p.regression, _options(p, m, always, general=True), always).variants
    assert v.course == ALWAYS
    rebuilt = build(term.mechanism, term.variants)
    columns = np.stack(rows_of([c.expression for c in rebuilt], e), axis=1)
    np.testing.assert_allclose(columns, term.columns, atol=1e-9)


def test_a_name_is_corrected_by_the_force_that_its_draws_have() -> None:
    """Forms carry it to other drives; a rival of it is a force without a name."""
    e = evidence()
    force = -0.3 * np.maximum(e["engine"], 0.0) * (e["speed"] > 20.0)
    p = posterior(Regression(evidence(force), exclude=set(LIBRARY) - {"driveline_loss"}), sweeps=40)
    (found,) = (f for f in names(p).found if f.name == "driveline_loss")
    free, (part,) = _stated(p, [found])
    assert not free
    assert part.mechanism.effect == "driveline_loss"
    assert np.corrcoef(part.force(p.regression.e), force)[0, 1] > 0.9
    assert _stated(p, [replace(found, accepted=False)]) == ([], [])
    given = np.ones(len(p.draws.states), dtype=bool)
    others = _nameless(p, given, {"driveline_loss"})
    assert "driveline_loss" not in {part.mechanism.effect for part in others}
