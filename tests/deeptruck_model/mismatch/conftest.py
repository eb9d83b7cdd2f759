"""Mismatch results of a small truck whose simulator is exact: whole runs that tests share."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import pytest

from deeptruck_model.mismatch import Mismatch, Span, find_mismatch
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.recordings import Recording

sys.path.append(str(Path(__file__).parent))  # small_drives.py stands beside the tests
sys.path.append(str(Path(__file__).parents[2] / "ros2_ws"))  # page_browser.py

from small_drives import TRUCK, LazyBrake, StickingBrake, drives, evidence


@pytest.fixture(scope="session")
def nothing_missing() -> Evidence:
    """Two recordings of ten minutes with noise alone; tests add mechanisms to the residual."""
    return evidence(parts=2, held_out=1)


@pytest.fixture(scope="session")
def lazy_brake() -> Mismatch:
    """The result for a truck whose brakes are slower than the simulator's; its mass is stated."""
    recorded = [stated(r, 20000.0) for r in drives(TRUCK.with_forces([], [LazyBrake()]))]
    return find_mismatch(TRUCK, recorded[:3], recorded[3:])


@pytest.fixture(scope="session")
def right_truck() -> Mismatch:
    """The result for a truck that equals the simulator, whose recordings state a mass that is wrong. Half a
    minute is left out."""
    recorded = [stated(r, 26000.0) for r in drives(TRUCK)]
    return find_mismatch(TRUCK, recorded[:3], recorded[3:], without=[Span(recorded[0].name, 20.0, 50.0)])


@pytest.fixture(scope="session")
def dragging_brake() -> Mismatch:
    """The result for a truck one of whose six brakes lets go slowly."""
    recorded = drives(TRUCK.with_forces([StickingBrake()]))
    return find_mismatch(TRUCK, recorded[:3], recorded[3:])


@pytest.fixture(scope="session")
def heavier_truck() -> Mismatch:
    """The result for a truck with another mass and another drag area than the simulator's."""
    own = TRUCK.parameters()
    truth = {"mass": 1.1 * own["mass"], "drag_area": 1.2 * own["drag_area"]}
    recorded = drives(TRUCK.with_parameters(truth), seed=10)
    return find_mismatch(TRUCK, recorded[:3], recorded[3:])


def stated(r: Recording, mass_kg: float) -> Recording:
    return replace(r, interface=replace(r.interface, mass_kg=mass_kg))
