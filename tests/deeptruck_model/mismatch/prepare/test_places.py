"""Where drives are along the roads that they share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_core.arrays import Array
from deeptruck_model import trucks
from deeptruck_model.mismatch.prepare.places import (
    driven_by_positions,
    on_a_road_of_its_own,
    on_one_road,
    without_a_place,
)
from deeptruck_model.mismatch.prepare.prepared import Prepared, prepare
from deeptruck_model.recordings import Recording
from deeptruck_model.trucks import driving_cycles

TRUCK = trucks.load("trucksim")
DEGREE_M = np.radians(1.0) * 6371e3
NOISE_M = 2.0


@pytest.fixture(scope="module")
def drives() -> list[Recording]:
    return [driving_cycles.drive(TRUCK, seconds=240.0, seed=k) for k in range(2)]


def at(drive: Recording, east: Array, north: Array) -> Prepared:
    """A drive whose receiver, with an error, gives these metres about 48 N, 11 E."""
    rng = np.random.default_rng(0)
    east, north = (x + NOISE_M * rng.standard_normal(len(x)) for x in (east, north))
    positions = {
        "latitude": 48.0 + north / DEGREE_M,
        "longitude": 11.0 + east / DEGREE_M / np.cos(np.radians(48)),
    }
    return prepare(replace(drive, channels=drive.channels | positions), False)


def far(drive: Recording) -> Array:
    return prepare(drive, False).distance()


def test_whoever_comes_by_later_is_at_the_places_of_the_first(drives: list[Recording]) -> None:
    first, other = far(drives[0]), far(drives[1])
    begins = 0.3 * first[-1]
    a, b = on_one_road([at(drives[0], first, 0.01 * first), at(drives[1], begins + other, 0.01 * other)])
    assert np.abs(a.place() - first).max() < 15.0
    both = begins + other < first[-1] - 50.0
    assert both.sum() > 200
    assert np.abs(b.place() - begins - other)[both].max() < 20.0


def test_a_second_lap_is_at_the_places_of_the_first(drives: list[Recording]) -> None:
    driven = far(drives[0])
    lap = driven[-1] / 2.5
    turn = 2.0 * np.pi * driven / lap
    (p,) = on_one_road([at(drives[0], lap / 6.3 * np.cos(turn), lap / 6.3 * np.sin(turn))])
    later = driven > lap + 50.0
    apart = (p.place() - driven)[later] % lap
    assert np.median(np.minimum(apart, lap - apart)) < 20.0
    assert p.place().max() < lap + 100.0


def test_the_other_way_and_another_road_are_elsewhere(drives: list[Recording]) -> None:
    first, other = far(drives[0]), far(drives[1])
    there = at(drives[0], first, np.zeros_like(first))
    back = at(drives[1], first[-1] - other, np.zeros_like(other))
    aside = at(drives[1], other, np.full_like(other, 500.0))
    for others in (back, aside):
        a, b = on_one_road([there, others])
        assert b.place().min() >= a.place().max() + 400.0
        assert np.ptp(b.place()) == pytest.approx(other[-1], rel=0.05)


@pytest.mark.parametrize("begins", [11.0, 179.99])
def test_speed_is_judged_by_the_way_that_positions_tell(drives: list[Recording], begins: float) -> None:
    """On the ellipsoid, and beyond 180 degrees too."""
    driven = far(drives[0])
    latitude = np.radians(48.0)
    radius = 6378137.0 / np.sqrt(1.0 - 0.00669437999 * np.sin(latitude) ** 2)  # of the prime vertical
    longitude = begins + np.degrees(driven / 1.05 / radius / np.cos(latitude))
    positions = {"latitude": np.full(len(driven), 48.0), "longitude": (longitude + 180.0) % 360.0 - 180.0}
    p = prepare(replace(drives[0], channels=drives[0].channels | positions), False)
    assert np.median(driven_by_positions(p)) == pytest.approx(1.05, abs=0.002)
    assert np.array_equal(driven_by_positions(prepare(drives[0], False)), [])
    (placed,) = on_one_road([p])
    assert np.diff(placed.place()).max() < 50.0


def test_bends_of_a_test_track_scale_no_speed(drives: list[Recording]) -> None:
    driven, radius = far(drives[0]), 80.0
    p = at(drives[0], radius * np.cos(driven / radius), radius * np.sin(driven / radius))
    assert np.median(driven_by_positions(p)) == pytest.approx(1.0, abs=0.01)


def test_whoever_drives_on_beyond_the_end_makes_the_road_longer(drives: list[Recording]) -> None:
    first, other = far(drives[0]), far(drives[1])
    begins = 0.5 * first[-1]
    a, b = on_one_road(
        [at(drives[0], first, np.zeros_like(first)), at(drives[1], begins + other, np.zeros_like(other))]
    )
    assert (begins + other).max() > first[-1] + 200.0
    assert np.abs(b.place() - begins - other).max() < 40.0 and a.place().max() < b.place().max()


def test_a_receiver_that_stands_still_leaves_its_drive_without_a_place(drives: list[Recording]) -> None:
    first, other = far(drives[0]), far(drives[1])
    still, none = at(drives[1], 0.0 * other, 0.0 * other), prepare(drives[1], False)
    placed = on_one_road([at(drives[0], first, first), still, none, at(drives[0], first, first)])
    assert without_a_place(placed) == [still.recording.name, none.recording.name]
    assert (placed[1].place() < 0.0).all() and (placed[2].place() < 0.0).all()
    assert np.abs(placed[3].place() - placed[0].place()).max() < 20.0


def test_without_positions_all_begin_at_one_place(drives: list[Recording]) -> None:
    first = far(drives[0])
    alone = on_one_road([at(drives[0], first, first), prepare(drives[1], False)])
    assert np.array_equal(alone[0].place(), first) and np.array_equal(alone[1].place(), far(drives[1]))
    assert without_a_place(alone) == []


def test_between_two_roads_is_no_place(drives: list[Recording]) -> None:
    """The second drive leaves the first one's road, and a third one's lies between in places."""
    first, other = far(drives[0]), far(drives[1])
    leaves = 0.4 * other[-1]
    away = np.maximum(other - leaves, 0.0)
    north = np.full_like(first, 50_000.0)
    _, b, c = on_one_road(
        [
            at(drives[0], first, np.zeros_like(first)),
            at(drives[0], first, north),
            at(drives[1], np.minimum(other, leaves), away),
        ]
    )
    assert not set(np.round(b.place(), -1)) & set(np.round(c.place(), -1))
    on = other < leaves - 50.0
    assert np.abs(c.place() - other)[on].max() < 20.0
    assert (np.diff(c.place()) >= 0.0).all() and (c.place()[other > leaves + 50.0] > b.place().max()).all()


def test_a_drive_that_meets_no_other_is_named(drives: list[Recording]) -> None:
    """As where latitude and longitude are mixed up."""
    first, other = far(drives[0]), far(drives[1])
    swapped = at(drives[1], other, np.zeros_like(other)).recording
    positions = {
        "latitude": swapped.channels["longitude"],
        "longitude": swapped.channels["latitude"],
    }
    mixed_up = prepare(replace(swapped, name="mixed up", channels=swapped.channels | positions), False)
    met = [at(drives[0], first, np.zeros_like(first)), at(drives[1], other, np.zeros_like(other))]
    assert on_a_road_of_its_own(on_one_road([*met, mixed_up])) == ["mixed up"]
    assert on_a_road_of_its_own(on_one_road(met)) == []
    assert on_a_road_of_its_own(on_one_road([met[0], mixed_up])) == []
