from __future__ import annotations

import numpy as np
import pytest

from benchmarks.paper.drives import by_fuel, fleet, random_truck
from deeptruck_model import trucks
from deeptruck_model.signals import TruckInterface
from deeptruck_model.trucks.driving_cycles import YARD


def test_a_fleet_drives_trucks_of_one_interface_and_many_kinds():
    interface = trucks.load("trucksim").interface
    drives = fleet(interface, 6, 5.0, seed=3)
    assert all(d.interface == interface and len(d) == 3000 for d in drives)
    assert len({float(np.nanmax(d.channels["gear"])) for d in drives}) > 1
    again = fleet(interface, 2, 5.0, seed=3)
    np.testing.assert_array_equal(drives[1].channels["speed"], again[1].channels["speed"])


def test_random_trucks_span_what_trucks_weigh():
    rng = np.random.default_rng(0)
    masses = [random_truck(TruckInterface("x"), rng).parameters()["mass"] for _ in range(60)]
    assert min(masses) < 12e3 and max(masses) > 34e3


def test_a_fleet_may_drive_a_cycle_of_its_own():
    interface = trucks.load("trucksim").interface
    (hilly,), (flat,) = (fleet(interface, 1, 2.0, 3, cycle) for cycle in (None, YARD))
    assert np.ptp(hilly.channels["grade"]) > 0 == np.ptp(flat.channels["grade"])


def test_by_fuel_is_the_log_of_a_truck_without_commands():
    (drive,) = fleet(TruckInterface("x"), 1, 2.0, seed=3)
    log = by_fuel(drive, 1.0)
    assert len(log) == 120 and log.dt == 1.0
    assert (log.interface.engine_unit, log.interface.u, log.interface.w) == (
        "g/s",
        ("engine_command",),
        ("grade",),
    )
    speed, fuel = drive.channels["speed"], drive.channels["fuel_rate"]
    assert log.channels["speed"][4] == speed[49]
    assert log.channels["fuel_rate"][4] == pytest.approx(fuel[40:50].mean())
    assert log.channels["engine_command"][4] == pytest.approx(0.832 * fuel[50:60].mean())
    assert np.isnan(log.channels["engine_command"][-1])
    assert log.channels["acceleration"][4] == pytest.approx(speed[49] - speed[39])
    assert np.isfinite(log.channels["engine_speed"]).all() and "brake_command" not in log.channels
