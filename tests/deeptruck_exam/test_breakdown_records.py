"""The sixth forms, where each has a way of its own; what holds for all is in test_families.py."""

from types import SimpleNamespace

import numpy as np
import pytest

from deeptruck_exam import makers
from deeptruck_exam.breakdown_records.air import spells, within
from deeptruck_exam.breakdown_records.world import draw_profile, draw_way_down
from deeptruck_exam.construction import build
from deeptruck_exam.effects import EFFECTS
from deeptruck_exam.plans import draw_plan


@pytest.mark.parametrize(
    "key",
    [
        "pocket_lost_and_found",
        "fluid_boils",
        "falls_back_on_air",
        "stalk_set_by_eye",
        "foot_after_the_lever",
        "bank_trips",
        "fast_idle_pushes",
        "remembers_a_speed",
        "override_lingers",
        "keeps_off_the_leader",
        "dolly_pushes_uphill",
    ],
)
def test_what_needs_a_cause_is_nothing_without_it(key, alone, held):
    np.testing.assert_allclose(held(alone(key), 2.0), 0.0, atol=1e-9)


def test_wind_of_a_burst_turns_about_its_centre(alone, scene):
    law = alone("downbursts")
    law.aside[:], law.begins[:], law.centre[:] = 0.0, -60.0, 2000.0
    before, after = (law.newtons(scene(speed=20.0, distance=m), 0.01) for m in (1500.0, 2500.0))
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


def test_a_damper_holds_in_the_end_what_the_engine_gives(alone, held):
    law = alone("worn_clutch_damper")
    held(law, 20.0)
    np.testing.assert_allclose(held(law, 0.1), 0.0, atol=1.0)
    assert np.all(held(law, 0.01, engine_torque=-100.0) > 1000.0)


def test_liquid_lies_or_coats_by_what_was_before(alone, held):
    law = alone("liquid_in_the_tyres")
    between = 0.5 * (1.0 + law.p.falls) * law.p.coats_mps
    slow = held(law, 20.0, speed=between)
    held(law, 20.0, speed=20.0)
    assert np.all(slow < -1000.0) and np.all(held(law, 20.0, speed=between) > 0.01 * slow)


def test_a_pedal_sticks_after_a_rest_and_braking_frees_it(alone, held):
    law = alone("pedal_sticks_where_it_rests")
    full = law.truck.full_command
    held(law, 10.0, u0=0.5 * full)
    assert np.all(held(law, 0.3, u0=0.4 * full) > 500.0)
    assert np.all(held(law, 0.1, u0=0.4 * full, u1=10.0) == 0.0)


def test_a_kick_is_let_in_more_slowly_than_a_press(planted):
    parts, _ = planted(EFFECTS["kicks_are_doubted"])
    (one,) = parts.filters
    given = []
    for ramp in (5, 300):
        one.reset(1)
        for k in range(300):
            u = np.array([[0.8 * one.full * min(k / ramp, 1.0), 0.0]])
            out = one.filter(u, 0.01 * k, 0.01)
        given.append(out[0, 0])
    assert given[0] < 0.8 * given[1]


def test_commands_are_played_in_order_and_all_of_them(planted):
    parts, _ = planted(EFFECTS["playout_buffer"])
    (one,) = parts.filters
    one.reset(1)
    played = [one.filter(np.full((1, 2), 1.0 * k), 0.01 * k, 0.01)[0, 0] for k in range(3000)]
    steps = np.diff(played)
    assert steps.min() >= 0.0 and steps.max() <= 2.0 and 2700.0 < played[-1] < 2990.0


def test_faults_keep_their_word():
    rng = np.random.default_rng(1)
    p = SimpleNamespace(sign=1.0, late_s=0.3, metres=6.0, scale=0.06, shared=0.5, stays_s=20.0)
    channels = {"acceleration": np.arange(600) * 0.1, "speed": np.repeat([6.0, 20.0], 300)}
    EFFECTS["stamped_by_the_way"].build(SimpleNamespace(), p).faults[0](channels, 0.1, rng)
    off = np.arange(600) * 0.1 - channels["acceleration"]
    np.testing.assert_allclose(off[[100, 500]], [1.3, 0.6])
    EFFECTS["one_of_two_wheels"].build(SimpleNamespace(), p).faults[0](channels, 0.1, rng)
    share = channels["speed"] / np.repeat([6.0, 20.0], 300) - 1.0
    assert 0.029 < share.min() < 0.031 and 0.059 < share.max() < 0.061


def test_spells_come_and_go():
    some = spells(np.random.default_rng(2), 3, (10.0, 20.0), (5.0, 10.0))
    share = np.mean([within(some, t) for t in np.arange(0.0, 400.0, 0.5)])
    assert 0.55 < share < 0.78


def test_the_land_is_flat_between_climbs_and_the_way_down_goes_down():
    rng = np.random.default_rng(5)
    grade = draw_profile(rng, 0.03)
    assert 0.3 < np.mean(np.abs(grade) < 0.003) < 0.7 and 0.025 < grade.std() < 0.032
    down = draw_way_down(rng)
    assert down.max() < -0.01 and -0.06 < down.mean() < -0.035


def test_machines_keep_their_speed_within_reason():
    built = build(draw_plan("closed_loop", 4, "joint_at_an_angle", "physics", 2.0, forms="sixth"))
    assert set(built.plan.styles) <= {"cruise", "acc"}
    assert makers.of("sixth", "physics").driver.__name__ == "Planning"
    assert np.abs(built.drives.channels["acceleration"]).max() < 4.0
