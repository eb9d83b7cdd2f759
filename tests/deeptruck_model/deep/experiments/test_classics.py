import numpy as np
import pytest

from deeptruck_model.deep import statistics, trials
from deeptruck_model.deep.experiments import classics
from deeptruck_model.simulators import Simulator


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
