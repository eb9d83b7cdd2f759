"""Names as kernels: their evidence is a Gaussian process's, and a law between two forms loses little."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from deeptruck_model.mismatch.mechanisms import LIBRARY, CandidateTerm, is_time_varying
from deeptruck_model.mismatch.posterior.explain import explain
from deeptruck_model.mismatch.posterior.kernels import KernelEvidence, Part, kernels, weighed
from deeptruck_model.mismatch.posterior.search import Search
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.noise import TAIL, whiten


def beside_nothing(e: Evidence) -> KernelEvidence:
    search = Search(e)
    return KernelEvidence(search, search.model((), frozenset()))


def law(e: Evidence, effect: str, which: int) -> CandidateTerm:
    terms = Search(e).candidate_terms(LIBRARY[effect])
    return [t for t in terms if not is_time_varying(t)][which]


def force(term: CandidateTerm, rms: float) -> np.ndarray:
    shape = term.columns @ (np.abs(term.prior.mean) + term.prior.sd)
    return shape * rms / np.sqrt(np.mean(shape**2))


def planted(e: Evidence, extra: np.ndarray) -> Evidence:
    return replace(e, residual=e.residual + extra)


def test_the_evidence_is_the_density_of_a_gaussian_process(nothing_missing: Evidence) -> None:
    few = np.arange(len(nothing_missing)) % 3000 < 150
    search = Search(nothing_missing, only=few)
    model = search.model((), frozenset())
    by = KernelEvidence(search, model)
    place = next(i for i, k in enumerate(by.kernels) if k.name == "headwind")
    X, prior, _ = search.design(model)
    rows, fit = search.rows, model.fit
    weight = np.sqrt((TAIL + 1) / (TAIL + fit.innovations[rows] ** 2)) / fit.sigma
    y = whiten(search.series.y - X @ prior.mean, fit.ar, rows, weight)
    held = whiten(X * prior.sd, fit.ar, rows, weight)
    Z = whiten(0.4 * by.kernels[place].features, fit.ar, rows, weight)
    white = np.eye(len(rows))
    density = [multivariate_normal(cov=c).logpdf(y) for c in (white, white + held @ held.T + Z @ Z.T)]
    assert by.evidence([Part(place, 0.4)]) == pytest.approx(density[1] - density[0], abs=1e-4)


@pytest.mark.parametrize("effect", ["torque_limit", "accessory_load"])
def test_a_law_between_two_forms_of_a_name_bears_it(nothing_missing: Evidence, effect: str) -> None:
    mixed = force(law(nothing_missing, effect, 0), 0.03) + force(law(nothing_missing, effect, -1), 0.03)
    nats = beside_nothing(planted(nothing_missing, mixed)).names(())
    likeliest = sorted(nats, key=lambda name: -nats[name])[:2]
    assert effect in likeliest and nats[effect] > 100.0


def test_a_force_of_the_wrong_sign_is_not_that_of_the_name(nothing_missing: Evidence) -> None:
    drag = force(law(nothing_missing, "accessory_load", 0), 0.02)
    right, wrong = (
        beside_nothing(planted(nothing_missing, side * drag)).names(())["accessory_load"] for side in (1, -1)
    )
    assert right > wrong + 5.0


def test_what_other_names_explain_is_not_explained_again(nothing_missing: Evidence) -> None:
    e = planted(nothing_missing, force(law(nothing_missing, "headwind", 0), 0.04))
    by = beside_nothing(e)
    alone, beside = by.names(()), by.names(("headwind",))
    assert "headwind" not in beside
    assert max(beside.values()) < 0.2 * max(alone.values())


def test_names_are_weighed_where_physics_is_missing(nothing_missing: Evidence) -> None:
    e = planted(nothing_missing, force(law(nothing_missing, "headwind", 0), 0.05))
    search = Search(e)
    found = explain(search)
    told = weighed(search, found)
    physics = [c for c in told.causes if c.kind == "missing_physics"]
    assert physics and all(c.kernels for c in physics)
    assert sum(physics[0].names.values()) == pytest.approx(1.0, abs=0.05)
    learned = Search(replace(e, model_discrepancy=0.02))
    assert weighed(learned, found) is found


def test_every_name_of_the_library_has_a_kernel(nothing_missing: Evidence) -> None:
    search = Search(nothing_missing)
    made = {k.name for k in kernels(search)}
    with_terms = {m.effect for m in search.library if search.candidate_terms(m)}
    assert made == with_terms | {"unknown"} | set(search.parameters)
    assert all(np.isfinite(k.features).all() for k in kernels(search))
