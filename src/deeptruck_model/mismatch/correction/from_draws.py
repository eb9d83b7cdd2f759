"""The corrected simulator from the draws: what is stated, and perhaps the rest as one nameless force.

There are three candidates: the simulator as given; what is stated, accepted names and parameters with sizes
by exact runs; and the same with the mean of everything else that is in the draws. A name whose force is
another in each drive has its sizes from these runs too, and carries their mean to further drives. All
parameters, fitted by exact runs with nothing else, stand beside. What predicts fitted drives that are left
out best is driven along the held-out ones.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from deeptruck_core.arrays import Array, Indices, Mask
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck, Term
from deeptruck_model.mismatch.correction.fit_result import Interval, Refitted
from deeptruck_model.mismatch.mechanisms import LIBRARY, CandidateTerm, confined
from deeptruck_model.mismatch.mechanisms.courses import ALWAYS, EachDrive, Where, conditions
from deeptruck_model.mismatch.mechanisms.families import PARAMETER_ERRORS, UNKNOWN
from deeptruck_model.mismatch.mechanisms.record import Mechanism
from deeptruck_model.mismatch.posterior.exact import Exact, Fitted, Part, Setting
from deeptruck_model.mismatch.posterior.names import Compared, Named
from deeptruck_model.mismatch.posterior.posterior import Posterior
from deeptruck_model.mismatch.posterior.regression import FREE, Regression
from deeptruck_model.mismatch.residual.components import Shares
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.noise import Z95, Prior, ridge
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import Simulator

FOLDS = 3
LOWEST = -0.99  # relative change of a parameter: none has no size


@dataclass(frozen=True)
class Correction:
    """The corrected simulator, the one with all parameters fitted and nothing else, and what they hold:
    accelerations (n,) added by name, all that has no name as `unknown`, and parameters `changed` and of the
    `refit`. `fitted` has the sizes of what is stated (None if nothing is), `terms` one form of each mechanism
    that may act.

    `left_out` are first-order speed errors (drives,), rms in m/s, of fitted drives that were left out in
    turn, by simulator as in `FreeRunErrors`; empty if they are too few. `needless` are found names whose
    interval holds zero, or what any simulator may be off by, or without which drives left out are predicted
    as well.
    """

    corrected: CorrectedTruck
    parameters_only: CorrectedTruck
    fitted: Fitted | None = None
    forces: Mapping[str, Array] = field(default_factory=dict)
    changed: Mapping[str, Refitted] = field(default_factory=dict)
    refit: Mapping[str, Refitted] = field(default_factory=dict)
    terms: tuple[CandidateTerm, ...] = ()
    left_out: Mapping[str, Array] = field(default_factory=dict)
    caveats: tuple[str, ...] = ()
    needless: frozenset[str] = frozenset()


def correct(simulator: Simulator, c: Compared) -> Correction:
    """The candidate that predicts fitted drives best that are left out."""
    p, prepared = c.posterior, c.drives.prepared
    given = np.ones(len(p.draws.states), dtype=bool) if c.names.given is None else c.names.given

    def fitted(free: Sequence[str], parts: Sequence[Part]) -> Fitted:
        return Exact(simulator, prepared, p, given, free, parts).fit()

    folds = _folds(p.regression.e)
    alone = fitted(p.regression.parameters, ())
    free, parts = _stated(p, c.names.found)
    needless: set[str] = set()
    stated = fitted(free, parts) if free or parts else None
    while stated is not None and (name := _needless(stated, folds)):
        needless.add(name)
        free = [n for n in free if n != name]
        parts = [q for q in parts if q.mechanism.effect != name]
        stated = fitted(free, parts) if free or parts else None
    mean = [_of_any_drive(q) for q in parts]
    carried = stated if mean == parts else fitted(free, mean)
    rest = _nameless(p, given, {*free, *(q.mechanism.effect for q in parts)})
    and_more = fitted(free, [*mean, *rest]) if rest else None
    before = _rms(p.regression.e, _as_given(alone), folds)
    errors = {id(x): _rms_left_out(x, folds) for x in (carried, and_more, alone) if x is not None}
    chosen = _better_of(carried, and_more, errors, before, p.regression.rules.better)
    sized = chosen if chosen is not None and mean == parts else stated
    if chosen is not None and not (chosen.setting.moved or any(map(_general, chosen.setting.parts))):
        chosen = None
    left_out = {"before": before, "parameters_only": errors[id(alone)]}
    left_out["after"] = errors[id(chosen)] if chosen is not None else before
    named = {*free, *(q.mechanism.effect for q in parts)}
    return Correction(
        _truck(simulator, chosen),
        _truck(simulator, alone),
        sized,
        {} if chosen is None else _forces(chosen, named),
        {} if chosen is None else {n: _refitted(simulator, chosen, n) for n in free},
        {n: _refitted(simulator, alone, n) for n in p.regression.parameters},
        tuple(simplest_terms(p)),
        left_out if len(folds) > 1 else {},
        tuple(_contradicted_mass(c, alone)),
        frozenset(needless),
    )


def uncorrected(simulator: Simulator, why: str) -> Correction:
    """No correction, with the reason as a remark."""
    given = _truck(simulator, None)
    return Correction(given, given, caveats=(why,))


def _stated(p: Posterior, found: Sequence[Named]) -> tuple[list[str], list[Part]]:
    """Parameters that are found, and of every other accepted name the form that has most of its force."""
    library, free, parts = {m.effect: m for m in p.regression.library}, [], []
    for f in found:
        if not (f.accepted and f.lasts):
            continue
        if p.is_parameter(f.name):
            free.append(f.name)
        elif f.name in library and (term := _term(p, library[f.name], f.force)) is not None:
            rows, b = p.regression.rows, p.on_columns(f.name, term.columns, f.given).mean(axis=0)
            left = f.force[rows] - term.columns[rows] @ b
            if float(left @ left) <= (1.0 - Limits.least_carried) * float(f.force[rows] @ f.force[rows]):
                parts.append(_part(term, b))
    return free, parts


def _term(p: Posterior, m: Mechanism, force: Array) -> CandidateTerm | None:
    """The form that stands for a mechanism's force (n,): one that applies to any drive, unless the force is
    another in each drive; None where it has no form."""
    options = _options(p, m, force, general=True)
    every = [*options, *(t for t in p.regression.candidate_terms(m) if not t.general)]
    best = _simplest(p.regression, every, force) if every else None
    return _simplest(p.regression, options, force) if best is not None and best.general else best


def _general(part: Part) -> bool:
    """Whether a part applies to any drive."""
    return part.variant.course.general


def _of_any_drive(part: Part) -> Part:
    """A part that applies to any drive: of one with a coefficient for each drive their mean."""
    course = part.variant.course
    if not isinstance(course, EachDrive):
        return part
    means = np.array(part.b).reshape(-1, len(course.names))
    return Part(part.mechanism, replace(part.variant, course=ALWAYS), tuple(means.mean(axis=1).tolist()))


def _part(term: CandidateTerm, b: Array) -> Part:
    (variant,) = term.variants
    signed = np.where(term.prior.sign > 0, np.maximum(b, 0.0), b)
    return Part(term.mechanism, variant, tuple(signed.tolist()))


def _needless(fitted: Fitted, folds: Sequence[Mask]) -> str:
    """The name that is least certain of those whose interval holds zero, or what any simulator's parameter
    may be off by; else one without which drives left out are predicted as well, the least certain first,
    unless its force is another in each drive. Empty if there is none."""
    nearly_right, off = fitted.of.p.regression.rules.nearly_right, dict[str, float]()
    for u in fitted.of.unknown:
        if u.part is None:
            change, sd = fitted.change(u.of)
            off[u.of] = sd / max(abs(change) - nearly_right, 1e-9)
        else:
            name = fitted.of.parts[u.part].mechanism.effect
            off[name] = fitted.relative_sd(name)
    order = sorted(off, key=lambda name: -off[name])
    if order and off[order[0]] * Z95 > 1.0:
        return order[0]
    whole = _rms_of(_rms_left_out(fitted, folds))
    varying = {q.mechanism.effect for q in fitted.of.parts if not _general(q)}
    order = [n for n in order if n not in varying]
    return next((n for n in order if _rms_of(_rms_left_out(fitted, folds, n)) <= whole), "")


def _nameless(p: Posterior, given: Mask, stated: set[str]) -> list[Part]:
    """The few forms that stand for the mean of everything that is in the draws beside what is stated: other
    names, and what follows no mechanism."""
    other = [m for m in p.regression.library if m.effect not in stated]
    likely = [m for m in other if p.inside(m.effect)[given].mean() >= Limits.least_in]
    terms = ((m, _term(p, m, p.force(m.effect, given))) for m in likely)
    likely = [m for m, term in terms if term is not None and term.general]
    follows_none = p.inside(UNKNOWN)[given].mean() >= Limits.least_in
    names = [*(m.effect for m in likely), *([UNKNOWN] if follows_none else [])]
    if not names:
        return []
    force = np.sum([p.force(n, given) for n in names], axis=0)
    options = [t for m in (other if follows_none else likely) for t in p.regression.candidate_terms(m)]
    options = [t for t in options if t.general and not t.reruns]
    taken = _forms(p.regression, options, force) if options else []
    if not taken:
        return []
    X, rows = np.concatenate([t.columns for t in taken], axis=1), p.regression.rows
    known = np.full(len(rows), p.noise.sigma**-2)
    b = ridge(force[rows], X[rows], known, Prior.join(*(t.prior for t in taken)))
    ends = np.cumsum([0, *(t.columns.shape[1] for t in taken)])
    return [_part(t, b[i:j]) for t, (i, j) in zip(taken, itertools.pairwise(ends.tolist()), strict=True)]


def _folds(e: Evidence) -> list[Mask]:
    """The fitted drives (drives,) that are left out in turn; none are, if they are too few."""
    fitted = np.flatnonzero([not s.held_out for s in e.drives])
    if len(fitted) < FOLDS:
        return [np.zeros(len(e.drives), dtype=bool)]
    return [np.isin(np.arange(len(e.drives)), fitted[k::FOLDS]) for k in range(FOLDS)]


def _rms_left_out(fitted: Fitted, folds: Sequence[Mask], without: str = "") -> Array:
    """Root mean square speed error (drives,), m/s, of every fitted drive by a fit to others."""
    return _rms(fitted.of.e, [fitted.left_out(away, without) for away in folds], folds)


def _rms(e: Evidence, left: Sequence[Array], folds: Sequence[Mask]) -> Array:
    """Root mean square (drives,), m/s, of what is left (n,) of the drives of each fold, added up over time
    and restarted every `horizons_s[0]` s."""
    length, out = max(1, round(Limits.horizons_s[0] / e.dt)), []
    for away, each in zip(folds, left, strict=True):
        for i, s in enumerate(e.drives):
            valid = e.valid[s.rows]
            if s.held_out or not valid.any() or not (away[i] or not away.any()):
                continue
            part = np.where(valid, np.nan_to_num(each[s.rows]), 0.0)
            speed = (
                np.concatenate([np.cumsum(part[k : k + length]) for k in range(0, len(part), length)]) * e.dt
            )
            out.append(float(np.sqrt(np.mean(speed[valid] ** 2))))
    return np.array(out)


def _as_given(alone: Fitted) -> list[Array]:
    """The residual (n,) of the simulator as given, in every fold."""
    e = alone.of.run(Setting())
    return [e.residual] * len(_folds(e))


def _rms_of(errors: Array) -> float:
    """Over all drives, beside the noise of speed, m/s."""
    return float(np.hypot(np.sqrt(np.mean(errors**2)) if len(errors) else 0.0, Limits.speed_noise))


def _better_of(
    stated: Fitted | None, and_more: Fitted | None, errors: Mapping[int, Array], before: Array, better: float
) -> Fitted | None:
    """What is stated, unless more than that makes the error of drives left out clearly smaller; the nameless
    alone where nothing is stated; None where neither is better than the simulator as given."""
    best, least = stated, _rms_of(errors[id(stated)] if stated is not None else before)
    if and_more is not None and _rms_of(errors[id(and_more)]) < better * least:
        best = and_more
    return best


def _forces(fitted: Fitted, named: set[str]) -> dict[str, Array]:
    """Accelerations (n,) by name, what has no name together."""
    out: dict[str, Array] = {}
    for name in dict.fromkeys(q.mechanism.effect for q in fitted.of.parts if _general(q)):
        key, force = name if name in named else UNKNOWN, fitted.force(name)
        out[key] = out[key] + force if key in out else force
    return out


def _contradicted_mass(c: Compared, alone: Fitted) -> Iterator[str]:
    """Remark on a stated mass that the drives contradict where all parameters are fitted."""
    if "mass" not in c.parameters or not alone.places("mass"):
        return
    change, sd = alone.change("mass")
    if sd < Limits.identified * FREE["mass"]:
        value, wide = c.parameters["mass"] * (1.0 + change), Z95 * c.parameters["mass"] * sd
        recordings = [p.recording for p in c.drives.part(held_out=False)]
        yield from contradicted_mass(recordings, value, (value - wide, value + wide))


def contradicted_mass(recordings: Sequence[Recording], mass_kg: float, ci95_kg: Interval) -> Iterator[str]:
    """Remarks on recorded masses outside the interval `ci95_kg` that the drives give, kg."""
    low, high = ci95_kg
    for r in recordings:
        if r.interface.mass_kg is not None and not low <= r.interface.mass_kg <= high:
            yield (
                f"{r.name} states a mass of {r.interface.mass_kg / 1000:.1f} t, and the drives show "
                f"{mass_kg / 1000:.1f} t ({low / 1000:.1f} to {high / 1000:.1f}, 95 %)"
            )
            return


def _refitted(simulator: Simulator, fitted: Fitted, parameter: str) -> Refitted:
    """A parameter's change from the simulator as given, with its interval."""
    given = simulator.parameters().get(parameter)
    change, sd = fitted.change(parameter)
    low, high = (max(change + side * Z95 * sd, LOWEST) for side in (-1.0, 1.0))
    if given is None:
        return Refitted(change, (low, high))
    value, *ci95 = (given * (1.0 + x) for x in (change, low, high))
    return Refitted(change, (low, high), value, PARAMETER_ERRORS[parameter].unit, (ci95[0], ci95[1]))


def _truck(simulator: Simulator, fitted: Fitted | None) -> CorrectedTruck:
    """The simulator with what was fitted; as given for None."""
    if fitted is None:
        return CorrectedTruck(simulator, [], {}, None, False)
    e, s = fitted.e, fitted.setting
    general = [q for q in s.parts if q.mechanism.effect in LIBRARY and _general(q)]
    terms = [Term(q.mechanism.effect, (q.variant,), q.b) for q in general]
    return CorrectedTruck(simulator, terms, s.moved, Shares.if_unreported(e), False, e.gears)


def simplest_terms(p: Posterior) -> list[CandidateTerm]:
    """For every mechanism that may act the one form, perhaps of single drives, that stands for its force."""
    picked = []
    for m in p.regression.library:
        if p.inside(m.effect).mean() >= Limits.least_in:
            force = p.force(m.effect, p.inside(m.effect))
            if options := _options(p, m, force, general=False):
                picked.append(_simplest(p.regression, options, force))
    return picked


def _options(p: Posterior, m: Mechanism, force: Array, *, general: bool) -> list[CandidateTerm]:
    """Candidate terms of a mechanism, or those alone that apply to any drive; where none of them is nearly
    its force (n,), each of its laws in every condition too. Beside a learned simulator there are no
    conditions, on which its own errors depend as well."""
    out = [t for t in p.regression.candidate_terms(m) if not general or t.general]
    if out and p.regression.e.model_discrepancy == 0:
        left, squares = _left(p.regression, out, force)
        if left.min() > Limits.simpler * squares:
            laws = [t for t in out if t.variants[0].course == ALWAYS and not t.reruns]
            out += [confined(t, where, p.regression.e) for t in laws for where in conditions(p.regression.e)]
    return out


def _left(regression: Regression, options: Sequence[CandidateTerm], force: Array) -> tuple[Array, float]:
    """Sums of squares (terms,) of a force (n,) that each term leaves, and its own."""
    gram, pull, squares, own = _products(regression, options, force)
    return np.array([squares - _explained(gram, pull, a) for a in own]), squares


def _simplest(regression: Regression, options: Sequence[CandidateTerm], force: Array) -> CandidateTerm:
    """The candidate term with the fewest coefficients, among those that explain a force (n,) nearly as well
    as the best one, and of these one that acts always, and that explains most with coefficients near their
    prior; findings state its sizes."""
    gram, pull, squares, own = _products(regression, options, force)
    left = np.array([squares - _explained(gram, pull, a) for a in own])
    good = np.flatnonzero(left <= left.min() + Limits.simpler * squares)

    def far(k: int) -> tuple[bool, float]:
        off = (_solved(gram, pull, own[k]) - options[k].prior.mean) / np.maximum(options[k].prior.sd, 1e-12)
        worse = (left[k] - left.min()) / max(Limits.simpler * squares, 1e-12)
        return isinstance(options[k].variants[0].course, Where), float(off @ off) + worse

    return options[min(good, key=lambda k: (len(own[k]), far(k)))]


def _products(
    regression: Regression, options: Sequence[CandidateTerm], force: Array
) -> tuple[Array, Array, float, list[Indices]]:
    """Inner products of all columns of some terms, and of these with a force (n,); the force's sum of
    squares; and the columns of each term."""
    rows = regression.rows
    widths = np.cumsum([0, *(t.columns.shape[1] for t in options)])
    X = np.concatenate([t.columns[rows] for t in options], axis=1)
    own = [np.arange(a, b) for a, b in itertools.pairwise(widths)]
    return X.T @ X, X.T @ force[rows], float(force[rows] @ force[rows]), own


def _forms(regression: Regression, options: Sequence[CandidateTerm], force: Array) -> list[CandidateTerm]:
    """The few candidate terms that together explain most of a force (n,), by greedy selection."""
    gram, pull, squares, own = _products(regression, options, force)
    taken: list[int] = []
    left = squares
    while len(taken) < Limits.most_forms and left > Limits.form_left * squares:
        errors = [
            squares - _explained(gram, pull, np.concatenate([own[i] for i in (*taken, k)]))
            for k in range(len(own))
        ]
        best = int(np.argmin(errors))
        if errors[best] > (1.0 - Limits.form_left) * left:
            break
        taken.append(best)
        left = errors[best]
    return [options[k] for k in taken]


def _explained(gram: Array, pull: Array, at: Indices) -> float:
    """Explained sum of squares for some columns."""
    b = _solved(gram, pull, at)
    return float(2.0 * b @ pull[at] - b @ gram[np.ix_(at, at)] @ b)


def _solved(gram: Array, pull: Array, at: Indices) -> Array:
    """Coefficients of some columns, with a small ridge."""
    H = gram[np.ix_(at, at)]
    out: Array = np.linalg.solve(H + np.eye(len(H)) * (1e-6 * np.trace(H) / len(H) + 1e-12), pull[at])
    return out
