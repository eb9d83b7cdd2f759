from __future__ import annotations

import numpy as np

from benchmarks.paper.drives import fleet, random_truck
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
