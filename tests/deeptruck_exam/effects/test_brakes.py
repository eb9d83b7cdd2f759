"""Brakes, where each law has a way of its own. What holds for all is in test_laws.py."""

import numpy as np
import pytest


def test_a_chamber_fills_the_slower_the_gentler(alone, held):
    law = alone("chamber_stroke")
    missing = []
    for share in (0.1, 0.6):
        law.reset(2)
        force = share * law.truck.brake_capacity
        missing.append(held(law, 0.7, brake_force=force)[0] / force)
        assert np.all(held(law, 8.0, brake_force=force) < 0.02 * force)
        assert np.all(held(law, 0.05) < 0.0)
    assert missing[0] > 1.2 * missing[1]


def test_new_linings_fade_once(alone, held):
    law = alone("green_linings")
    first = max(held(law, 10.0, brake_force=4e4)[0] for _ in range(6))
    held(law, 200.0, brake_force=4e4)
    assert first > 0.1 * 4e4 and held(law, 10.0, brake_force=4e4)[0] < 0.3 * first


def test_a_brake_adjusted_hot_drags_when_it_has_cooled(alone, held):
    law = alone("slack_adjusted_hot")
    law.s.drum[:] = law.s.taken[:] = 20.0
    held(law, 40.0, brake_force=4e4)
    hot, cooled = held(law, 0.1)[0], held(law, 90.0)[0]
    assert cooled < -300.0 and hot > 0.2 * cooled


def test_bands_need_speed_and_heat_and_stay_for_a_while(alone, held):
    law = alone("hot_bands")
    slow = held(law, 60.0, brake_force=3e4, speed=3.0)
    assert np.all(slow < 0.02 * 3e4)
    fast = held(law, 60.0, brake_force=3e4, speed=18.0)
    assert np.all(fast > 0.15 * 3e4)
    assert np.all(held(law, 3.0, brake_force=3e4, speed=3.0) > 0.5 * fast)


def test_brakes_are_the_slower_the_emptier_their_tanks(alone, held):
    missing = []
    for tank in (1.0, 0.4):
        law = alone("tanks_run_low")
        law.s.tank[:] = tank
        missing.append(held(law, 0.5, brake_force=4e4)[0])
    assert missing[1] > 1.1 * missing[0] > 0.0


def test_frozen_shoes_thaw_on_the_way(alone, held):
    law = alone("shoes_frozen_on")
    first, later = held(law, 0.1), held(law, 300.0)
    assert np.all(first < -500.0) and np.all(later > 0.2 * first)


def test_more_is_braked_on_the_way_down_than_on_the_way_up(alone, held):
    law = alone("cam_hysteresis")
    up = held(law, 1.0, brake_force=1e4)
    held(law, 1.0, brake_force=3e4)
    assert np.all(up == 0.0) and np.all(held(law, 0.1, brake_force=1e4) < -3000.0)
    assert np.all(held(law, 5.0) > -50.0)


def test_fluid_boils_on_after_the_brakes_are_let_go(alone, held):
    law = alone("fluid_boils")
    held(law, 60.0, brake_force=3e4)
    hot = law.s.fluid.copy()
    held(law, 5.0)
    assert np.all(law.s.vapour > 0.5) and np.all(law.s.fluid > 0.9 * hot)
    gentle, hard = (held(law, 0.01, brake_force=n)[0] for n in (8e3, 6e4))
    assert gentle / 8e3 > 2.0 * hard / 6e4 > 0.0


def test_brakes_are_late_only_while_the_plug_fails(alone, held):
    law = alone("falls_back_on_air")
    law.fails = (np.full((2, 1), 1e9), np.full((2, 1), 2e9))
    assert np.all(held(law, 0.5, brake_force=4e4) == 0.0)
    law.reset(2)
    law.fails = (np.zeros((2, 1)), np.full((2, 1), 1e9))
    assert np.all(held(law, 0.5, brake_force=4e4) > 0.2 * 4e4)
    assert np.all(held(law, 20.0, brake_force=4e4) < 0.02 * 4e4)
    assert np.all(held(law, 0.1) < -2e3)


def test_a_leaking_valve_drags_the_more_the_longer_nobody_braked(alone, held):
    law = alone("leaks_into_the_chambers")
    held(law, 1.0, brake_force=2e4)
    drags = [held(law, 10.0)[0] for _ in range(4)]
    assert drags[3] < drags[1] <= 0.0 and drags[3] < -1500.0
    assert np.all(np.abs(held(law, 2.0, brake_force=2e4)) < 10.0)


def test_a_gentle_release_keeps_more_air_than_a_quick_one(alone, held):
    kept = []
    for steps in (5, 300):
        law = alone("held_back_by_the_release_valve")
        for k in range(steps):
            held(law, 0.01, brake_force=20000.0 * (1.0 - k / steps))
        kept.append(held(law, 0.05)[0])
    assert kept[1] < 1.5 * kept[0] < 0.0


def test_brakes_fade_on_a_long_descent_and_recover(alone, held):
    law = alone("brake_fade")
    descent = {"brake_force": 4e4, "speed": 18.0}
    early, late = held(law, 0.01, **descent), held(law, 120.0, **descent)
    assert early[0] < 10.0 and late[0] > 0.1 * 4e4
    held(law, 1200.0, dt=0.1, speed=18.0)
    assert held(law, 0.01, **descent)[0] < 0.5 * late[0]


def test_fade_needs_heat_and_pressure_together(alone, held):
    law = alone("stroke_runs_out")
    full = law.truck.brake_capacity
    cold = held(law, 0.01, brake_force=0.3 * full)[0]
    law.s.drum[:] = 320.0
    hot = held(law, 0.01, brake_force=0.3 * full)[0]
    gentle = held(law, 0.01, brake_force=0.02 * full)[0] / 0.02
    assert cold < 0.02 * full and 0.1 < hot / (0.3 * full) < 0.9 and gentle < hot / 0.3


def test_a_late_brake_lets_run_on(acted):
    force, seen = acted("relay_valve_sticks")
    pressed = np.diff([view.brake_force for view in seen], axis=0, prepend=0.0)
    assert force[pressed > 50.0].mean() > 0.0 > force[pressed < -50.0].mean()


def test_pads_that_stay_on_drag_after_the_first_brake(alone, held):
    law = alone("pads_stay_on")
    assert np.all(held(law, 2.0) == 0.0)
    held(law, 1.0, brake_force=2e4)
    dragging = held(law, 0.01)
    assert np.all(dragging < -500.0) and np.all(held(law, 120.0) > 0.5 * dragging)


def test_heat_that_soaks_in_costs_later(alone, held):
    law = alone("soaking_heat")
    early, late = held(law, 1.0, brake_force=1e4), held(law, 100.0, brake_force=3e4)
    assert np.all(early < 1.0) and np.all(late > 0.08 * 3e4)


@pytest.mark.parametrize(
    "key",
    [
        "pads_stay_on", "long_pipes", "soaking_heat", "chamber_stroke", "green_linings",
        "timed_trailer_brakes", "hot_bands", "tanks_run_low", "stages_by_acceleration", "cam_hysteresis",
        "antilock_is_fooled", "fluid_boils", "falls_back_on_air", "foot_after_the_lever",
        "skin_of_the_drum", "orifice_chokes",
        "held_back_by_the_release_valve",
    ],
)  # fmt: skip
def test_without_a_brake_there_is_no_force(key, alone, held):
    np.testing.assert_allclose(held(alone(key), 2.0), 0.0, atol=1e-6)
