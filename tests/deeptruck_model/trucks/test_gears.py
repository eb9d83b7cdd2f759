"""Gears as recordings show them, beside those of a simulator."""

from __future__ import annotations

from dataclasses import replace

import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import trucks
from deeptruck_model.recordings import Recording
from deeptruck_model.trucks import driving_cycles, gears


@pytest.fixture(scope="module")
def drive() -> Recording:
    return driving_cycles.drive(trucks.load("trucksim"), seconds=900.0, seed=3)


def overall(name: str) -> list[float]:
    truck = trucks.load(name).specification
    return [r * truck.values["final_drive"] / truck.values["wheel_radius"] for r in truck.ratios]


def test_gears_are_read_off_engine_speed_and_speed(drive: Recording) -> None:
    found, stated = gears.from_gears([drive]), overall("trucksim")
    assert len(found) == len(stated)
    assert found[3:] == pytest.approx(stated[3:], rel=0.02)


def test_the_own_truck_fits_and_another_does_not(drive: Recording) -> None:
    gears.check(trucks.load("trucksim"), [drive])
    with pytest.raises(InputError, match="'volvo' is another truck than the recorded one: its gear ratios"):
        gears.check(trucks.load("volvo"), [drive])


def test_an_axle_ratio_that_is_off_is_a_factor(drive: Recording) -> None:
    off = gears.misfit([x / 0.634 for x in overall("trucksim")], [drive])
    assert off is not None and off.factor == pytest.approx(0.634, rel=0.02) and off.best > 0.9
    assert "check axle ratio and tyres" in str(off)


def test_a_speed_sensor_that_is_off_is_no_other_truck(drive: Recording) -> None:
    scaled = replace(drive, channels=drive.channels | {"speed": 1.08 * drive.channels["speed"]})
    gears.check(trucks.load("trucksim"), [scaled])
    assert "check axle ratio and tyres" in gears.other_truck(trucks.load("trucksim"), [scaled])


def test_without_an_engine_speed_nothing_is_said(drive: Recording) -> None:
    bare = replace(drive, channels={k: v for k, v in drive.channels.items() if k != "engine_speed"})
    gears.check(trucks.load("volvo"), [bare])
    gears.check(trucks.load("volvo"), [drive.piece(0, 300)])  # too short
