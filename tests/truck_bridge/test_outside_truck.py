"""The emulated controllers stand around a simulator that tells no wheels and no gears."""

from __future__ import annotations

import math
from pathlib import Path

import can
import numpy as np

from deeptruck_model import simulators
from truck_bridge import vehicles
from truck_bridge.emulator.ecus import EcuEmulator


def test_the_emulator_drives_it_and_what_it_does_not_tell_is_not_available(shuttle: Path) -> None:
    truck = simulators.load(f"python:{shuttle.stem}:make")
    with (
        can.Bus(interface="virtual", channel=shuttle.stem) as bus,
        can.Bus(interface="virtual", channel=shuttle.stem) as other,
    ):
        emulator = EcuEmulator(vehicles.load("trucksim"), bus, truck=truck, speed=15.0)
        emulator.driver.accelerator = 50.0
        for now in np.arange(0.0, 1.0, 0.01):
            emulator.step(float(now))
        assert 14.5 < emulator.speed != 15.0 and math.isnan(emulator.parameters["wheel_radius"])
        assert emulator.parameters["mass"] == 20000.0
        assert other.recv(0) is not None
