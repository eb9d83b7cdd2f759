"""Corrections that are driven in one batch drive as each does alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model import trucks
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck, Term
from deeptruck_model.mismatch.correction.free_runs import batches, free_runs, free_windows
from deeptruck_model.mismatch.mechanisms import variant
from deeptruck_model.mismatch.mechanisms.air_and_tyres import NOBODY_M
from deeptruck_model.mismatch.prepare.prepared import Prepared, prepare
from deeptruck_model.simulators import Simulator
from deeptruck_model.trucks import driving_cycles

TRUCK = trucks.load("trucksim")
DRAG = Term("dragging_brake", (variant("constant"),), (0.05,))
LATE = Term("brake_lag", (variant("lag", side="delay", tau_s=0.5),), (1.0,))
NEAR = Term("drafting", (variant("exponential", length_m=20.0, usual_m=NOBODY_M),), (0.4,))


def _corrected(
    terms: list[Term], moved: dict[str, float], carried: dict[str, float] | None = None
) -> CorrectedTruck:
    return CorrectedTruck(TRUCK, terms, moved, None, False, (), carried)


CORRECTIONS: list[Simulator] = [
    TRUCK,
    _corrected([], {"mass": 0.1}),
    _corrected([DRAG], {}),
    _corrected([DRAG], {"mass": -0.05, "torque_gain": 0.1}, {"engine": 1.1}),
    _corrected([replace(DRAG, coefficients=(0.1,)), LATE], {"drag_area": 0.2}),
    _corrected([LATE], {}),
    _corrected([NEAR], {}),
]


@pytest.fixture(scope="module")
def drives() -> list[Prepared]:
    prepared = [prepare(driving_cycles.drive(TRUCK, seconds=100.0 + 20 * k, seed=k), False) for k in range(3)]
    with_gap = prepared[2].recording
    channels = with_gap.channels | {"gap": np.full(len(with_gap), 8.0)}
    return [*prepared[:2], replace(prepared[2], recording=replace(with_gap, channels=channels))]


def test_each_drives_as_alone(drives: list[Prepared]) -> None:
    jobs = [(truck, drives[k % 2 : 2 + k % 2]) for k, truck in enumerate(CORRECTIONS)]
    for (truck, own), together in zip(jobs, free_runs(jobs, 20.0), strict=True):
        alone = free_windows(truck, own, 20.0)
        assert np.abs(together.speed - alone.speed).max() < 1e-9
        assert together.recording.tolist() == alone.recording.tolist()
        assert together.start.tolist() == alone.start.tolist()
    ends = {round(float(e.speed[0, -1]), 6) for e in free_runs([(t, drives) for t in CORRECTIONS], 20.0)}
    assert len(ends) >= 5  # they do differ


def test_a_gap_is_heard_where_it_was_recorded(drives: list[Prepared]) -> None:
    near = CORRECTIONS[-1]
    beside, without = free_runs([(near, drives[2:]), (near, drives[:1])], 20.0)
    assert np.abs(beside.speed - free_windows(near, drives[2:], 20.0).speed).max() < 1e-9
    assert np.abs(without.speed - free_windows(near, drives[:1], 20.0).speed).max() < 1e-9


def test_a_recording_without_a_free_run_is_no_row(drives: list[Prepared]) -> None:
    some, none = free_runs([(TRUCK, drives), (TRUCK, [])], 20.0)
    assert len(some.speed) and none.speed.shape == (0, 200)


class _Plain:
    """A simulator that takes parameters for the whole batch alone."""

    def __init__(self, truck: trucks.PhysicsTruck) -> None:
        self._truck = truck

    def __getattr__(self, name: str) -> object:
        if name == "with_batch_parameters":
            raise AttributeError(name)
        return getattr(self._truck, name)

    def with_parameters(self, values: dict[str, float]) -> _Plain:
        return _Plain(self._truck.with_parameters(values))


def test_parameters_go_together_where_the_simulator_takes_them_by_row() -> None:
    def sizes(truck: Simulator) -> list[int]:
        changed = [CorrectedTruck(truck, [DRAG], {"mass": m}, None, False) for m in (0.1, 0.1, 0.2)]
        return sorted(len(own) for _, own in batches(changed, [1, 1, 1], [()] * 3))

    assert sizes(TRUCK) == [3]
    assert sizes(_Plain(TRUCK)) == [1, 2]  # type: ignore[arg-type]
