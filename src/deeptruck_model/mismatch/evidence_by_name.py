"""The log evidence of every name on some drives, for every truck alike: what a fleet is compared by.

A verdict has evidence of what it names alone, so that trucks without a finding have none. Here each name's
kernel is asked, whatever comes of it, about the simulator as it was given.
"""

from __future__ import annotations

from collections.abc import Sequence

from threadpoolctl import threadpool_limits

from deeptruck_model.mismatch.data.prepared import Prepared
from deeptruck_model.mismatch.discrepancy import allowed_for
from deeptruck_model.mismatch.posterior.posterior import gains
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.prepare import prepared
from deeptruck_model.mismatch.residual.gather import gather
from deeptruck_model.mismatch.rules import Limits, Rules
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import MinimalSimulator, Simulator, completed

Nats = dict[str, float]


def evidence_by_name(
    simulator: MinimalSimulator,
    recordings: Sequence[Recording],
    held_out: Sequence[Recording],
    *,
    seed: int = 0,
    rules: Rules = Rules(),
) -> tuple[Nats, Nats]:
    """Log evidence (nats) of each name over none, of the recordings and of the held-out ones, each by itself.

    Of the two neither depends on the other's noise. Empty where a part has less than a minute that can be
    compared. Raises InputError where a recording does not belong to the simulator.
    """
    simulator = completed(simulator)
    with threadpool_limits(1):
        drives = prepared(simulator, recordings, held_out, rules)
        fit, held = (_nats(simulator, drives.part(out), seed, rules) for out in (False, True))
    return fit, held


def _nats(simulator: Simulator, drives: Sequence[Prepared], seed: int, rules: Rules) -> Nats:
    if sum(float(p.valid.sum()) * p.dt for p in drives) < Limits.least_driving_s:
        return {}
    e = gather(simulator, drives, [False] * len(drives), seed=seed, rules=rules)
    if float(e.valid.sum()) * e.dt < Limits.least_driving_s:
        return {}
    search = Regression(allowed_for(simulator, e, drives[0].measured_acceleration, seed))
    return gains(search, search.rules)
