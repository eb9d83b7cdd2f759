"""Logs without a fuel rate, and trucks without one, are compared all the same."""

from __future__ import annotations

from dataclasses import replace

import pytest

from deeptruck_model import mismatch, trucks
from deeptruck_model.recordings import Recording
from deeptruck_model.trucks import driving_cycles

TRUCK = trucks.load("trucksim")
HEAVY = TRUCK.with_parameters({"mass": 1.2 * TRUCK.parameters()["mass"]})


def without_fuel(r: Recording) -> Recording:
    channels = {name: x for name, x in r.channels.items() if name != "fuel_rate"}
    return replace(r, channels=channels, interface=replace(r.interface, fuel=False))


def test_a_log_without_fuel_identifies_the_mass_too() -> None:
    drives = [driving_cycles.drive(HEAVY, seconds=200.0, seed=k, name=f"d{k}") for k in range(3)]
    bare = [without_fuel(r) for r in drives]
    found = mismatch.find_mismatch(TRUCK, bare[:2], bare[2:]).verdict
    assert found["findings"][0]["effect"] == "mass" and found["fit"]["validated"]
    mass = found["findings"][0]["parameters"]["mass"]["value"]
    assert mass == pytest.approx(HEAVY.parameters()["mass"], rel=0.02)
