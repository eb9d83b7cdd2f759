"""About which parameters all names are compared."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest
from small_drives import TRUCK, sensed

from deeptruck_model.mismatch.posterior.posterior import Posterior
from deeptruck_model.mismatch.posterior.relinearise import at_estimated_parameters
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


def about(*masses: float, exclude: tuple[str, ...] = ()) -> Posterior:
    drives, e = gathered(*masses)
    return at_estimated_parameters(TRUCK, drives, e, 0, exclude, lambda step: None)


def test_a_wrong_mass_is_set_before_names_are_compared() -> None:
    assert about(1.4, 1.4, 1.4).regression.e.moved["mass"] == pytest.approx(0.4, abs=0.05)


def test_a_right_simulator_is_left_as_it_is() -> None:
    assert about(1.0, 1.0, 1.0).regression.e.moved == {}


def test_loads_that_differ_between_drives_move_no_mass() -> None:
    """Without and with a trailer: one mass for all would fit none."""
    assert abs(about(0.45, 0.45, 1.5).regression.e.moved.get("mass", 0.0)) < 0.1
    assert about(0.45, 0.45, 1.5, exclude=("payload_change",)).regression.e.moved
