"""The corrected simulator: the forces of names, and what is fitted beside them.

The force of a name has the sizes of the draws as its prior and is fitted beside the others, and its finding
states it so. Of names, of forces without one, and of parameters a correction has what lowers the speed error
of fitted drives that are left out in turn, to first order.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck, Term, factors
from deeptruck_model.mismatch.correction.fit_result import Interval, Refitted
from deeptruck_model.mismatch.correction.forms import (
    NamedForce,
    named_forces,
    nameless_terms,
    simplest_terms,
)
from deeptruck_model.mismatch.correction.recipes import (
    Recipe,
    best,
    fitted,
    judged,
    left_out_in_turn,
    needless,
    nested,
    pruned,
    subsets,
)
from deeptruck_model.mismatch.mechanisms import LIBRARY, CandidateTerm
from deeptruck_model.mismatch.mechanisms.families import PARAMETER_ERRORS, UNKNOWN
from deeptruck_model.mismatch.posterior.names import Compared
from deeptruck_model.mismatch.posterior.posterior import Posterior
from deeptruck_model.mismatch.posterior.regression import FREE, PINNED, Model, Regression
from deeptruck_model.mismatch.posterior.relinearise import about_the_mean
from deeptruck_model.mismatch.residual.components import Shares
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.gather import accepted
from deeptruck_model.mismatch.residual.noise import Z95
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import Simulator

LOWEST = -0.99  # relative change of a parameter: none has no size


@dataclass(frozen=True)
class Added:
    """A force that a correction adds (n,), m/s^2, as its finding states it, and how much larger it is than
    the mean of the draws (`factor`)."""

    force: Array
    factor: float = 1.0


@dataclass(frozen=True)
class Correction:
    """The corrected simulator, the one with refitted parameters only, and what they hold: `forces` added by
    name, all that has no name as `unknown`, and parameters `changed` and of the `refit`. `terms` are one form
    of each mechanism that may act, whose sizes findings state.

    `left_out` are first-order speed errors (drives,), rms in m/s, of fitted drives that were left out in
    turn, by simulator as in `FreeRunErrors`; empty if they are too few. Those of the corrected
    simulator are of the recipe that the other drives select. `needless` are found names without which drives
    left out are predicted as well.
    """

    corrected: CorrectedTruck
    parameters_only: CorrectedTruck
    output_error: bool = False
    forces: Mapping[str, Added] = field(default_factory=dict)
    changed: Mapping[str, Refitted] = field(default_factory=dict)
    refit: Mapping[str, Refitted] = field(default_factory=dict)
    terms: tuple[CandidateTerm, ...] = ()
    left_out: Mapping[str, Array] = field(default_factory=dict)
    caveats: tuple[str, ...] = ()
    needless: frozenset[str] = frozenset()


def correct(simulator: Simulator, c: Compared) -> Correction:
    """The correction by all blocks of the posterior, named or not, with the simulator at the posterior mean
    of its parameters."""
    p, rules = c.posterior, c.regression.rules
    likely = _stated_changes(c)
    e = about_the_mean(simulator, c.drives, c.given, p, likely)
    named = named_forces(p, c.names.found, e)
    tuning, folds = Recipe((), frozenset(p.regression.parameters)), left_out_in_turn(e)
    less = needless(folds, Recipe(_terms(named), frozenset(likely)), c.names.found, rules.stated)
    named = {name: x for name, x in named.items() if name not in less}
    likely = {name: x for name, x in likely.items() if name not in less}
    given = judged(folds, Recipe())
    options = [given]
    for whole in _wholes(p, named, frozenset(likely), e):
        options += pruned(folds, whole, p.probability, rules)
    options += subsets(folds, p.regression.parameters)
    chosen = best(options, rules).recipe
    left_out = {
        "before": given.of_drives,
        "parameters_only": judged(folds, tuning).of_drives,
        "after": nested(options, rules),
    }
    regression = Regression(e.everywhere(), only=~e.held_out & e.valid, parameter_sd=PINNED)
    alone, model = fitted(regression, tuning), fitted(regression, chosen)
    by_evidence = regression.model((), tuning.free)
    return Correction(
        _truck(simulator, regression, model),
        _truck(simulator, regression, alone),
        chosen.output_error,
        _added(model, named),
        {n: _refitted(simulator, regression.e, model, n) for n in sorted(model.free)},
        {n: _refitted(simulator, regression.e, by_evidence, n) for n in sorted(by_evidence.free)},
        tuple(simplest_terms(p, e)),
        left_out if len(folds) > 1 else {},
        tuple(_contradicted_mass(c, chosen)),
        less,
    )


def _stated_changes(c: Compared) -> dict[str, float]:
    """The relative changes of parameters that are found, from the simulator as given, in the draws."""
    p, e = c.posterior, c.regression.e
    return {
        f.name: float(np.clip(p.change(f.name, f.given)[0], *e.vehicle.possible(f.name)))
        for f in c.names.found
        if f.accepted and f.lasts and p.is_parameter(f.name)
    }


def _terms(named: Mapping[str, NamedForce]) -> tuple[CandidateTerm, ...]:
    return tuple(one.term for one in named.values())


def _wholes(
    p: Posterior, named: Mapping[str, NamedForce], likely: frozenset[str], e: Evidence
) -> Iterator[Recipe]:
    """Recipes from which parts are omitted: what was found, alone, with what has no name, and with all
    parameters."""
    known = _terms(named)
    rest = tuple(nameless_terms(p, {*named, *likely}, e))
    everything = frozenset(p.regression.parameters)
    wholes = [(known, likely), ((*known, *rest), likely)]
    if known or rest:
        wholes.append(((*known, *rest), everything))
    for terms, free in wholes[1:] if not rest else wholes:
        if terms or free:
            yield from (Recipe(terms, free, by_output_error) for by_output_error in (False, True))


def _added(model: Model, named: Mapping[str, NamedForce]) -> dict[str, Added]:
    """The forces of a model by name, what has no name together."""
    out: dict[str, Added] = {}
    for term in model.named:
        effect = term.mechanism.effect
        sizes = model.coefficients(effect)
        force = term.columns @ sizes
        if effect in named:
            out[effect] = Added(force, named[effect].factor(sizes))
        else:
            out[UNKNOWN] = Added(out[UNKNOWN].force + force if UNKNOWN in out else force)
    return out


def _contradicted_mass(c: Compared, recipe: Recipe) -> Iterator[str]:
    """Remark on a stated mass that the drives contradict when all parameters are fitted with the
    terms of the correction."""
    model = c.regression.model(recipe.terms, frozenset(c.regression.parameters))
    if "mass" not in c.parameters or "mass" not in model.free or model.moved_sd("mass") >= 0.5 * FREE["mass"]:
        return
    about = c.parameters["mass"] * (1.0 + c.regression.e.moved.get("mass", 0.0))
    value, wide = about * (1.0 + model.moved("mass")), Z95 * about * model.moved_sd("mass")
    recordings = [p.recording for p in c.drives.part(held_out=False)]
    yield from contradicted_mass(recordings, value, (value - wide, value + wide))


def _refitted(simulator: Simulator, e: Evidence, model: Model, parameter: str) -> Refitted:
    """A parameter's change from the simulator as given, with its interval."""
    given = simulator.parameters().get(parameter)
    wide = Z95 * (1.0 + e.moved.get(parameter, 0.0)) * model.moved_sd(parameter)
    change = e.total_change(parameter, model.moved(parameter))
    low, high = (max(change + side * wide, LOWEST) for side in (-1.0, 1.0))
    if given is None:
        return Refitted(change, (low, high))
    value, *ci95 = (given * (1.0 + x) for x in (change, low, high))
    return Refitted(change, (low, high), value, PARAMETER_ERRORS[parameter].unit, (ci95[0], ci95[1]))


def _truck(simulator: Simulator, regression: Regression, model: Model) -> CorrectedTruck:
    e = regression.e
    change = {
        p: float(np.clip(e.total_change(p, model.moved(p)), *e.vehicle.possible(p)))
        for p in sorted(model.free)
    }
    change = accepted(simulator, change)
    terms = [
        Term(effect, t.variants, tuple(model.coefficients(effect).tolist()))
        for t in model.named
        if (effect := t.mechanism.effect) in LIBRARY
    ]
    return CorrectedTruck(
        simulator, terms, change, Shares.if_unreported(e), False, e.gears, factors(e.moved, change)
    )


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
