"""Small drives, compared once for all tests that read the result."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from deeptruck_model.mismatch_flow import Result, find_mismatch

sys.path.append(str(Path(__file__).parent))  # small_drives.py stands beside the tests

from small_drives import TRUCK, LazyBrake, drives


@pytest.fixture(scope="session")
def lazy_brake() -> Result:
    """Brakes that are slower than the simulator's."""
    recorded = drives(TRUCK.with_forces([], [LazyBrake()]))
    return find_mismatch(TRUCK, recorded[:3], recorded[3:])


@pytest.fixture(scope="session")
def nothing_missing() -> Result:
    """A simulator that is the truck."""
    recorded = drives(TRUCK)
    return find_mismatch(TRUCK, recorded[:3], recorded[3:])
