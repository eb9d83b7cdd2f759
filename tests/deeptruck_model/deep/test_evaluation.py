from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface, sensible
from deeptruck_model import trucks
from deeptruck_model.deep import DeepTruck, evaluate, statistics, train, trials
from deeptruck_model.deep.evaluation import Trials, against_time, calibrated, inside
from deeptruck_model.deep.remarks import (
    KEY,
    few_runs,
    remarks,
    speed_hash,
    trained_on,
    warning,
)


class Shifted:
    """A simulator that repeats a drive with a known error: speed too high by 0.1 m/s for every second."""

    dt = 0.1

    def __init__(self, recording):
        self.recording, self.interface = recording, recording.interface

    def rollout(self, u, w, y0, recorded):
        from deeptruck_model.simulators import Run

        runs = np.zeros((*u.shape[:2], 3))
        for i in range(len(u)):
            k = np.flatnonzero(
                (self.recording.y == y0[i]).all(axis=1) & (self.recording.u == u[i, 0]).all(axis=1)
            )
            runs[i] = self.recording.y[k[0] : k[0] + u.shape[1]]
        runs[..., 1] += 0.1 * self.dt * np.arange(u.shape[1])
        return Run(runs, {})


def test_known_error_is_found(drive):
    recording = drive(200)
    metrics = statistics(trials(Shifted(recording), [recording], 90, 40.0))
    assert metrics["trials"] == 90 and metrics["horizon_s"] == pytest.approx(40.0)
    assert metrics["speed"]["mean_at_end"] == pytest.approx(4.0)
    assert metrics["speed"]["sd_at_end"] == pytest.approx(0.0, abs=1e-9)
    assert metrics["speed"]["mean_abs"] == pytest.approx(0.1 * 20.05)
    assert metrics["speed"]["trials_within_1.5"] == 0.0
    assert metrics["acceleration"]["mean_abs"] == 0.0


def test_invalid_samples_do_not_count():
    measured = np.zeros((2, 3, 2))
    measured[0, 1:, 1] = np.nan
    modelled = np.ones((2, 3, 2))
    runs = Trials(
        np.zeros((2, 3, 1)), np.zeros((2, 3, 0)), measured, modelled, 0.1, ("acceleration", "speed")
    )
    mean, deviation = against_time(runs)
    assert (mean == 1).all() and (deviation == 0).all()
    assert statistics(runs)["speed"]["mean_abs"] == 1.0
    measured[:, 2, 1] = np.nan
    assert statistics(runs)["speed"]["sd_at_end"] is None


def test_writes_figures_and_metrics(truck, drive, tmp_path):
    metrics = evaluate(truck, [drive(120, seed=7)], tmp_path / "out", count=8, horizon_s=10)
    assert json.loads((tmp_path / "out" / "metrics.json").read_text()) == metrics
    names = {p.name for p in (tmp_path / "out").iterdir()}
    figures = ("error_statistics.png", "scenarios.png", "samples.png")
    assert names == {"metrics.json", *figures, "evaluation.html", files.MARKER}
    text = (tmp_path / "out" / "evaluation.html").read_text()
    for key in ("mean_abs", "rmse", "largest"):
        assert f">{sensible(metrics['speed'][key])}<" in text
    assert len(metrics["baselines"]) == 2
    assert text.count("data:image/png;base64,") == 3 and "<script" not in text


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda r: replace(r, dt=1.0), "give recordings of the simulator's rate"),
        (lambda r: replace(r, interface=TruckInterface("x", engine_unit="percent")), "in percent"),
        (lambda r: replace(r, channels={k: v for k, v in r.channels.items() if k != "grade"}), "no grade"),
        (lambda r: r.piece(0, 20), "no segment of 3 s"),
    ],
)
def test_recordings_that_do_not_fit(truck, drive, change, says):
    with pytest.raises(InputError, match=says):
        trials(truck, [change(drive(60))])


def test_prediction_of_a_trained_truck(drive, small, tmp_path):
    truck = train([drive(3600)], tmp_path / "sim", replace(small, members=2))
    runs = trials(truck, [drive(600, seed=11)], 60, 20.0)
    prediction = truck.predict(runs.u, runs.w, runs.modelled[:, 0])
    np.testing.assert_array_equal(prediction.y, runs.modelled)
    held = (runs.measured >= prediction.low) & (runs.measured <= prediction.high)
    assert 0.8 < held[:, 1:, 1].mean() < 0.98
    assert prediction.covered.shape == runs.modelled.shape[:2]
    spread = truck.spread(runs.u, runs.w, runs.modelled[:, 0])[..., 1]
    moving = runs.modelled[..., 1] > 1.0
    assert (spread[:, 0] == 0).all() and (spread[:, 5:][moving[:, 5:]] > 0).all()


def test_other_drives_set_the_intervals_better_and_a_third_confirms_it(truck, drive):
    again, runs = calibrated(truck, [drive(1800, seed=21)]), trials(truck, [drive(1800, seed=23)], 100)
    assert again.details["calibration"]["recordings"] == ["toy21"]
    own, other = (inside(t, runs) for t in (truck, again))
    assert set(other) == {"acceleration", "speed", "fuel_rate"}
    worst = [max(abs(share - 0.9) for share in shares.values()) for shares in (other, own)]
    assert worst[0] < 0.07 and worst[0] < worst[1]


# What an evaluation remarks on


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


def test_another_truck_by_the_intervals_it_leaves(truck, drive):
    recording = drive(200)
    little = {**ENOUGH, "speed": {"inside_90": 0.4}}
    (line,) = remarks(truck, [recording], little)
    assert "40 %" in line


def test_runs_shorter_than_asked_for(truck, drive):
    metrics = {**ENOUGH, "horizon_s": 39.9, "dt": 0.1}
    assert len(remarks(truck, [drive(600, seed=4)], metrics, 5000.0)) == 1
    assert remarks(truck, [drive(600, seed=4)], {**metrics, "horizon_s": 40.0}, 40.04) == []


def test_an_uncalibrated_truck_says_so(truck):
    bare = DeepTruck(truck.network, truck.interface)
    with pytest.raises(InputError, match="no calibrated intervals"):
        bare.predict(np.zeros((1, 5, 2)), np.zeros((1, 5, 1)), np.zeros((1, 3)))
