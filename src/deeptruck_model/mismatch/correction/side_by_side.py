"""Runs many corrections of one simulator in one batch, because a step of the batch costs little more than a
step of one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from deeptruck_model.mismatch.correction.added import Added, TruckWithForces
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck
from deeptruck_model.mismatch.residual import effective_mass
from deeptruck_model.simulators import Simulator

Group = tuple[Simulator | TruckWithForces, list[int]]


def batches(
    trucks: Sequence[Simulator], rows: Sequence[int], channels: Sequence[tuple[str, ...]]
) -> list[Group]:
    """For each batch: the simulator that runs it, and the trucks whose rows it holds, in order.

    Trucks share a batch if they correct the same simulator along recordings with the same `channels`. Trucks
    with different parameters share a batch only if the simulator accepts parameters per row; trucks that add
    no force have a batch of their own.
    """
    alike: dict[tuple[Any, ...], list[int]] = {}
    for k, truck in enumerate(trucks):
        if rows[k]:
            alike.setdefault((*_kind(truck), channels[k]), []).append(k)
    return [(_together([trucks[k] for k in own], [rows[k] for k in own]), own) for own in alike.values()]


def _kind(truck: Simulator) -> tuple[Any, ...]:
    original, inner = _of(truck)
    apart = () if hasattr(original, "with_batch_parameters") else tuple(sorted(inner.items()))
    adds = isinstance(truck, CorrectedTruck) and truck.adds
    beside = (id(truck.shares), truck.gears) if isinstance(truck, CorrectedTruck) and truck.adds else ()
    return id(original), adds, apart, beside


def _of(truck: Simulator) -> tuple[Simulator, dict[str, float]]:
    """The base simulator of a correction, and its changed parameters."""
    return (truck.original, truck.inner) if isinstance(truck, CorrectedTruck) else (truck, {})


def _together(trucks: Sequence[Simulator], rows: Sequence[int]) -> Simulator | TruckWithForces:
    original, _ = _of(trucks[0])
    base = _base(original, [_of(t)[1] for t in trucks], rows)
    corrected = [t for t in trucks if isinstance(t, CorrectedTruck) and t.adds]
    if not corrected:
        return base
    added = Added.side_by_side([t.added for t in corrected], rows)
    first = corrected[0]
    return TruckWithForces(base, added, effective_mass.holds(original), first.shares, first.gears)


def _base(original: Any, inner: Sequence[dict[str, float]], rows: Sequence[int]) -> Simulator:
    names = sorted(set().union(*inner))
    if not names:
        return original
    if not hasattr(original, "with_batch_parameters"):
        return original.with_parameters(inner[0])
    own = original.parameters()
    return original.with_batch_parameters(
        {name: np.repeat([i.get(name, own[name]) for i in inner], rows) for name in names}
    )
