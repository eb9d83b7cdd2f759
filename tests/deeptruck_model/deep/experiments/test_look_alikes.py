import numpy as np

from deeptruck_model import trucks
from deeptruck_model.deep import statistics, trials
from deeptruck_model.deep.experiments import look_alikes
from deeptruck_model.driving_cycles import drive


def test_states_of_the_drive_itself_repeat_it(monkeypatch):
    truck = trucks.load("trucksim")
    recording = drive(truck, seconds=300, seed=1)
    monkeypatch.setattr(look_alikes, "NEAREST", 1)
    runs = trials(look_alikes.LookAlikes(truck, recording), [recording], 10, 40.0)
    assert np.abs(runs.error[..., 1]).max() < 1e-9


def test_what_looked_alike_is_a_better_guess_than_a_settled_truck():
    truck = trucks.load("trucksim")
    known, test = drive(truck, seconds=3600, seed=1), drive(truck, seconds=600, seed=2)
    guessed = statistics(trials(look_alikes.LookAlikes(truck, known), [test], 40, 20.0))
    settled = statistics(trials(truck, [test], 40, 20.0))
    assert guessed["acceleration"]["mean_abs"] < settled["acceleration"]["mean_abs"]
