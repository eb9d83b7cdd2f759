"""What is large enough and sure enough to be said at all."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from deeptruck_model.mismatch.mechanisms import (
    CandidateTerm,
    Mechanism,
    Variant,
    candidate_term,
    is_time_varying,
)
from deeptruck_model.mismatch.mechanisms.over_time import each_recording
from deeptruck_model.mismatch.mechanisms.variants import (
    FromMoment,
    Gate,
    Gated,
    OwnCurve,
    PerRecording,
    Simple,
    Spline,
)
from deeptruck_model.mismatch.posterior.search import Model, Search
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.noise import Z95, whiten

Array = NDArray[np.float64]

# m/s^2 rms: what a learned simulator did not learn of a signal that it cannot see is no larger, nor is any
# other error of it, where none is measured
LEARNABLE = 0.05
MOST_PRIOR_SD = 4.0  # prior sds: a coefficient farther from its prior mean is physically impossible


def enough(search: Search) -> float:
    return search.rules.least_gain_learned if search.e.model_discrepancy > 0 else search.rules.least_gain


def discrepancy_penalty(search: Search, model: Model) -> float:
    """Nats the last name of a model would gain from the simulator's model discrepancy alone."""
    if not model.named or search.e.model_discrepancy == 0:
        return 0.0
    last = model.named[-1]
    b = model.coefficients(last.mechanism.effect)
    if beyond_learning(search.e, last, last.columns @ b) and not _sized_by_recording(last):
        return 0.0
    own = _own_size(search, last)
    if own is None:
        return search.e.tolerance.get(last.mechanism.effect, 0.0)
    base = search.model(model.named[:-1], model.free, model.fit)
    return max(search.gain_of_given(base, last.columns @ _within(search, base, last, own)), 0.0)


def _within(search: Search, base: Model, last: CandidateTerm, own: Array) -> Array:
    """The coefficients of a candidate term that explain most without being larger than `own`, each (k,)."""
    left, X, H0, weight = search.whitened(base)
    columns = whiten(last.columns, base.fit.ar, search.rows, weight)
    columns = columns - X @ (H0 @ (X.T @ columns))
    least = np.where(last.prior.sign > 0, 0.0, -own)
    out: Array = lsq_linear(columns, left, (least, own + 1e-9)).x
    return out


def _own_size(search: Search, last: CandidateTerm) -> Array | None:
    """How large the coefficients of a term may be by the model discrepancy: as on the recordings it
    keeps, other driving allowed for. None where it keeps none, or the term belongs to these recordings."""
    if search.own is None or _only_here(last.variant):
        return None
    if _sized_by_recording(last):
        return _own_spread(search.own, last)
    model = _on_its_own(search.own, last.mechanism, last.variant)
    name = last.mechanism.effect
    sd: Array = np.sqrt(np.diag(model.covariance(name)))
    return search.rules.allowance * np.abs(model.coefficients(name)) + sd


def _own_spread(own: Search, last: CandidateTerm) -> Array:
    """The same where a coefficient belongs to a recording: as these differ among those the truck keeps."""
    sizes = []
    for gate, leaf in _gated_leaves(last.variant):
        kept = _in_each_recording(leaf, own.e)
        model = _on_its_own(own, last.mechanism, Gated(kept, gate) if gate else kept)
        b = model.coefficients(last.mechanism.effect)
        sd = np.sqrt(np.diag(model.covariance(last.mechanism.effect)))
        size = own.rules.allowance * float(np.sqrt(np.mean(b**2))) + float(np.mean(sd))
        sizes += [size] * len(last.mechanism.build(leaf))
    return np.array(sizes)


def _on_its_own(own: Search, mechanism: Mechanism, variant: Variant) -> Model:
    base = own.background(())
    return own.model((candidate_term(mechanism, variant, own.e),), base.free, base.fit)


def _gated_leaves(variant: Variant) -> list[tuple[Gate | None, Simple]]:
    return [(part.gate, leaf) for part in variant.parts for leaf in part.leaves]


def _in_each_recording(leaf: Simple, e: Evidence) -> Simple:
    """The same with a coefficient for each recording of other evidence."""
    return leaf if isinstance(leaf, Spline | OwnCurve) else each_recording(e, leaf.constants)


def _sized_by_recording(last: CandidateTerm) -> bool:
    """Whether a size of a candidate term belongs to a recording, though it is the truck's."""
    return any(
        isinstance(leaf, FromMoment) or (isinstance(leaf, PerRecording) and not leaf.weather)
        for leaf in last.variant.leaves
    )


def _only_here(variant: Variant) -> bool:
    """Whether its sizes are those of windows, of weather or of knots, of which other driving says nothing."""
    weather = any(
        (isinstance(leaf, PerRecording) and leaf.weather) or (isinstance(leaf, Spline) and leaf.levels)
        for leaf in variant.leaves
    )
    return weather or variant.acts_in_windows or variant.varies_in_time


def time_varying_penalty(model: Model, base: Model) -> float:
    """Nats more that the last name of a model must gain beyond `base` where it is time-varying:
    so do the zeros of slope sensors, and knots follow many a law that is not quite right here."""
    if not model.named or not is_time_varying(model.named[-1]):
        return 0.0
    return max(model.rules.least_gain, model.rules.form_share * (model.score - base.score))


def practical(search: Search, model: Model, term: CandidateTerm) -> bool:
    b = model.coefficients(term.mechanism.effect)
    if _ordinary_delay(model, term):
        return False
    if _beyond_possible(model, term):
        return False
    if not is_time_varying(term) and (np.abs(b - term.prior.mean) > MOST_PRIOR_SD * term.prior.sd).any():
        return False
    force = term.columns @ b
    return beyond_learning(search.e, term, force) or large_enough(search.e, force)


def _ordinary_delay(model: Model, term: CandidateTerm) -> bool:
    """Whether none of its delays is surely longer than those of message periods and filters."""
    b, covariance = model.coefficients(term.mechanism.effect), model.covariance(term.mechanism.effect)
    surely = []
    for name in {p.name for p in term.parts if p.name.startswith(("delay", "time_constant"))}:
        each = np.array([p.factor if p.name == name else 0.0 for p in term.parts])
        surely.append(abs(float(each @ b)) - Z95 * float(np.sqrt(each @ covariance @ each)))
    return bool(surely) and max(surely) < model.rules.least_delay_s


def _beyond_possible(model: Model, term: CandidateTerm) -> bool:
    """Whether a coefficient is surely larger than it can be."""
    sd = np.sqrt(np.diag(model.covariance(term.mechanism.effect)))
    surely = np.abs(model.coefficients(term.mechanism.effect)) - Z95 * sd
    return any(size * part.factor > part.most for part, size in zip(term.parts, surely, strict=True))


def beyond_learning(e: Evidence, term: CandidateTerm, force: Array) -> bool:
    """Whether the force has a driver that the simulator cannot see and is larger than what is imperfectly
    learned.

    It cannot have been absorbed, so meeting it on the simulator's own recordings too only says that it was
    missing there.
    """
    if term.columns.shape[1] < 3 and term.mechanism.learned_if_steady:
        return False  # always the same at the same speed, so it would have been learned
    return term.mechanism.hidden and float(np.sqrt(np.mean(force[e.valid] ** 2))) > LEARNABLE


def large_enough(e: Evidence, force: Array) -> bool:
    """Whether a force matters on the road and stands out of what the simulator itself learned imperfectly."""
    acting = np.sort(np.abs(force[e.valid]))
    rms = float(np.sqrt(np.mean(acting**2)))
    top = float(np.sqrt(np.mean(acting[-max(1, len(acting) // 10) :] ** 2)))
    acting_least = max(e.rules.least_force_acting, e.rules.allowance * e.model_discrepancy)
    return rms > max(e.rules.least_force, e.model_discrepancy) or top > acting_least
