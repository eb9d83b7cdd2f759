"""The regression on which all names are compared, linearised at fitted parameters.

A truck is nonlinear in its parameters: brakes that are too strong in the simulator, for example, get too hot
and fade. Parameters that are far off are therefore set in the simulator, and the model is linearised again.
If each drive has another load, no parameters fit all drives, so that the loads are fitted with them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from deeptruck_model.mismatch.mechanisms import LIBRARY, CandidateTerm
from deeptruck_model.mismatch.mechanisms.courses import EachDrive
from deeptruck_model.mismatch.posterior.regression import Model, Regression
from deeptruck_model.mismatch.prepare.drives import PreparedDrives
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.gather import STEP, accepted, gather
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.simulators import Simulator

FAR, SETTLED = 0.05, 0.02  # relative changes of parameters from which on another linearisation is needed
STEPS = 4
CLOSE, CLOSER_STEPS = 0.005, 10  # the same where parameters are all that is fitted


def at_fitted_parameters(
    simulator: Simulator,
    drives: PreparedDrives,
    e: Evidence,
    seed: int,
    exclude: Sequence[str],
    say: Callable[[str], None],
) -> Regression:
    """The regression at the parameters that fit best without an effect, of the fitted drives; at the given
    parameters if changing them explains no more."""
    about = _About(simulator, drives, e, seed, say)
    first = regression = Regression(e.to_fit(), exclude=exclude)
    here = regression.background(())
    loaded = regression.background(_own_loads(regression))
    differs = loaded.score > here.score + e.rules.parameter_gain
    here = loaded if differs else here
    for step in range(STEPS):
        anew = about.evidence_at(regression, here, SETTLED if step else FAR)
        if anew is None:
            break
        further = Regression(anew.to_fit(), exclude=exclude)
        there = further.background(_own_loads(further) if differs else ())
        if not step and not _better(regression, here, further, there):
            return first
        regression, here = further, there
    return regression


def _own_loads(regression: Regression) -> tuple[CandidateTerm, ...]:
    """A separate load for every drive; empty if payload changes are excluded, or there are too few drives."""
    load = LIBRARY.of_input("mass")
    terms = regression.candidate_terms(load) if load in regression.library else ()
    return tuple(t for t in terms if all(isinstance(v.course, EachDrive) for v in t.variants))


def refitted(
    simulator: Simulator,
    drives: PreparedDrives,
    e: Evidence,
    seed: int,
    free: frozenset[str],
    say: Callable[[str], None],
) -> tuple[Regression, Model]:
    """The regression at the parameters that fit best without an effect, of which only `free` ones change; and
    their fit.

    Many steps are needed if mass and gains change together.
    """
    about = _About(simulator, drives, e, seed, say)
    regression = Regression(e.to_fit())
    for _ in range(CLOSER_STEPS):
        anew = about.evidence_at(regression, regression.model((), free), CLOSE, free)
        if anew is None:
            break
        regression = Regression(anew.to_fit())
    return regression, regression.model((), free)


@dataclass(frozen=True)
class _About:
    """Linearises at changed parameters of the simulator."""

    simulator: Simulator
    drives: PreparedDrives
    e: Evidence
    seed: int
    say: Callable[[str], None]

    def evidence_at(
        self, regression: Regression, model: Model, least: float, among: frozenset[str] | None = None
    ) -> Evidence | None:
        """The evidence at the parameters of a model, of which only those `among` change (None: all).

        None if no parameter changes by more than `least`.
        """
        own = self.simulator.parameters()
        may = regression.parameters if among is None else among
        change = {p: model.moved(p) for p in regression.parameters if p in own and p in may}
        if all(abs(c) <= least for c in change.values()):
            return None
        self.say("linearising about refitted parameters")
        total = {p: regression.e.total_change(p, c) for p, c in change.items()}
        possible = {
            p: float(np.clip(c, *regression.e.vehicle.possible(p)))
            for p, c in total.items()
            if abs(c) > Limits.least_shift
        }
        return self.at(possible)

    def at(self, changes: Mapping[str, float]) -> Evidence:
        """The evidence at parameters with these relative changes from the given ones, as far as the simulator
        accepts them."""
        moved = accepted(self.simulator, changes, near=STEP)
        anew = gather(
            with_changes(self.simulator, moved), self.drives.prepared, self.drives.held_out, seed=self.seed,
            moved=moved, rules=self.e.rules, mass_kg=self.e.mass if self.e.mass_known else None,
            as_given=self.e, say=self.say,
        )  # fmt: skip
        return replace(
            anew.without(self.e.hidden),
            model_discrepancy=self.e.model_discrepancy,
            learned_slow_noise=self.e.learned_slow_noise,
            reference=self.e.reference,
        )


def with_changes(simulator: Simulator, changes: Mapping[str, float]) -> Simulator:
    """The simulator with relative changes of its parameters."""
    own = simulator.parameters()
    changed = {n: own[n] * (1.0 + c) for n, c in changes.items()}
    return simulator.with_parameters(changed) if changed else simulator


def _better(given: Regression, here: Model, moved: Regression, there: Model) -> bool:
    """Whether changed parameters explain more of the rows that both may use. Parameters that are changed
    enough can compensate a force of another cause."""
    both = given.e.valid & moved.e.valid
    doubt = np.maximum(given.e.disagreement, moved.e.disagreement)  # rows weigh alike in both
    sigma = max(given.sigma, moved.sigma)
    scores = [
        Regression(replace(s.e, disagreement=doubt), only=both, sigma=sigma).model(m.named, m.free).score
        for s, m in ((given, here), (moved, there))
    ]
    return bool(scores[1] > scores[0] + given.rules.parameter_gain)
