import numpy as np
import pytest

from deeptruck_model import trucks
from deeptruck_model.deep import statistics, trials
from deeptruck_model.deep.experiments import fitted_physics
from deeptruck_model.deep.experiments.fitted_physics import physics
from deeptruck_model.driving_cycles import drive


@pytest.fixture(scope="module")
def recording():
    return drive(trucks.load("trucksim"), seconds=900, seed=1)


def test_fitting_makes_it_better_on_another_drive(recording, monkeypatch):
    monkeypatch.setattr(fitted_physics, "RUNS", 25)
    test = drive(trucks.load("trucksim"), seconds=900, seed=2)

    def error(evaluations):
        return statistics(trials(physics([recording], evaluations), [test], 40))["speed"]["mean_abs"]

    assert error(250) < 0.8 * error(1)


def test_ratios_are_read_off_the_recording(recording):
    truth, found = trucks.load("trucksim").specification, physics([recording], 1).specification
    lever = found.values["final_drive"] / found.values["wheel_radius"]
    expected = np.array(truth.ratios) * truth.values["final_drive"] / truth.values["wheel_radius"]
    np.testing.assert_allclose(np.array(found.ratios)[2:] * lever, expected[2:], rtol=0.02)
