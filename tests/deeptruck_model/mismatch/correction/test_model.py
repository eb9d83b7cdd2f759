"""The correction: few forms that stand for a mean force, and what drives best."""

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
from deeptruck_model.mismatch.correction.model import (
    Recipe,
    _best,
    _folds,
    _left_out,
    _needless,
    _nested,
    _pruned,
    _rms,
    _subsets,
)
from deeptruck_model.mismatch.mechanisms import LIBRARY, build
from deeptruck_model.mismatch.mechanisms.courses import ALWAYS, Where
from deeptruck_model.mismatch.posterior.kernels import UNKNOWN, kernels
from deeptruck_model.mismatch.posterior.names import Named, Tree, names
from deeptruck_model.mismatch.posterior.posterior import posterior
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.residual.expression import rows_of
from deeptruck_model.mismatch.rules import Limits, Rules


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
    assert len(simplest_terms(quiet, quiet.search.e)) <= 1
    assert simplest_terms(loud, loud.search.e)


def test_a_force_without_a_name_is_corrected_by_forms_of_any_mechanism() -> None:
    """Findings state only what is in; a correction takes what adds up to the force, whatever its name."""
    features = next(k.features for k in kernels(regression(evidence())) if k.name == UNKNOWN)
    force = features @ np.random.default_rng(1).standard_normal(features.shape[1])
    force *= 0.3 / force.std()
    p = posterior(regression(evidence(force)), sweeps=80)
    assert p.probability(UNKNOWN) == 1.0 and not simplest_terms(p, p.search.e)
    terms = nameless_terms(p, set(), p.search.e)
    assert terms and all(t.general for t in terms)
    columns = np.concatenate([np.nan_to_num(t.columns) for t in terms], axis=1)[p.search.rows]
    left = force[p.search.rows] - columns @ np.linalg.lstsq(columns, force[p.search.rows], rcond=None)[0]
    assert np.sum(left**2) < 0.3 * np.sum(force[p.search.rows] ** 2)


def test_a_force_in_one_condition_is_corrected_there_only() -> None:
    """A brake drags at high speed, as none of its laws does; the truck runs with it step by step."""
    p, m = posterior_of("none"), LIBRARY["dragging_brake"]
    e, drags = p.search.e, -0.1 * (p.search.e["speed"] > 20.0)
    term = _simplest(p.search, _options(p, m, drags, general=True), drags)
    (where,) = {v.course for v in term.variants}
    assert isinstance(where, Where) and where.signal == "speed" and not where.below
    assert where.above == pytest.approx(20.0, abs=1.0)
    always = -0.1 * np.ones(N)
    (v,) = _simplest(p.search, _options(p, m, always, general=True), always).variants
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
    named = named_forces(p, [found], p.search.e)["driveline_loss"]
    drawn = np.nan_to_num(named.term.columns) @ named.term.prior.mean
    assert np.corrcoef(drawn, force)[0, 1] > 0.9
    assert named.factor(2.0 * named.term.prior.mean) == pytest.approx(2.0)
    assert named_forces(p, [replace(found, accepted=False)], p.search.e) == {}
    assert "driveline_loss" not in {
        t.mechanism.effect for t in nameless_terms(p, {"driveline_loss"}, p.search.e)
    }


def test_the_error_of_a_drive_is_by_the_recipe_that_the_others_choose() -> None:
    """A recipe that is best on all by one lucky drive is worse on the others."""
    errors = [np.array([[x, 1.0] for x in squares]) for squares in ([1.0, 1.0, 1.0], [0.0, 1.2, 1.2])]
    options = [Recipe(), Recipe(free=frozenset(["mass"]))]
    assert _best(options, errors, Rules()) == 1
    np.testing.assert_array_equal(_nested(options, errors, Rules())[:, 0], [1.0, 1.2, 1.2])


def test_of_recipes_that_are_nearly_as_good_the_smallest_is_taken() -> None:
    options = [Recipe(free=frozenset(x)) for x in ((), ("mass", "drag_area"), ("mass",))]
    errors = [np.array([[x, 1.0]]) for x in (1.0, 0.1, 0.102)]
    assert _best(options, errors, Rules()) == 2
    tiny = [e * (0.1 * Limits.speed_noise) ** 2 for e in errors]
    assert _best(options, tiny, Rules()) == 0


def test_a_part_that_other_drives_do_not_need_is_left_out() -> None:
    e = evidence(noise=0.01)
    folds = _folds(replace(e, residual=e.residual - 0.2 * e["engine"]))
    whole = Recipe((), frozenset(["torque_gain", "brake_gain"]))
    *_, (least, errors) = _pruned(folds, whole, {"brake_gain": 0.2, "torque_gain": 0.9}.__getitem__, Rules())
    assert least.free == {"torque_gain"}
    assert _rms(errors) <= _rms(_left_out(folds, whole)) / Rules().better
    names = ("torque_gain", "brake_gain", "turbo_lag", "headwind")
    found = [Named(n, Tree({n: 0.7}), 9.0, np.zeros(N)) for n in names]
    assert _needless(folds, whole, found, 0.9) == {"brake_gain", "turbo_lag"}  # this of the engine too
    assert _needless(folds, whole, found, 0.6) == {"brake_gain"}
    assert _needless(folds, Recipe((), frozenset(["brake_gain"])), found[1:2], 0.9) == set()  # a first one


def test_every_set_of_parameters_is_a_recipe() -> None:
    """The fewest that explain the error: here the pair."""
    e = evidence(noise=0.003)
    off = 0.2 * e.sensitivity["torque_gain"] + 0.3 * e.sensitivity["brake_gain"]
    made = list(_subsets(_folds(replace(e, residual=e.residual + off)), sorted(e.sensitivity)))
    assert len({recipe.free for recipe, _ in made}) == 2 ** len(e.sensitivity) - 1
    options, errors = zip(*made, strict=True)
    assert options[_best(options, errors, Rules())].free == {"torque_gain", "brake_gain"}


def test_every_fitted_drive_is_driven_by_what_was_fitted_to_others() -> None:
    """A factor of the engine's force in all drives but the last is not what drives the last one best."""
    e = evidence(noise=0.003)
    last = np.arange(N) >= 2 * N // 3
    e = replace(e, residual=e.residual + np.where(last, -0.1, 0.1) * e["engine"])
    folds = _folds(e)
    assert [np.unique(e.record[f.left_out]).tolist() for f in folds] == [[0], [1], [2]]
    none, free = (_left_out(folds, Recipe((), frozenset(x))) for x in ((), ("torque_gain",)))
    assert none.shape == free.shape == (3, 2)
    given, fitted = (np.sqrt(x[:, 0] / x[:, 1]) for x in (none, free))
    speed = np.cumsum(e.residual[: round(Limits.horizons_s[0] / e.dt)]) * e.dt
    assert 0.3 * np.abs(speed[-1]) < given[0] < np.abs(speed[-1])
    assert fitted[2] > 1.5 * given[2]
    assert _rms(none) == pytest.approx(float(np.sqrt(np.mean(given**2))), rel=0.05)
