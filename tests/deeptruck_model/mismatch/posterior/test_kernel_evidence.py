"""What kernels say of a residual: a Gaussian process's evidence, of every name, of many residuals at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from deeptruck_model.mismatch.mechanisms import LIBRARY, CandidateTerm, is_time_varying
from deeptruck_model.mismatch.posterior.kernel_evidence import KernelEvidence
from deeptruck_model.mismatch.posterior.kernel_features import SIZES, KernelFeatures
from deeptruck_model.mismatch.posterior.kernels import kernels
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.noise import TAIL, whiten

Of = Callable[..., KernelFeatures]


def law(e: Evidence, effect: str, which: int) -> CandidateTerm:
    terms = Regression(e).candidate_terms(LIBRARY[effect])
    return [t for t in terms if not is_time_varying(t)][which]


def force(term: CandidateTerm, rms: float) -> np.ndarray:
    shape = term.columns @ (np.abs(term.prior.mean) + term.prior.sd)
    return shape * rms / np.sqrt(np.mean(shape**2))


@pytest.fixture(scope="module")
def by(nothing_missing: Evidence) -> KernelEvidence:
    search = Regression(nothing_missing)
    return KernelEvidence(search, search.model((), frozenset()))


@pytest.fixture(scope="module")
def of(by: KernelEvidence, nothing_missing: Evidence) -> Of:
    """What the kernels say of the residual with something added, beside the names given."""
    return lambda extra, *beside: by.of((nothing_missing.residual + extra)[:, None], beside)


def nats(f: KernelFeatures, name: str) -> float:
    return float(max(x[0] for x, key in zip(f.held.nats, f.keys, strict=True) if key.startswith(f"{name},")))


def test_the_evidence_is_the_density_of_a_gaussian_process(nothing_missing: Evidence) -> None:
    few = np.arange(len(nothing_missing)) % 3000 < 150
    search = Regression(nothing_missing, only=few)
    model = search.model((), frozenset())
    by = KernelEvidence(search, model)
    place = next(i for i, k in enumerate(by.kernels) if k.name == "headwind")
    X, prior, _ = search.design(model)
    rows, fit = search.rows, model.fit
    weight = np.sqrt((TAIL + 1) / (TAIL + fit.innovations[rows] ** 2)) / fit.sigma
    y = whiten(search.series.y - X @ prior.mean, fit.ar, rows, weight)
    held = whiten(X * prior.sd, fit.ar, rows, weight)
    Z = whiten(by.kernels[place].features, fit.ar, rows, weight)
    given = np.eye(len(rows)) + held @ held.T
    covariances = [given, *(given + s**2 * Z @ Z.T for s in SIZES)]
    density = [multivariate_normal(cov=c).logpdf(y) for c in covariances]
    found = by.of(search.series.y[:, None], quiet=1e9)  # noise as the model has it
    expected = logsumexp(np.array(density[1:]) - density[0]) - np.log(len(SIZES))
    assert found.held.nats[place, 0] == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("effect", ["torque_limit", "accessory_load"])
def test_a_law_between_two_forms_of_a_name_bears_it(nothing_missing: Evidence, of: Of, effect: str) -> None:
    mixed = force(law(nothing_missing, effect, 0), 0.03) + force(law(nothing_missing, effect, -1), 0.03)
    found = of(mixed)
    evidence = dict(zip(LIBRARY, found.by_evidence(list(LIBRARY))[0], strict=True))
    assert effect in sorted(evidence, key=lambda name: -evidence[name])[:2]
    assert nats(found, effect) > 100.0


def test_a_force_of_the_wrong_sign_is_not_that_of_the_name(nothing_missing: Evidence, of: Of) -> None:
    drag = force(law(nothing_missing, "accessory_load", 0), 0.02)
    right, wrong = (of(side * drag) for side in (1, -1))
    place = right.keys.index("accessory_load, law")
    assert right.held.sign[place, 0] > wrong.held.sign[place, 0] + 5.0


def test_what_other_names_explain_is_not_explained_again(nothing_missing: Evidence, of: Of) -> None:
    wind = force(law(nothing_missing, "headwind", 0), 0.04)
    alone, beside = of(wind), of(wind, "headwind")
    assert beside.held.nats.max() < 0.2 * alone.held.nats.max()


def test_what_is_given_explains_and_the_error_of_its_form_acts_where_it_does(
    nothing_missing: Evidence,
    of: Of,
) -> None:
    e = nothing_missing
    wind, wear = force(law(e, "headwind", 0), 0.08), force(law(e, "brake_fade", 0), 0.05)
    bent = np.sign(wind) * np.abs(wind) ** 3 / np.max(wind**2)
    form, second = of(bent, "headwind").given, of(wind + wear, "headwind").given
    assert not of(wind).given.there[0] and of(wind).given.features.max() == 0.0
    assert form.there[0] and form.explained[0] > 100.0 and second.explained[0] > 100.0
    assert form.overlap[0] > second.overlap[0] + 0.1


def test_many_residuals_at_once_are_each_as_alone(nothing_missing: Evidence, by: KernelEvidence) -> None:
    rng = np.random.default_rng(1)
    many = nothing_missing.residual[:, None] + rng.normal(0.0, 0.02, (len(nothing_missing), 3))
    together = by.of(many)
    for k in range(3):
        alone = by.of(many[:, [k]])
        for many_of_them, one in ((together.held, alone.held), (together.free, alone.free)):
            np.testing.assert_allclose(many_of_them.nats[:, k], one.nats[:, 0], rtol=1e-6, atol=1e-6)
            np.testing.assert_allclose(many_of_them.noise[k], one.noise[0], rtol=1e-6)


def test_every_name_of_the_library_has_a_kernel_of_a_key_of_its_own(nothing_missing: Evidence) -> None:
    search = Regression(nothing_missing)
    made = kernels(search)
    with_terms = {m.effect for m in search.library if search.candidate_terms(m)}
    assert {k.name for k in made} == with_terms | {"unknown"} | set(search.parameters)
    assert len({k.key for k in made}) == len(made)
    assert all(np.isfinite(k.features).all() for k in made)


def test_features_are_where_a_network_looks_for_them(nothing_missing: Evidence, of: Of) -> None:
    found = of(force(law(nothing_missing, "headwind", 0), 0.04))
    keys = ("of no kernel here", *found.keys)
    seen = found.features(keys)
    assert seen.shape == (1, 11 * len(keys) + 6) and np.isfinite(seen).all()
    np.testing.assert_array_equal(seen[0, -len(keys) :], [0.0, *np.ones(len(found.keys))])
    fewer = replace(found, keys=("other, law", *found.keys[1:]))
    assert fewer.features(keys)[0, -len(keys) + 1] == 0.0


def test_a_wrong_parameter_has_no_evidence_beside_free_ones(nothing_missing: Evidence, of: Of) -> None:
    found = of(0.3 * nothing_missing.sensitivity["torque_gain"])
    assert found.held.nats.max() > 100.0 > 10.0 * found.free.nats.max()
