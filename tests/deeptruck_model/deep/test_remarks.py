from __future__ import annotations

from dataclasses import replace

import numpy as np

from deeptruck_model import trucks
from deeptruck_model.deep import DeepTruck, train
from deeptruck_model.deep.remarks import (
    KEY,
    few_runs,
    remarks,
    speed_hash,
    trained_on,
    warning,
)

ENOUGH = {"trials": 3, "horizon_s": 40.0, "speed": {"inside_90": 0.88}}


def test_runs_that_overlap_are_remarked_on_for_every_simulator(truck, drive):
    assert remarks(truck, [drive(600, seed=4)], ENOUGH) == []
    for judged in (truck, trucks.load("trucksim")):
        (line,) = remarks(judged, [drive(60), drive(60, seed=1)], {**ENOUGH, "trials": 90})
        assert "about 3 indep" in line
    assert few_runs(truck, [drive(72)]) and not few_runs(truck, [drive(60)] * 30)


def test_driving_that_the_training_had_not(truck, drive):
    recording = drive(200)
    faster = replace(recording, channels=recording.channels | {"speed": recording.channels["speed"] + 60.0})
    (line,) = remarks(truck, [recording, faster], ENOUGH)
    assert line.startswith("50 %")
    unknown = replace(recording, channels=recording.channels | {"grade": np.full(len(recording), np.nan)})
    assert remarks(truck, [unknown], ENOUGH) == []


def test_another_truck_by_the_intervals_it_leaves(truck, drive):
    recording = drive(200)
    little = {**ENOUGH, "speed": {"inside_90": 0.4}}
    (line,) = remarks(truck, [recording], little)
    assert "40 %" in line


def test_runs_shorter_than_asked_for(truck, drive):
    metrics = {**ENOUGH, "horizon_s": 39.9, "dt": 0.1}
    assert len(remarks(truck, [drive(600, seed=4)], metrics, 5000.0)) == 1
    assert remarks(truck, [drive(600, seed=4)], {**metrics, "horizon_s": 40.0}, 40.04) == []


def test_a_recording_is_known_by_another_name_but_not_changed(drive):
    recording = drive(30)
    renamed = replace(recording, name="copy", channels={"speed": recording.channels["speed"].copy()})
    assert speed_hash(renamed) == speed_hash(recording)
    assert speed_hash(recording.piece(0, 200)) != speed_hash(recording)
    assert speed_hash(drive(30, seed=1)) != speed_hash(recording)
    other = drive(30)
    recording.channels["speed"][5], other.channels["speed"][5] = np.nan, -np.nan
    assert speed_hash(recording) == speed_hash(other), "missing samples are alike whatever their bits"


def test_an_adapted_truck_was_trained_on_both(drive, small, tmp_path):
    short = replace(small, updates=4, rounds=1)
    train([drive(60)], tmp_path / "first", short)
    truck = train([drive(60, seed=1)], tmp_path / "second", replace(short, start=str(tmp_path / "first")))
    assert trained_on(truck, [drive(60, seed=k) for k in (0, 1, 2)]) == ["toy0", "toy1"]
    assert warning(truck, [drive(60)]) and not warning(truck, [drive(60, seed=2)])
    assert warning(DeepTruck(truck.network, truck.interface), [drive(60)]) == "", "older trucks know none"


def test_one_standstill_is_like_another_and_known_by_none(truck, drive):
    recording = drive(10)
    standing = replace(recording, channels=recording.channels | {"speed": np.zeros(len(recording))})
    known = truck.with_details({KEY: [speed_hash(r) for r in (standing, recording)]})
    assert trained_on(known, [standing]) == []
    assert trained_on(known, [recording]) == [recording.name]
