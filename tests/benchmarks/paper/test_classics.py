from __future__ import annotations

import numpy as np
import pytest

from benchmarks.paper import classics
from benchmarks.paper.classics import physics
from deeptruck_model import trucks
from deeptruck_model.deep import statistics, trials
from deeptruck_model.simulators import Simulator
from deeptruck_model.trucks.driving_cycles import drive


@pytest.mark.parametrize("name", ["ARX", "NARX"])
def test_learns_a_linear_truck(drive, name):
    """A truck that is an ARX model itself: a(k+1) from the last two commands and the grade."""
    recordings = []
    for seed in range(2):
        recording = drive(300, seed=seed)
        u, grade = recording.u, recording.w[:, 0]
        acceleration = np.zeros(len(recording))
        acceleration[2:] = 6e-4 * u[1:-1, 0] + 4e-4 * u[:-2, 0] - 0.4 - 0.02 * u[1:-1, 1] - 9.81 * grade[1:-1]
        recording.channels["acceleration"] = acceleration
        recording.channels["speed"] = 200 + np.cumsum(acceleration) * recording.dt
        recordings.append(recording)
    model = classics.MODELS[name](recordings[:1])
    assert isinstance(model, Simulator)
    metrics = statistics(trials(model, recordings[1:], 10, 10.0))
    assert metrics["speed"]["rmse_at_end"] < 0.2


def test_a_model_that_runs_away_stays_a_number(drive):
    recording = drive(60)
    wild = classics.Regression(recording.interface, recording.dt, lambda rows: rows[:, -3:-1] ** 2 + 1e3)
    runs = trials(wild, [recording], 3, 20.0)
    assert np.isfinite(runs.modelled).all() and statistics(runs)["speed"]["mean_abs"] > 100


@pytest.fixture(scope="module")
def recording():
    return drive(trucks.load("trucksim"), seconds=900, seed=1)


def test_fitting_makes_it_better_on_another_drive(recording, monkeypatch):
    monkeypatch.setattr(classics, "RUNS", 25)
    test = drive(trucks.load("trucksim"), seconds=900, seed=2)

    def error(evaluations):
        return statistics(trials(physics([recording], evaluations), [test], 40))["speed"]["mean_abs"]

    assert error(250) < 0.8 * error(1)


def test_ratios_are_read_off_the_recording(recording):
    truth, found = trucks.load("trucksim").specification, physics([recording], 1).specification
    force_per_torque = found.values["final_drive"] / found.values["wheel_radius"]
    expected = np.array(truth.ratios) * truth.values["final_drive"] / truth.values["wheel_radius"]
    np.testing.assert_allclose(np.array(found.ratios)[2:] * force_per_torque, expected[2:], rtol=0.02)


def test_states_of_the_drive_itself_repeat_it(monkeypatch):
    truck = trucks.load("trucksim")
    recording = drive(truck, seconds=300, seed=1)
    monkeypatch.setattr(classics, "NEAREST", 1)
    runs = trials(classics.LookAlikes(truck, recording), [recording], 10, 40.0)
    assert np.abs(runs.error[..., 1]).max() < 1e-9


def test_what_looked_alike_is_a_better_guess_than_a_settled_truck():
    truck = trucks.load("trucksim")
    known, test = drive(truck, seconds=3600, seed=1), drive(truck, seconds=600, seed=2)
    guessed = statistics(trials(classics.LookAlikes(truck, known), [test], 40, 20.0))
    settled = statistics(trials(truck, [test], 40, 20.0))
    assert guessed["acceleration"]["mean_abs"] < settled["acceleration"]["mean_abs"]
