"""Free runs, alone and in one batch, and how much better a correction makes them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model import trucks
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck, Term
from deeptruck_model.mismatch.correction.fit_result import Errors
from deeptruck_model.mismatch.correction.free_runs import (
    batches,
    free_run_errors,
    free_runs,
    free_windows,
    horizon,
    improvement,
    interval,
)
from deeptruck_model.mismatch.mechanisms import variant
from deeptruck_model.mismatch.mechanisms.air_tyres_road import NOBODY_M
from deeptruck_model.mismatch.prepare.prepared import Prepared, prepare
from deeptruck_model.simulators import Simulator
from deeptruck_model.trucks import driving_cycles

TRUCK = trucks.load("trucksim")
MASS = TRUCK.parameters()["mass"]


@pytest.fixture(scope="module")
def prepared() -> list[Prepared]:
    return [prepare(driving_cycles.drive(TRUCK, seconds=150.0 + 30 * k, seed=k), False) for k in range(3)]


def test_the_truck_itself_has_no_error(prepared: list[Prepared]) -> None:
    errors = free_windows(TRUCK, prepared, 30.0)
    assert errors.speed.shape == errors.acceleration.shape == (len(errors.start), 300)
    assert len(errors.start) >= 6 and set(errors.recording) <= {0, 1, 2}
    assert np.sqrt(np.mean(errors.speed**2)) < 0.3
    assert np.median(np.abs(errors.speed)) < 0.01


@pytest.mark.parametrize("keeps", [True, False])
def test_a_rollout_is_used_where_it_drives_as_the_steps_do(prepared: list[Prepared], keeps: bool) -> None:
    """One that does not keep its own response where nothing is fed back goes step by step."""
    lengths = []

    class Own(type(TRUCK)):  # type: ignore[misc]
        def rollout(self, u, w, y0, recorded=None, **more):  # type: ignore[no-untyped-def]
            lengths.append(u.shape[1])
            return super().rollout(u, w, y0, recorded if keeps else np.nan_to_num(recorded), **more)

    own = Own(TRUCK.specification)
    expected = free_windows(TRUCK, prepared, 30.0)
    np.testing.assert_array_equal(free_windows(own, prepared, 30.0).speed, expected.speed)
    assert (len(lengths) > 2) is keeps  # the first two compare it


def test_windows_begin_twice_and_lie_on_valid_driving(prepared: list[Prepared]) -> None:
    blind = prepared[0].valid.copy()
    blind[:700] = False
    part = Prepared(**{**prepared[0].__dict__, "valid": blind})
    errors = free_windows(TRUCK, [part], 20.0)
    assert errors.start.min() > 600
    first, again = np.split(errors.start, np.flatnonzero(np.diff(errors.start) < 0) + 1)
    assert all((np.diff(one) >= 200).all() for one in (first, again))
    assert len(again) >= 1 and np.abs(first[:, None] - again).min() > 50
    assert len(free_windows(TRUCK, prepared, 500.0).start) == 0


def test_a_better_simulator_has_an_interval_above_zero_and_a_worse_one_below(
    prepared: list[Prepared],
) -> None:
    wrong = TRUCK.with_parameters({"mass": 1.3 * MASS})
    before, right = (free_windows(s, prepared, 30.0) for s in (wrong, TRUCK))
    errors = {"before": before, "parameters_only": before, "after": right}
    said, gained = free_run_errors(errors), improvement(errors)
    assert said is not None and said.after.speed < said.before.speed
    assert 0.3 < gained.ci95[0] <= gained.ci95[1] <= 1.0
    assert gained.over_parameters_ci95 == gained.ci95
    errors = {"before": right, "parameters_only": right, "after": before}
    assert improvement(errors).ci95[1] < 0.0


def test_one_run_that_is_off_whatever_is_corrected_does_not_hide_the_others() -> None:
    def off(size: float) -> Errors:
        speed = np.full((12, 10), size)
        speed[7] = 1.0
        return Errors(speed, speed, np.arange(12) // 4, np.zeros(12, dtype=np.intp))

    low, high = interval(off(0.1), off(0.05))
    assert 0.1 < low <= high < 0.51


@pytest.mark.parametrize("better", [0, 1, 2])
def test_every_recording_is_drawn(better: int) -> None:
    owner = np.arange(12) // 4

    def off(size: float) -> Errors:
        speed = np.where(owner == better, size, 1.0)[:, None] * np.ones((12, 10))
        return Errors(speed, speed, owner, np.zeros(12, dtype=np.intp))

    low, high = interval(off(1.0), off(0.5))
    assert low == 0.0 < high  # it is left out of three draws in 8 of 27 cases


def test_equal_simulators_have_not_improved(prepared: list[Prepared]) -> None:
    same = free_windows(TRUCK, prepared, 30.0)
    errors = {"before": same, "parameters_only": same, "after": same}
    assert improvement(errors).ci95 == (0, 0)


def test_few_recordings_are_resampled_by_window() -> None:
    rng = np.random.default_rng(0)

    def some(scale: float) -> Errors:
        e = scale * rng.normal(size=(8, 50))
        return Errors(e, e, np.repeat([0, 1], 4), np.arange(8))

    low, high = interval(some(1.0), some(0.5))
    assert 0.3 < low < 0.5 < high < 0.65


def test_a_corrected_truck_hears_what_was_recorded_beside_the_protocol(prepared: list[Prepared]) -> None:
    near = prepared[0].recording
    channels = near.channels | {"gap": np.full(len(near), 8.0)}
    beside = Prepared(
        **{**prepared[0].__dict__, "recording": type(near)(**{**near.__dict__, "channels": channels})}
    )
    drafting = CorrectedTruck(
        TRUCK,
        [Term("drafting", (variant("exponential", length_m=20.0, usual_m=NOBODY_M),), (0.4,))],
        {},
        None,
        False,
    )
    alone, behind = (free_windows(drafting, [p], 30.0).speed for p in (prepared[0], beside))
    assert np.abs(alone).max() < 1.0 and (behind[:, -1] > alone[:, -1]).any()


def test_free_runs_are_as_long_as_the_driving_between_gaps_lets_them_be(prepared: list[Prepared]) -> None:
    assert horizon(prepared) == 40.0
    broken = [replace(p, valid=np.arange(len(p.valid)) % 350 > 60) for p in prepared]
    assert horizon(broken) == 20.0
    assert horizon([replace(p, valid=np.arange(len(p.valid)) % 200 > 50) for p in prepared]) == 10.0
    assert len(free_windows(TRUCK, broken, 20.0).speed) > len(free_windows(TRUCK, broken, 40.0).speed)


DRAG = Term("dragging_brake", (variant("constant"),), (0.05,))
LATE = Term("brake_lag", (variant("lag", side="delay", tau_s=0.5),), (1.0,))
NEAR = Term("drafting", (variant("exponential", length_m=20.0, usual_m=NOBODY_M),), (0.4,))


def _corrected(terms: list[Term], moved: dict[str, float]) -> CorrectedTruck:
    return CorrectedTruck(TRUCK, terms, moved, None, False)


CORRECTIONS: list[Simulator] = [
    TRUCK,
    _corrected([], {"mass": 0.1}),
    _corrected([DRAG], {}),
    _corrected([DRAG], {"mass": -0.05, "torque_gain": 0.1}),
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
