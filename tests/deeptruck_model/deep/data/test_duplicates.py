from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.deep import DeepTruck, train
from deeptruck_model.deep.data import duplicates
from deeptruck_model.errors import InputError


def test_a_recording_is_known_by_another_name_but_not_changed(drive):
    recording = drive(30)
    renamed = replace(recording, name="copy", channels={"speed": recording.channels["speed"].copy()})
    assert duplicates.fingerprint(renamed) == duplicates.fingerprint(recording)
    assert duplicates.fingerprint(recording.piece(0, 200)) != duplicates.fingerprint(recording)
    assert duplicates.fingerprint(drive(30, seed=1)) != duplicates.fingerprint(recording)


def test_missing_samples_are_alike_whatever_their_bits(drive):
    one, other = drive(30), drive(30)
    one.channels["speed"][5] = np.nan
    other.channels["speed"][5] = -np.nan
    assert duplicates.fingerprint(one) == duplicates.fingerprint(other)


def test_an_adapted_truck_was_trained_on_both(drive, small, tmp_path):
    short = replace(small, updates=4, rounds=1)
    train([drive(60)], tmp_path / "first", short)
    truck = train([drive(60, seed=1)], tmp_path / "second", replace(short, start=str(tmp_path / "first")))
    assert duplicates.trained_on(truck, [drive(60, seed=k) for k in (0, 1, 2)]) == ["toy0", "toy1"]


def test_many_are_counted_and_older_trucks_know_none(truck, drive):
    drives = [drive(10, seed=k) for k in range(5)]
    assert duplicates.warning(truck, drives) == ""
    known = truck.with_details({duplicates.KEY: [duplicates.fingerprint(r) for r in drives]})
    assert "toy0, toy1, toy2 and 2 more" in duplicates.warning(known, drives)
    assert duplicates.warning(DeepTruck(truck.network, truck.interface), drives) == ""


def test_one_standstill_is_like_another_and_known_by_none(truck, drive):
    recording = drive(10)
    standing = replace(recording, channels=recording.channels | {"speed": np.zeros(len(recording))})
    known = truck.with_details({duplicates.KEY: [duplicates.fingerprint(r) for r in (standing, recording)]})
    assert duplicates.trained_on(known, [standing]) == []
    assert duplicates.trained_on(known, [recording]) == [recording.name]


def test_one_drive_under_two_names_is_refused(drive):
    monday = drive(60)
    duplicates.refuse_twice([monday, drive(60, seed=1)])
    with pytest.raises(InputError, match="given as 'toy0' and as 'copy'; give each drive once"):
        duplicates.refuse_twice([monday, replace(monday, name="copy")])
    with pytest.raises(InputError, match="given twice"):
        duplicates.refuse_twice([monday, monday])


def test_moments_that_are_alike_by_chance_are_not_one_drive(drive):
    duplicates.refuse_twice([drive(8), drive(8)])
