from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.deep import DeepTruck, train, trials
from deeptruck_model.deep.truck import half_width
from deeptruck_model.deep.uncertainty import _channel, calibrated, inside
from deeptruck_model.errors import InputError


def test_intervals_hold_what_they_promise_on_errors_of_known_kind():
    rng = np.random.default_rng(0)
    time = 0.1 * np.arange(1, 301)
    spread = rng.uniform(0.1, 0.3, (400, 300))

    def errors():
        return rng.standard_normal((400, 300)) * np.sqrt(spread**2 + (0.1 + 0.05 * np.sqrt(time)) ** 2)

    floor, growth, factor = _channel(errors(), spread, time)
    assert (floor, growth, factor) == (
        pytest.approx(0.1, abs=0.03),
        pytest.approx(0.05, abs=0.01),
        pytest.approx(1.64, abs=0.1),
    )
    calibration = {"floor": [floor], "growth": [growth], "factor": [factor]}
    widths = half_width(calibration, np.concatenate([spread[:, :1], spread], axis=1)[..., None], 0.1)
    assert (widths[:, 0] == 0).all()
    assert np.mean(np.abs(errors()) <= widths[:, 1:, 0]) == pytest.approx(0.9, abs=0.01)


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
