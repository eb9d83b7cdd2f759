from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from deeptruck_core.signals import CHANNELS, TruckInterface
from deeptruck_model.recordings import Recording

sys.path.append(str(Path(__file__).parent))  # modules with bags and tables stand beside the tests


@pytest.fixture
def interface() -> TruckInterface:
    return TruckInterface("truck", engine_unit="percent", brake_unit="bar")


@pytest.fixture
def drive(interface: TruckInterface) -> Recording:
    """One minute with every channel, random values inside their ranges, and some invalid samples."""
    rng = np.random.default_rng(1)
    channels = {name: rng.uniform(max(c.low, -50.0), min(c.high, 50.0), 600) for name, c in CHANNELS.items()}
    channels["gap"] = channels["gap"].astype(np.float32).astype(np.float64)  # as sensor_msgs/Range carries it
    for name in channels:
        channels[name][rng.integers(0, 600, 5)] = np.nan
    channels["gear"] = np.abs(channels["gear"])  # reversing is no drive
    speed = 20.0 + 10.0 * np.sin(0.02 * np.arange(600)) + rng.uniform(-0.1, 0.1, 600)
    channels["speed"] = np.where(np.isnan(channels["speed"]), np.nan, speed)
    channels["speed"][[0, -1]] = speed[[0, -1]]  # a recording begins and ends with a valid speed
    return Recording("drive", 0.1, channels, interface)
