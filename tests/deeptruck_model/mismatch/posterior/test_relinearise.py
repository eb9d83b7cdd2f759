"""About which parameters all names are compared."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest
from small_drives import TRUCK, sensed

from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.posterior.relinearise import (
    at_fitted_parameters,
    refitted,
)
from deeptruck_model.mismatch.prepare.drives import PreparedDrives, prepare_drives
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.gather import gather
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.trucks import driving_cycles

MASS = TRUCK.parameters()["mass"]


@cache
def gathered(*masses: float) -> tuple[PreparedDrives, Evidence]:
    """A drive of every mass, relative to the simulator's."""
    recordings = []
    for k, mass in enumerate(masses):
        truck = TRUCK.with_parameters({"mass": mass * MASS})
        drive = driving_cycles.drive(truck, seconds=180.0, seed=k)
        recordings.append(replace(sensed(drive, k), name="abc"[k]))
    drives = prepare_drives(TRUCK, recordings, [], Rules())
    return drives, gather(TRUCK, drives.prepared, drives.held_out)


def about(*masses: float, exclude: tuple[str, ...] = ()) -> Regression:
    drives, e = gathered(*masses)
    return at_fitted_parameters(TRUCK, drives, e, 0, exclude, lambda step: None)


def test_a_wrong_mass_is_set_before_names_are_compared() -> None:
    assert about(1.4, 1.4, 1.4).e.moved["mass"] == pytest.approx(0.4, abs=0.05)


def test_a_right_simulator_is_left_as_it_is() -> None:
    assert about(1.0, 1.0, 1.0).e.moved == {}


def test_loads_that_differ_between_drives_move_no_parameter() -> None:
    """Without and with a trailer: one mass for all would fit none."""
    assert about(0.45, 0.45, 1.5).e.moved == {}
    assert about(0.45, 0.45, 1.5, exclude=("payload_change",)).e.moved


def test_all_parameters_are_refitted_until_they_settle() -> None:
    drives, e = gathered(1.4, 1.4, 1.4)
    search, model = refitted(TRUCK, drives, e, 0, frozenset(["mass"]), lambda step: None)
    change = search.e.total_change("mass", model.moved("mass"))
    assert change == pytest.approx(0.4, abs=0.02)
    assert abs(model.moved("mass")) < 0.005


def test_a_parameter_that_is_not_free_stays_where_it_is() -> None:
    drives, e = gathered(1.4, 1.4, 1.4)
    search, _ = refitted(TRUCK, drives, e, 0, frozenset(["torque_gain", "brake_gain"]), lambda step: None)
    assert search.e.moved.keys() <= {"torque_gain", "brake_gain"} and search.e.moved
