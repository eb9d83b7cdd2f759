"""Wind, wakes and bodies, where each law has a way of its own. What holds for all is in test_laws.py."""

import numpy as np
import pytest

from deeptruck_exam.effects.series import davenport, spells, within


def test_a_series_of_gusts_has_unit_variance_and_more_power_at_low_frequency():
    series = davenport(np.random.default_rng(3), (4, 4000), 0.2, np.full((4, 1), 40.0))
    np.testing.assert_allclose(series.std(axis=1), 1.0)
    power = np.abs(np.fft.rfft(series, axis=1)) ** 2
    assert power[:, 5:50].mean() > 20.0 * power[:, 500:].mean()


def test_wind_of_a_burst_turns_about_its_centre(alone, scene):
    law = alone("downbursts")
    law.aside[:], law.begins[:], law.centre[:] = 0.0, -60.0, 2000.0
    before, after = (law.force(scene(speed=20.0, distance=m), 0.01) for m in (1500.0, 2500.0))
    assert np.all(before < -300.0) and np.all(after > 300.0)


def test_a_pocket_is_kept_longer_than_it_takes_to_find_it(alone, held):
    law = alone("pocket_lost_and_found")
    between = law.p.finds_m * 0.5 * (1.0 + law.p.wider)
    saved = []
    for gap in (between, 10.0, between, 200.0, between):
        law.setting.leader_m[:] = gap
        saved.append(held(law, 20.0)[0])
    assert saved[0] == 0.0 and saved[1] > 100.0
    np.testing.assert_allclose(saved[2], saved[1], rtol=1e-3)
    assert abs(saved[3]) < 1.0 and abs(saved[4]) < 1.0


def test_a_raised_body_comes_down_again(alone, held):
    law = alone("body_creeps_up")
    law.spells = (np.zeros((2, 1)), np.full((2, 1), 1e9))
    assert np.all(held(law, 120.0) < -0.4 * 700.0)
    law.spells = (np.full((2, 1), 1e9), np.full((2, 1), 2e9))
    assert np.all(held(law, 60.0) > -1e-6)


def test_wind_of_an_oval_turns_within_a_lap(alone, scene):
    law = alone("wind_round_the_oval")
    law.first, law.veer[:] = 0.0, 0.0
    there, back = (
        law.force(scene(speed=20.0, distance=share * law.p.round_m - 9000.0 % law.p.round_m), 0.01)[0]
        for share in (0.1, 0.6)
    )
    assert there * back < 0.0


def test_a_cover_fills_with_the_way_and_collapses(alone, held):
    law = alone("cover_fills_like_a_canopy")
    assert np.all(held(law, 60.0, speed=20.0) < -0.6 * 700.0)
    assert np.all(held(law, 20.0, speed=20.0, acceleration=-0.6) > -10.0)


def test_spells_come_and_go():
    some = spells(np.random.default_rng(2), 3, (10.0, 20.0), (5.0, 10.0))
    share = np.mean([within(some, t) for t in np.arange(0.0, 400.0, 0.5)])
    assert 0.55 < share < 0.78


@pytest.mark.parametrize(
    "key",
    [
        "pocket_behind_leader",
        "out_of_the_slot",
        "wake_blown_aside",
        "pocket_lost_and_found",
        "wake_takes_its_time",
    ],
)
def test_without_a_leader_there_is_no_slipstream(key, alone, held):
    np.testing.assert_allclose(held(alone(key), 2.0), 0.0, atol=1e-6)
