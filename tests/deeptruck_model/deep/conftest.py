"""A small truck with lags, drag, brakes and standstill: fast to make, and learnable in seconds."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deeptruck_core.signals import TruckInterface
from deeptruck_model import simulators
from deeptruck_model.deep import Arguments, train
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import Simulator

SMALL = Arguments(updates=240, hidden=24, decoder=16, rounds=6)


def toy_drive(
    seconds: float, *, dt: float = 0.1, seed: int = 0, interface: TruckInterface | None = None
) -> Recording:
    rng = np.random.default_rng(seed)
    interface = interface or TruckInterface("toy")
    n = round(seconds / dt)
    u, grade, y = np.zeros((n, 2)), np.zeros(n), np.zeros((n, 3))
    torque = pressure = slope = 0.0
    y[0, 1] = 8.0
    for k in range(n):
        u[k] = u[k - 1]
        if rng.random() < dt / 6:
            u[k] = rng.choice(
                [[rng.uniform(0, 1800), 0], [0, rng.uniform(0, 40)], [0, 0]], p=[0.6, 0.25, 0.15]
            )
        slope += 0.02 * (-slope * dt + 0.03 * rng.standard_normal() * dt**0.5)
        grade[k] = slope if interface.grade else 0.0
        torque += (u[k, 0] - torque) * min(1.0, dt / 0.5)
        pressure += (u[k, 1] - pressure) * min(1.0, dt / 0.4)
        if k + 1 < n:
            v = y[k, 1]
            force = torque * 300 / max(v, 6.0) - 3.6 * v * v - (pressure * 900 + 1200) * (v > 0)
            moved = v + (force / 20000 - 9.81 * grade[k]) * dt
            moved = 0.0 if moved < 0 or (v == 0 and torque * 50 < 1500) else moved
            y[k + 1] = (moved - v) / dt, moved, 0.5 + torque / 200
    channels = {
        "acceleration": y[:, 0],
        "speed": y[:, 1],
        "fuel_rate": y[:, 2],
        "engine_command": u[:, 0],
        "brake_command": u[:, 1],
        "grade": grade,
    }
    names = {*interface.u, *interface.w, *interface.y}
    return Recording(f"toy{seed}", dt, {c: v for c, v in channels.items() if c in names}, interface)


@pytest.fixture(scope="session")
def drive() -> Callable[..., Recording]:
    """drive(seconds, dt=, seed=, interface=) -> Recording of the toy truck."""
    return toy_drive


@pytest.fixture(scope="session")
def small() -> Arguments:
    """Arguments for a training run of about a second."""
    return SMALL


@pytest.fixture(scope="session")
def truck(once: Callable[[str, Callable[[Path], object]], Path]) -> Simulator:
    """An ensemble of two, trained for a moment on ten minutes of the toy truck."""
    return simulators.load(once("deep", lambda out: train([toy_drive(600)], out, replace(SMALL, members=2))))
