"""About which parameters all names are compared."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from small_drives import TRUCK, LazyBrake, sensed
from small_drives import drives as small_drives

from deeptruck_model.mismatch.posterior.posterior import posterior
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.posterior.relinearise import (
    _About,
    about_the_mean,
    at_fitted_parameters,
    refitted,
)
from deeptruck_model.mismatch.prepare.drives import PreparedDrives, prepare_drives
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.gather import gather
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.trucks import driving_cycles

MASS = TRUCK.parameters()["mass"]
LATE = TRUCK.with_forces([], [LazyBrake()])


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


def test_what_compensated_a_late_brake_is_undone_once_that_has_a_name() -> None:
    """Beside a lag the draws have the given parameters in the mean, wherever they were linearised; then the
    simulator is driven as given, and with the lag itself."""
    drives = prepare_drives(TRUCK, small_drives(LATE, 4), [], Rules())
    given = gather(TRUCK, drives.prepared, drives.held_out)
    weaker = _About(TRUCK, drives, given, 0, lambda step: None).at({"brake_gain": -0.1})
    p = posterior(Regression(weaker.to_fit()), sweeps=30)
    assert p.probability("brake_lag") > 0.9
    e = about_the_mean(TRUCK, drives, given, p, {})
    assert e.moved == {}
    late = e.rerun("lag_brake", 0.6)
    left = (e.residual - late)[e.valid]
    assert np.std(left) < 0.5 * np.std(e.residual[e.valid])
    assert abs(left @ late[e.valid]) < 0.05 * late[e.valid] @ late[e.valid]
    assert e.rerun("lag_brake", 0.6) is late  # which is not driven again
