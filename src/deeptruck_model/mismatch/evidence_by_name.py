"""Log evidence of every name on given drives, computed alike for every truck, for comparisons within a fleet.

A verdict contains the evidence of its findings only, and of none for a truck without findings. Here the
kernel of every name is evaluated against the simulator as given.
"""

from __future__ import annotations

from collections.abc import Sequence

from threadpoolctl import threadpool_limits

from deeptruck_model.mismatch.data.prepared import Prepared
from deeptruck_model.mismatch.posterior.posterior import gains
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.posterior.relinearise import with_own_error
from deeptruck_model.mismatch.prepare import prepare_drives
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
    """Log evidence (nats) of each name over no effect, separately for the recordings and the held-out ones.

    Neither result depends on the other's noise. Empty for a part with less than a minute that can be
    compared. Raises InputError if a recording does not belong to the simulator.
    """
    simulator = completed(simulator)
    with threadpool_limits(1):
        drives = prepare_drives(simulator, recordings, held_out, rules)
        fit, held = (_nats(simulator, drives.part(out), seed, rules) for out in (False, True))
    return fit, held


def _nats(simulator: Simulator, drives: Sequence[Prepared], seed: int, rules: Rules) -> Nats:
    if sum(float(p.valid.sum()) * p.dt for p in drives) < Limits.least_driving_s:
        return {}
    e = gather(simulator, drives, [False] * len(drives), seed=seed, rules=rules)
    if float(e.valid.sum()) * e.dt < Limits.least_driving_s:
        return {}
    search = Regression(with_own_error(simulator, e, drives[0].measured_acceleration, seed))
    return gains(search)
