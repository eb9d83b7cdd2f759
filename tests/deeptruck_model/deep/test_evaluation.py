from __future__ import annotations

import errno
import json
from dataclasses import replace

import numpy as np
import pytest

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface, sensible
from deeptruck_model.deep import DeepTruck, evaluate, report, statistics, train, trials
from deeptruck_model.deep.evaluation import Trials, against_time, baselines, calibrated, inside


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


def test_short_recordings_shorten_the_horizon(truck, drive):
    runs = trials(truck, [drive(12, seed=7)], 5, 40.0)
    assert runs.measured.shape[1] == 120


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


@pytest.mark.parametrize("horizon", [float("inf"), float("nan"), 0.0])
def test_a_horizon_that_is_none_is_refused(truck, drive, horizon):
    with pytest.raises(InputError, match="is none; give seconds, such as 40"):
        trials(truck, [drive(60)], 3, horizon)


@pytest.mark.usefixtures("undrawn")
def test_a_full_disk_leaves_the_old_evaluation(truck, drive, tmp_path, monkeypatch):
    evaluate(truck, [drive(60)], tmp_path, 3, 10.0)
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}

    def full(runs):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setitem(report.DRAWN, "samples.png", full)
    with pytest.raises(InputError, match="No space left on device; make room"):
        evaluate(truck, [drive(60)], tmp_path, 4, 10.0, overwrite=True)
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == before


def test_a_constant_speed_keeps_the_start(drive):
    recording = drive(60)
    runs = trials(Shifted(recording), [recording], 5, 10.0)
    (constant, *_) = baselines(runs, recording.interface)
    measured = runs.measured[..., 1]
    assert constant["speed"]["rmse"] == pytest.approx(
        np.sqrt(np.mean((measured[:, 1:] - measured[:, :1]) ** 2))
    )


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


def test_an_uncalibrated_truck_says_so(truck):
    bare = DeepTruck(truck.network, truck.interface)
    with pytest.raises(InputError, match="no calibrated intervals"):
        bare.predict(np.zeros((1, 5, 2)), np.zeros((1, 5, 1)), np.zeros((1, 3)))
