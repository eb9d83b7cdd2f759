"""The regression that all names are compared on: about parameters that fit, beside what sensors make of it.

A truck is not linear in its parameters: brakes that are too strong in the simulator get too hot and fade. So
where parameters are far off they are set in the simulator, and all is linearised anew about them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.mechanisms import LIBRARY, CandidateTerm
from deeptruck_model.mismatch.mechanisms.commands import Delays
from deeptruck_model.mismatch.posterior.linearised import accepted
from deeptruck_model.mismatch.posterior.search import Model, Search
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.gather import gather
from deeptruck_model.mismatch.residual.noise import Z95
from deeptruck_model.mismatch.residual.sensitivity import STEP
from deeptruck_model.mismatch.residual.sensor_filter import LATE_SHARE
from deeptruck_model.mismatch_flow.gains import screened
from deeptruck_model.mismatch_flow.prepare import Drives
from deeptruck_model.simulators import Simulator

FAR, SETTLED, STEPS = 0.05, 0.02, 4  # relative changes of parameters that are worth another linearisation
DELAY = "command_delay"
LEAST = 0.005  # of a parameter that is set at all


def about_fitting_parameters(
    simulator: Simulator,
    drives: Drives,
    e: Evidence,
    hidden: NDArray[np.bool_],
    seed: int,
    exclude: Sequence[str],
    say: Callable[[str], None],
) -> Search:
    """The search about the parameters that fit best without a name, of the drives that are fitted; as given
    where moving them explains no more."""
    first = search = _beside_lateness(Search(e.to_fit(), exclude=exclude), exclude)
    here = search.background(())
    for step in range(STEPS):
        moved = _changes(simulator, search, here, SETTLED if step else FAR)
        if moved is None:
            break
        say("linearising about refitted parameters")
        tuned = simulator.with_parameters({p: simulator.parameters()[p] * (1 + c) for p, c in moved.items()})
        anew = gather(
            tuned, drives.prepared, drives.held_out, seed=seed, moved=moved, rules=e.rules,
            mass_kg=e.mass if e.mass_known else None, reruns_held_out=False,
        )  # fmt: skip
        anew = replace(
            anew,
            valid=anew.valid & ~hidden,
            model_discrepancy=e.model_discrepancy,
            slow_noise=e.slow_noise,
            itself=e.itself,
        )
        further = _beside_lateness(Search(anew.to_fit(), exclude=exclude), exclude)
        there = further.background(())
        if not step and not _better(search, here, further, there):
            return first
        search, here = further, there
    return search


def _beside_lateness(search: Search, exclude: Sequence[str]) -> Search:
    """The search beside the lateness of all commands together that ordinary message periods and filters make;
    as it was where there is none, or one that is surely longer."""
    mechanism = LIBRARY[DELAY]
    if not search.e.has(*mechanism.needs):
        return search
    together = [t for t in search.candidate_terms(mechanism) if _together(t)]
    base = search.background(())
    late = [search.model((t,), base.free, base.fit) for t in screened(search, base, base, together)[:2]]
    best = max(late, key=lambda m: m.score, default=base)
    if best.score < base.score + search.rules.least_gain:
        return search
    seconds, sd = _seconds(best)
    if seconds - Z95 * sd > search.rules.least_delay_s:
        return search
    return Search(replace(search.e, late=best.named[-1].columns / LATE_SHARE), exclude=exclude)


def _together(term: CandidateTerm) -> bool:
    """Whether both commands are late by one delay."""
    constants = term.variant.constants
    return isinstance(constants, Delays) and [which for which, _ in constants.lines] == ["all"]


def _seconds(model: Model) -> tuple[float, float]:
    """The delay that a model with one term of it has, and its standard deviation, s."""
    (part,) = model.named[-1].parts
    share, variance = model.coefficients(DELAY)[0], model.covariance(DELAY)[0, 0]
    return part.factor * float(share), part.factor * float(np.sqrt(variance))


def _changes(simulator: Simulator, search: Search, model: Model, least: float) -> dict[str, float] | None:
    """Relative changes, from the simulator as given, of the parameters that a model asks for; None where none
    changes by more than `least`."""
    own = simulator.parameters()
    change = {p: model.moved(p) for p in search.parameters if p in own}
    if all(abs(c) <= least for c in change.values()):
        return None
    total = {p: search.e.total_change(p, c) for p, c in change.items()}
    possible = {
        p: float(np.clip(c, *search.e.vehicle.possible(p))) for p, c in total.items() if abs(c) > LEAST
    }
    return accepted(simulator, possible, near=STEP)


def _better(given: Search, here: Model, moved: Search, there: Model) -> bool:
    """Whether moved parameters explain more of the rows that both may use. Parameters can compensate a force
    they have nothing to do with, if they are moved far enough."""
    both = given.e.valid & moved.e.valid
    doubt = np.maximum(given.e.disagreement, moved.e.disagreement)  # rows weigh alike in both
    sigma = max(given.sigma, moved.sigma)
    scores = [
        Search(replace(s.e, disagreement=doubt), only=both, sigma=sigma).model((), m.free).score
        for s, m in ((given, here), (moved, there))
    ]
    return bool(scores[1] > scores[0] + given.rules.least_gain)
