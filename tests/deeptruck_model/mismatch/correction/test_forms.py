"""Few forms that stand for a mean force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_drives import N, evidence, posterior_of, regression

from deeptruck_model.mismatch.correction.forms import (
    _forms,
    _options,
    _simplest,
    named_forces,
    nameless_terms,
    simplest_terms,
)
from deeptruck_model.mismatch.mechanisms import LIBRARY, build
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
    assert len(simplest_terms(quiet, quiet.regression.e)) <= 1
    assert simplest_terms(loud, loud.regression.e)


def test_a_force_without_a_name_is_corrected_by_forms_of_any_mechanism() -> None:
    """Findings state only what is in; a correction takes what adds up to the force, whatever its name."""
    features = next(k.features for k in kernels(regression(evidence())) if k.name == UNKNOWN)
    force = features @ np.random.default_rng(1).standard_normal(features.shape[1])
    force *= 0.3 / force.std()
    p = posterior(regression(evidence(force)), sweeps=80)
    assert p.probability(UNKNOWN) == 1.0 and not simplest_terms(p, p.regression.e)
    terms = nameless_terms(p, set(), p.regression.e)
    assert terms and all(t.general for t in terms)
    columns = np.concatenate([np.nan_to_num(t.columns) for t in terms], axis=1)[p.regression.rows]
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
    named = named_forces(p, [found], p.regression.e)["driveline_loss"]
    drawn = np.nan_to_num(named.term.columns) @ named.term.prior.mean
    assert np.corrcoef(drawn, force)[0, 1] > 0.9
    assert named.factor(2.0 * named.term.prior.mean) == pytest.approx(2.0)
    assert named_forces(p, [replace(found, accepted=False)], p.regression.e) == {}
    assert "driveline_loss" not in {
        t.mechanism.effect for t in nameless_terms(p, {"driveline_loss"}, p.regression.e)
    }
