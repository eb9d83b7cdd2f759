"""A small truck of which the simulator knows everything."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from deeptruck_model.mismatch import Mismatch, find_mismatch
from deeptruck_model.mismatch.residual.evidence import Evidence, Stretch

sys.path.append(str(Path(__file__).parent))  # small_drives.py stands beside the tests

from small_drives import TRUCK, LazyBrake, drives

N, DT, SIGMA = 6000, 0.2, 0.03
rng = np.random.default_rng(5)
TIME = np.arange(N) * DT
SPEED = 18.0 + 4.0 * np.sin(TIME / 40.0)
ENGINE = 0.25 + 0.25 * np.sin(TIME / 11.0) * np.sin(TIME / 3.1)
DISTANCE = np.concatenate([np.cumsum(SPEED[:3000]), np.cumsum(SPEED[3000:])]) * DT
BRAKE = 0.8 * (np.sin(TIME / 23.0) > 0.9)


@pytest.fixture(scope="session")
def nothing_missing() -> Evidence:
    """Two recordings of ten minutes, noise alone; mechanisms are planted by adding to the residual."""
    return Evidence(
        dt=DT,
        stretches=(Stretch("a", 0, 3000, 0.0, False), Stretch("b", 3000, N, 0.0, True)),
        residual=rng.normal(0.0, SIGMA, N),
        simulated=ENGINE - BRAKE - 0.1,
        disagreement=np.zeros(N),
        valid=np.ones(N, dtype=bool),
        signals={
            "speed": SPEED,
            "engine": ENGINE,
            "brake": BRAKE,
            "drag": 1e-4 * SPEED**2,
            "rolling": np.full(N, 0.06),
            "simulated": ENGINE - BRAKE - 0.1,
            "elapsed": np.concatenate([TIME[:3000], TIME[:3000]]),
            "distance": DISTANCE,
            "place": DISTANCE,
            "engine_command": ENGINE,
            "brake_command": BRAKE,
        },
        sensitivity={"torque_gain": ENGINE, "brake_gain": -BRAKE},
        mass=20000.0,
        rerun=lambda name, amount: np.zeros(N),
    )


@pytest.fixture(scope="session")
def lazy_brake() -> Mismatch:
    """What is found where brakes are slower than the simulator's."""
    recorded = drives(TRUCK.with_forces([], [LazyBrake()]))
    return find_mismatch(TRUCK, recorded[:3], recorded[3:])


@pytest.fixture(scope="session")
def right_truck() -> Mismatch:
    """What is found where the simulator is the truck."""
    recorded = drives(TRUCK)
    return find_mismatch(TRUCK, recorded[:3], recorded[3:])
