"""The parameters about which all names are compared: those that a first look estimates.

A truck is nonlinear in its parameters: brakes that are too strong in the simulator, for example, get too hot
and fade. Parameters that are far off, beside what else acts, are therefore set in the simulator, which is
driven again, as long as it then leaves less.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from deeptruck_model.mismatch.posterior.posterior import Posterior, first_look
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.prepare.drives import PreparedDrives
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.gather import STEP, accepted, gather
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.simulators import Simulator

FAR = 0.02  # relative change of a parameter from which on another linearisation is needed
STEPS = 4


def at_estimated_parameters(
    simulator: Simulator,
    drives: PreparedDrives,
    e: Evidence,
    seed: int,
    exclude: Sequence[str],
    say: Callable[[str], None],
) -> Posterior:
    """A first look at the regression of the fitted drives, linearised at the parameters that it finds."""
    look = first_look(Regression(e.to_fit(), exclude=exclude), seed=seed)
    for _ in range(STEPS):
        changes = _estimated(simulator, look)
        if changes is None:
            break
        say("linearising about estimated parameters")
        anew = _linearised_at(simulator, drives, e, changes, seed, say)
        there = first_look(Regression(anew.to_fit(), exclude=exclude), seed=seed)
        if not _leaves_less(there, look):
            break
        look = there
    return look


def _estimated(simulator: Simulator, look: Posterior) -> dict[str, float] | None:
    """The estimated relative changes of parameters; None if none is far from where it is."""
    e, own = look.regression.e, simulator.parameters()
    every = np.ones(len(look.draws.states), dtype=bool)
    total = {p: look.change(p, every)[0] for p in look.regression.parameters if p in own}
    total = {p: float(np.clip(c, *e.vehicle.possible(p))) for p, c in total.items()}
    if all(abs((1.0 + c) / (1.0 + e.moved.get(p, 0.0)) - 1.0) <= FAR for p, c in total.items()):
        return None
    return {p: c for p, c in total.items() if abs(c) > Limits.least_shift}


def _leaves_less(there: Posterior, look: Posterior) -> bool:
    """Whether the residual less the mean of all forces is smaller, in rows that both may use."""
    both = np.intersect1d(there.regression.rows, look.regression.rows)
    squares = [float(np.mean(p.residual()[both] ** 2)) for p in (there, look)]
    return squares[0] < squares[1]


def _linearised_at(
    simulator: Simulator,
    drives: PreparedDrives,
    e: Evidence,
    changes: Mapping[str, float],
    seed: int,
    say: Callable[[str], None],
) -> Evidence:
    """The evidence at parameters with these relative changes from the given ones, as far as the simulator
    accepts them."""
    moved, own = accepted(simulator, changes, near=STEP), simulator.parameters()
    there = (
        simulator.with_parameters({n: own[n] * (1.0 + c) for n, c in moved.items()}) if moved else simulator
    )
    anew = gather(
        there, drives.prepared, drives.held_out, seed=seed, moved=moved, rules=e.rules,
        mass_kg=e.mass if e.mass_known else None, as_given=e, say=say,
    )  # fmt: skip
    return replace(
        anew.without(e.hidden),
        model_discrepancy=e.model_discrepancy,
        learned_slow_noise=e.learned_slow_noise,
        reference=e.reference,
    )
