"""Engine and what it drives, where each law has a way of its own. What holds for all is in test_laws.py."""

import numpy as np
import pytest


def test_a_turbine_is_slower_after_a_hill(alone, held):
    lacking = []
    for torque in (1500.0, -100.0):
        law = alone("manifold_goes_cold")
        held(law, 40.0, engine_torque=torque)
        held(law, 4.0, engine_torque=150.0)
        lacking.append(held(law, 1.0, engine_torque=1600.0)[0])
    assert lacking[1] < lacking[0] < 0.0


def test_a_full_truck_does_not_meet_the_limit_of_acceleration(alone, held):
    law = alone("acceleration_management")
    assert np.all(held(law, 3.0, acceleration=0.1, speed=8.0) == 0.0)
    assert np.all(held(law, 3.0, acceleration=0.8, speed=8.0) < -1000.0)


def test_a_stalk_is_set_by_the_slope(alone, held):
    law = alone("stalk_set_by_eye")
    assert np.all(held(law, 4.0, u0=0.0, grade=0.02) == 0.0)
    law.reset(2)
    steep = held(law, 4.0, u0=0.0, grade=-0.06)
    law.reset(2)
    assert np.all(steep < 1.4 * held(law, 4.0, u0=0.0, grade=-0.015))
    assert np.all(held(law, 3.0, u0=600.0, grade=-0.06) > -50.0)


def test_a_bank_that_tripped_comes_back_after_a_closed_pedal(alone, held):
    law = alone("bank_trips")
    full = {"engine_torque": 1600.0, "engine_speed": 160.0, "u0": 1700.0}
    assert np.all(held(law, 60.0, **full) < -1000.0)
    held(law, 4.0, engine_torque=-80.0, u0=0.0)
    assert np.all(held(law, 0.1, **full) == 0.0)


def test_fuel_lacks_at_low_speed_once_the_store_is_empty(alone, held):
    lacking = []
    for speed in (100.0, 180.0):
        law = alone("worn_feed_pump")
        assert np.all(held(law, 0.05, engine_torque=1500.0, engine_speed=speed) == 0.0)
        lacking.append(held(law, 10.0, engine_torque=1500.0, engine_speed=speed)[0])
    assert lacking[0] < 1.2 * lacking[1] <= 0.0


def test_a_tap_on_the_brakes_switches_on_and_the_pedal_off(alone, held):
    law = alone("compression_brake_fills_itself")
    coasts = {"u0": 0.0, "engine_speed": 170.0}
    assert np.all(held(law, 3.0, **coasts) == 0.0)
    held(law, 0.1, brake_force=5000.0, **coasts)
    first = held(law, 0.1, **coasts)
    assert np.all(held(law, 15.0, **coasts) < 1.2 * first) and np.all(first < -500.0)
    assert np.all(held(law, 0.1, u0=300.0) == 0.0)


def test_a_short_lift_leaves_the_rotor_its_energy(alone, held):
    lost = []
    for lift_s in (0.6, 20.0):
        law = alone("rotor_has_energy")
        held(law, 30.0, engine_torque=1500.0)
        held(law, lift_s, engine_torque=-50.0)
        held(law, 3.0, engine_torque=1500.0)
        lost.append(law.s.charge[0])
    assert lost[0] > 1.15 * lost[1]


def test_a_fan_goes_off_well_below_where_it_came_on(alone, held):
    law = alone("fan_clutch_on_and_off")
    law.cools_cab = (np.full((2, 1), 1e9), np.full((2, 1), 2e9))
    held(law, 120.0, engine_torque=1800.0, engine_speed=180.0)
    assert np.all(law.s.on == 1.0)
    held(law, 0.1, engine_torque=0.0)
    assert np.all(law.s.on == 1.0)
    held(law, 200.0, engine_torque=0.0)
    assert np.all(law.s.on == 0.0)


def test_a_speed_held_downhill_holds_the_more_the_faster(alone, held):
    law = alone("speed_held_downhill")
    shut = {"u0": 0.0, "engine_torque": -100.0}
    first = held(law, 3.0, **shut)
    assert np.all(held(law, 3.0, **shut, speed=17.0) < first) and np.all(first < 0.0)


@pytest.mark.parametrize(
    ("key", "given"),
    [
        ("speed_held_downhill", {}),
        ("axle_torque_limit", {"traction_force": 500.0}),
        ("overboost", {"engine_torque": 200.0}),
        ("engine_brake_with_pedal", {}),
        ("full_torque_in_top_gears", {"engine_torque": 200.0}),
        ("retarder_sheds_heat", {}),
        ("engine_has_to_restart", {}),
        ("eases_before_the_crest", {}),
        ("acceleration_management", {}),
        ("manifold_goes_cold", {"engine_torque": 100.0}),
        ("stalk_set_by_eye", {}),
        ("bank_trips", {}),
        ("fast_idle_pushes", {}),
        ("compression_brake_fills_itself", {}),
    ],
)
def test_without_its_cause_there_is_no_force(key, given, alone, held):
    np.testing.assert_allclose(held(alone(key), 2.0, **given), 0.0, atol=1e-6)
