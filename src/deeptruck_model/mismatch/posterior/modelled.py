"""What an explanation says of the residual, as means over whole seconds: for figures and for formulas."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.mechanisms import law_signal
from deeptruck_model.mismatch.posterior.causes import Explanation
from deeptruck_model.mismatch.posterior.free_law import features
from deeptruck_model.mismatch.residual.evidence import Evidence

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

PERIOD_S = 1.0


def drivers(x: Explanation, most: int) -> tuple[str, ...]:
    """The signals that the free model of what is left over leans on, most important first."""
    share = x.left_over.importance
    return tuple([name for name in share if share[name] > 0.0][:most])


def explained(e: Evidence, x: Explanation) -> Array:
    """Specific force (n,) of the findings that have a name: stated mechanisms, and parameters as fitted."""
    return _modelled(e, x, {c.acts_as for c in x.causes if c.term is not None})


def _modelled(e: Evidence, x: Explanation, effects: set[str]) -> Array:
    total = np.zeros(len(e))
    for term in x.model.named:
        if term.mechanism.effect in effects:
            total += term.columns @ x.model.coefficients(term.mechanism.effect)
    for name, column in e.sensitivity.items():
        total += column * x.model.change(name)
    return total


def told(e: Evidence, x: Explanation) -> Array:
    """Specific force (n,) of the findings together, each as it is told, with parameters that were refitted
    beside them.

    The model may hold more: names that were no finding, for one. A held-out drive may have forces of its own,
    which are fitted along it to be told where they act.
    """
    found = np.sum([c.force for c in x.causes], axis=0) if x.causes else np.zeros(len(e))
    return found + retuned(e, beside={c.effect for c in x.causes})


def retuned(e: Evidence, beside: Collection[str] = ()) -> Array:
    """Specific force (n,) that parameters moved before the last search already took over, to first order;
    without those `beside` it."""
    total = np.zeros(len(e))
    for name, change in e.moved.items():
        if name in e.sensitivity and name not in beside:
            total += e.sensitivity[name] * (change / (1.0 + change))
    return total


def unexplained(e: Evidence, x: Explanation, names: Sequence[str]) -> tuple[Array, dict[str, Array], Mask]:
    """Means over PERIOD_S of what is left over (m/s^2), of named signals, and which are held out; all (m,).

    Where no recording was held out, every other one counts as such.
    """
    y, columns, rows = averaged(e, e.residual - explained(e, x), names)
    held = e.held_out if e.held_out.any() else e.record % 2 == 1
    return y, columns, held[rows]


def averaged(
    e: Evidence, force: Array, names: Sequence[str]
) -> tuple[Array, dict[str, Array], NDArray[np.intp]]:
    """Means of a force (n,) and of signals over whole valid periods of PERIOD_S, and their first rows."""
    per = max(1, round(PERIOD_S / e.dt))
    rows = np.arange(len(e) // per * per).reshape(-1, per)
    rows = rows[e.valid[rows].all(axis=1)]
    signals = features(e)
    known = {n: np.nan_to_num(signals[n]) if n in signals else law_signal(n).rows(e) for n in names}
    columns = {n: x[rows].mean(axis=1) for n, x in known.items()}
    return force[rows].mean(axis=1), columns, rows[:, 0]


@dataclass(frozen=True)
class Formula:
    """Force as text in the signals' names, in the evidence's unit of force; its r2 on recordings it was not
    fitted to; its signals."""

    text: str
    held_out_r2: float
    drivers: tuple[str, ...]
