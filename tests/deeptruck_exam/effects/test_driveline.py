"""Driveline, where each law has a way of its own. What holds for all is in test_laws.py."""

import numpy as np
import pytest


def test_a_rotor_takes_and_does_not_give_back(alone, held):
    law = alone("freewheeling_rotor")
    held(law, 0.1, speed=10.0)
    assert np.all(held(law, 0.2, speed=12.0) < -500.0)
    assert np.all(held(law, 0.2, speed=8.0) == 0.0)


def test_lash_is_crossed_sooner_in_a_high_gear(alone, held):
    waits = []
    for ratio in (4.0, 30.0):
        law = alone("lash_by_the_gear")
        held(law, 1.0, traction_force=-2000.0, engine_torque=-80.0, ratio=ratio)
        steps = 0
        while held(law, 0.01, ratio=ratio)[0] < -4000.0:
            steps += 1
        waits.append(steps)
    assert 0 < waits[0] < waits[1] < 200


def test_a_damper_holds_in_the_end_what_the_engine_gives(alone, held):
    law = alone("worn_clutch_damper")
    held(law, 20.0)
    np.testing.assert_allclose(held(law, 0.1), 0.0, atol=1.0)
    assert np.all(held(law, 0.01, engine_torque=-100.0) > 1000.0)


def test_oil_is_flung_up_and_teeth_rub_instead(alone, held):
    law = alone("oil_is_flung_up")
    first = held(law, 0.01, speed=20.0, traction_force=0.0)
    assert np.all(held(law, 120.0, speed=20.0, traction_force=0.0) > 0.6 * first)
    assert np.all(held(law, 0.01, speed=20.0, traction_force=20000.0) < 0.7 * first)


def test_an_inertia_resists_change(acted):
    force, seen = acted("damped_flywheel")
    acceleration = np.array([view.acceleration for view in seen])
    assert np.corrcoef(force.ravel(), acceleration.ravel())[0, 1] < -0.4


def test_a_bearing_runs_hot_at_speed(alone, held):
    law = alone("bearing_runs_hot")
    assert np.all(held(law, 90.0, speed=22.0) < 3.0 * held(law, 300.0, speed=8.0))


def test_contacts_that_stood_stick(alone, held):
    law = alone("stuck_after_standing")
    assert np.all(held(law, 2.0) == 0.0)
    held(law, 6.0, speed=0.0)
    assert np.all(held(law, 0.1, speed=1.0) < -0.02 * 2e4 * 9.81)
    assert np.all(held(law, 60.0, speed=10.0) > -50.0)


@pytest.mark.parametrize(
    ("key", "atol"),
    [
        ("dogs_miss", 0.0),
        ("freewheeling_rotor", 5.0),
        ("four_plays_in_a_row", 0.0),
        ("gearbox_brake_in_cold_oil", 0.0),
        ("hole_in_the_blending", 0.0),
        ("dolly_pushes_uphill", 0.0),
        ("filled_gaps_are_paid_back", 1e-6),
    ],
)
def test_without_its_cause_there_is_no_force(key, atol, alone, held):
    np.testing.assert_allclose(held(alone(key), 2.0), 0.0, atol=atol)


def test_two_masses_with_play_come_to_rest(alone, held):
    np.testing.assert_allclose(held(alone("two_masses_and_play"), 9.0), 0.0, atol=80.0)
