"""A learned simulator's model discrepancy, known from recordings it was not fitted to and keeps with it.

What a deep truck learned imperfectly looks like missing physics. So whatever the search would gain on the
truck's own recordings is the penalty that a finding on new recordings must exceed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from deeptruck_model.errors import InputError
from deeptruck_model.mismatch.data.prepared import LEAST_DRIVING_S, Prepared, learned, prepare
from deeptruck_model.mismatch.mechanisms import LIBRARY, CandidateTerm, Constants, distinct
from deeptruck_model.mismatch.mechanisms.commands import Delays
from deeptruck_model.mismatch.posterior.candidates import candidates, screen_terms
from deeptruck_model.mismatch.posterior.free_law import left_over
from deeptruck_model.mismatch.posterior.penalties import LEARNABLE, enough, practical
from deeptruck_model.mismatch.posterior.search import Model, Search
from deeptruck_model.mismatch.residual import sensor_filter
from deeptruck_model.mismatch.residual.evidence import SLOW_NOISE_S, Evidence
from deeptruck_model.mismatch.residual.gather import gather
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import Simulator

BOTH = "all"
FITTED = 2  # of them in full


def beside_it(search: Search, exclude: Iterable[str] = ()) -> Search:
    """The same search beside the lateness of all commands together that is too small to be told; as it was
    where there is none, or one that is a finding."""
    base = search.background(())
    small = [term for _, term in screen_terms(search, base, _small(search))[:FITTED]]
    tried = [search.model((s,), base.free, base.fit) for s in small]
    best = max(tried, key=lambda m: m.score, default=base)
    if best.score < base.score + enough(search) or practical(search, best, best.named[-1]):
        return search
    return Search(replace(search.e, late=best.named[-1].columns), exclude=exclude)


def left_beside(e: Evidence, model: Model) -> Evidence:
    """The evidence without that lateness, and without a sensor's filter, where the names of a model leave
    next to nothing of it: a brake that lags has a little of both, and parameters alone are to be fitted as
    anybody would fit them."""
    if e.late is not None and _worth(e, replace(e, late=None), model) < e.rules.least_gain:
        e = replace(e, late=None)
    if sensor_filter.rows(e) and _worth(e, replace(e, filtered=False), model) < e.rules.least_gain:
        e = replace(e, filtered=False)
    return e


def _worth(e: Evidence, bare: Evidence, model: Model) -> float:
    """Nats by which a model is better beside what is known of `e`, and not of `bare`."""
    beside = Search(e)
    without = Search(bare, sigma=beside.sigma)  # rows weigh alike in both
    return beside.model(model.named, model.free).score - without.model(model.named, model.free).score


def _small(search: Search) -> list[CandidateTerm]:
    mechanism = LIBRARY["command_delay"]
    if not search.e.has(*mechanism.needs):
        return []
    small = [s for s in search.candidate_terms(mechanism) if _late_together(s.variant.constants)]
    count = distinct(small, search.e)
    return [replace(s, trials=count) for s in small]


def _late_together(constants: Constants) -> bool:
    """Whether both commands are late by one delay."""
    lines = constants.lines if isinstance(constants, Delays) else ()
    return any(which == BOTH for which, _ in lines)


Array = NDArray[np.float64]


def known(simulator: Simulator, measured_acceleration: bool, seed: int, rules: Rules) -> Evidence | None:
    """The simulator's own recordings as evidence; None where it keeps none that can be used."""
    prepared = kept(simulator, measured_acceleration)
    if not prepared:
        return None
    try:
        return gather(simulator, prepared, [False] * len(prepared), seed=seed, rules=rules)
    except InputError:
        return None


def kept(simulator: Simulator, measured_acceleration: bool) -> list[Prepared]:
    """The recordings that a learned simulator keeps and was not fitted to; none where they are too short."""
    recordings: Sequence[Recording] = getattr(simulator, "reference", ())
    try:
        prepared = [learned(simulator, prepare(r, measured_acceleration)) for r in recordings]
    except InputError:
        return []
    return prepared if sum(float(p.valid.sum()) * p.dt for p in prepared) >= LEAST_DRIVING_S else []


def allow_for(evidence: Evidence, own: Evidence) -> Evidence:
    """The evidence with what the simulator's model discrepancy makes of names, sizes and slow noise."""
    own = replace(own, model_discrepancy=_slow_rms(own), slow_noise=_slow_noise(own))
    ratio = float(evidence.valid.sum()) / max(float(own.valid.sum()), 1.0)
    return replace(
        evidence,
        tolerance=_penalties(own, ratio),
        model_discrepancy=own.model_discrepancy,
        slow_noise=own.slow_noise,
        itself=own,
    )


def allow_for_the_unmeasured(evidence: Evidence) -> Evidence:
    """The evidence beside a simulator that has no parameters, and so may be a learned one, but keeps no
    recordings: it is off by as much as learned ones are, though by no more than it is here most of the time.
    """
    smooth = uniform_filter1d(_residual(evidence), _rows(1.0, evidence))
    usual = 1.4826 * float(np.median(np.abs(smooth[evidence.valid])))
    off = min(LEARNABLE, usual)
    return replace(evidence, model_discrepancy=off, slow_noise=max(off, evidence.rules.slow_noise))


def _penalties(own: Evidence, ratio: float) -> dict[str, float]:
    """Nats that each name gains on the simulator's own recordings, scaled to the amount of new data."""
    search = Search(own)
    base = search.background(())
    penalties = {m.effects[-1]: m.score - base.score for m in candidates(search, base)}
    for p in search.parameters:
        held = search.model((), base.free - {p})
        penalties[f"parameter:{p}"] = base.score - held.score if p in base.free else 0.0
    penalties["unknown"] = left_over(search, base).gain
    scale = own.rules.allowance * max(ratio, 0.5)
    return {name: max(penalty, 0.0) * scale for name, penalty in penalties.items()}


def _slow_noise(own: Evidence) -> float:
    """Sd (m/s^2) of the means over SLOW_NOISE_S of the model discrepancy, other driving allowed for."""
    per = _rows(SLOW_NOISE_S, own)
    means = []
    for s in own.stretches:
        rows = np.arange(s.start, s.start + (s.stop - s.start) // per * per).reshape(-1, per)
        means += own.residual[rows[own.valid[rows].all(axis=1)]].mean(axis=1).tolist()
    spread = 1.4826 * float(np.median(np.abs(means))) if means else 0.0
    return max(own.rules.slow_noise, own.rules.allowance * spread)


def _slow_rms(own: Evidence) -> float:
    """Rms (m/s^2) of what is left of the model discrepancy in means of a second, without most noise."""
    smooth = uniform_filter1d(_residual(own), _rows(1.0, own))
    quiet = np.sort(np.abs(smooth[own.valid]))[: int(0.98 * own.valid.sum())]  # without the rare jolt
    return float(np.sqrt(np.mean(quiet**2)))


def _residual(e: Evidence) -> Array:
    return np.where(e.valid, e.residual, 0.0)


def _rows(seconds: float, e: Evidence) -> int:
    return max(1, round(seconds / e.dt))
