"""The seventh forms, where each has a way of its own; what holds for all is in test_families.py."""

from types import SimpleNamespace

import numpy as np
import pytest

from deeptruck_exam import makers
from deeptruck_exam.construction import build
from deeptruck_exam.effects import EFFECTS
from deeptruck_exam.page import _by_effect
from deeptruck_exam.plans import draw_plan
from deeptruck_exam.proving_ground.loggers import heard
from deeptruck_exam.proving_ground.traffic import speed_profile
from deeptruck_exam.proving_ground.world import BALLAST, draw_profile, draw_way_down


@pytest.mark.parametrize(
    "key",
    [
        "wake_takes_its_time",
        "skin_of_the_drum",
        "orifice_chokes",
        "held_back_by_the_release_valve",
        "compression_brake_fills_itself",
        "chainage_runs_away",
        "concrete_yields",
        "grounds_on_crests",
        "filled_gaps_are_paid_back",
    ],
)
def test_what_needs_a_cause_is_nothing_without_it(key, alone, held):
    np.testing.assert_allclose(held(alone(key), 2.0), 0.0, atol=1e-6)


def test_wind_of_an_oval_turns_within_a_lap(alone, scene):
    law = alone("wind_round_the_oval")
    law.first, law.veer[:] = 0.0, 0.0
    there, back = (
        law.newtons(scene(speed=20.0, distance=share * law.p.round_m - 9000.0 % law.p.round_m), 0.01)[0]
        for share in (0.1, 0.6)
    )
    assert there * back < 0.0


def test_a_cover_fills_with_the_way_and_collapses(alone, held):
    law = alone("cover_fills_like_a_canopy")
    assert np.all(held(law, 60.0, speed=20.0) < -0.6 * 700.0)
    assert np.all(held(law, 20.0, speed=20.0, acceleration=-0.6) > -10.0)


def test_a_gentle_release_keeps_more_air_than_a_quick_one(alone, held):
    kept = []
    for steps in (5, 300):
        law = alone("held_back_by_the_release_valve")
        for k in range(steps):
            held(law, 0.01, brake_force=20000.0 * (1.0 - k / steps))
        kept.append(held(law, 0.05)[0])
    assert kept[1] < 1.5 * kept[0] < 0.0


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


def test_oil_is_flung_up_and_teeth_rub_instead(alone, held):
    law = alone("oil_is_flung_up")
    first = held(law, 0.01, speed=20.0, traction_force=0.0)
    assert np.all(held(law, 120.0, speed=20.0, traction_force=0.0) > 0.6 * first)
    assert np.all(held(law, 0.01, speed=20.0, traction_force=20000.0) < 0.7 * first)


def test_a_load_over_the_rim_is_lost_for_good(alone, held):
    law = alone("over_the_rim")
    law.hose, law.s.water[:] = (np.full((2, 1), 1e9), np.full((2, 1), 2e9)), 1.0
    full = held(law, 0.1, grade=0.03)
    held(law, 5.0, acceleration=-2.0)
    assert np.all(held(law, 5.0, grade=0.03) > full) and np.all(law.s.water < 0.9)


def test_slopes_come_from_where_the_truck_was(alone, scene):
    law = alone("chainage_runs_away")
    law.late_m[:], law.p.runs = 100.0, 0.0
    for metres in range(400):
        out = law.newtons(scene(distance=metres, grade=0.05 * (metres >= 200)), 0.01)
        wanted = 0.05 * 2e4 * 9.81 * (202 <= metres < 297)
        if not (197 <= metres < 206 or 290 <= metres < 306):
            np.testing.assert_allclose(out, wanted, atol=1e-6)


def test_commands_come_frame_by_frame(planted):
    (one,) = planted(EFFECTS["slots_of_a_radio"])[0].filters
    one.reset(1)
    played = np.array([one.filter(np.full((1, 2), 1.0 * k), 0.01 * k, 0.01)[0, 0] for k in range(3000)])
    steps = np.diff(played)
    late = np.arange(3000)[500:] - played[500:]
    assert steps.min() >= 0.0 and np.count_nonzero(steps) < 3000 / one.steps_of + 1
    assert one.base + one.steps_of <= late.min() and late.max() <= one.base + 3 * one.steps_of


def test_a_robot_runs_no_faster_than_it_can_and_does_not_overshoot(planted):
    (one,) = planted(EFFECTS["robots_profile"])[0].filters
    one.reset(1)
    one.filter(np.zeros((1, 2)), 0.0, 0.01)
    u = np.array([[0.8 * one.full, 0.0]])
    given = np.array([one.filter(u, 0.01 * k, 0.01)[0, 0] for k in range(3000)]) / one.full
    assert given.max() <= 0.8 + 1e-9 and given[-1] == pytest.approx(0.8)
    assert np.diff(given).max() <= 0.01 * one.p.most_per_s + 3e-4
    assert given[20] < 0.3 * 0.2 * one.p.most_per_s


def test_faults_keep_their_word():
    rng = np.random.default_rng(1)
    p = SimpleNamespace(sign=1.0, late_s=0.6, slews=0.002, bias=0.01, port_m=5.0, lag_s=0.5)
    channels = {"acceleration": np.arange(2400) * 0.1, "speed": np.full(2400, 20.0), "grade": np.zeros(2400)}
    EFFECTS["slewed_clock"].build(SimpleNamespace(), p).faults[0](channels, 0.1, rng)
    off = np.arange(2400) * 0.1 - channels["acceleration"]
    assert 0.45 < off[100] < 0.75 and off[2300] < off[100] - 0.1
    EFFECTS["barometer_in_the_wind"].build(SimpleNamespace(), p).faults[0](channels, 0.1, rng)
    np.testing.assert_allclose(channels["grade"], 0.01)


def test_a_message_is_held_until_the_next():
    values = heard(np.arange(60.0), 5, 0.0, np.random.default_rng(2))
    assert len(np.unique(values)) <= 13 and np.all(values <= np.arange(60.0))


def test_laps_come_again_and_the_way_down_goes_down():
    rng = np.random.default_rng(5)
    grade = draw_profile(rng, 0.03)
    again = [np.max(np.abs(grade[lap:] - grade[:-lap])) for lap in range(320, 641)]
    assert min(again) < 1e-9 and 0.025 < grade.std() < 0.031
    down = draw_way_down(rng)
    assert down.max() < -0.01 and -0.06 < down.mean() < -0.035


def test_procedures_pull_coast_and_stop():
    rng = np.random.default_rng(7)
    speeds = {scenario: speed_profile(rng, scenario, 6000, 0.1) for scenario in ("suburban", "descent")}
    assert np.mean(speeds["suburban"] < 0.05) > 0.05 and speeds["descent"].min() > 5.0


def test_trucks_come_from_a_catalogue_and_machines_keep_their_speed():
    masses = [
        makers.of("seventh", "physics").draw_parameters("volvo", np.random.default_rng(k))["mass"]
        for k in range(9)
    ]
    near = [min(abs(m / 30000.0 - f) for f in BALLAST["volvo"]) for m in masses]
    assert max(near) < 0.04
    built = build(draw_plan("closed_loop", 4, "oil_is_flung_up", "physics", 2.0, forms="seventh"))
    assert set(built.plan.styles) <= {"cruise", "acc"}
    assert makers.of("seventh", "physics").driver.__name__ == "Tracking"
    assert np.abs(built.drives.channels["acceleration"]).max() < 4.0


def test_the_page_tells_the_sixth_but_not_the_seventh():
    keys = ("fluid_boils", "skin_of_the_drum")
    scored = [{"keys": [key], "right_first": 1.0, "in_group": 1.0} for key in keys]
    sixth, seventh = sorted(_by_effect(scored), key=lambda line: "not told" in line)
    assert "Limpert" in sixth and seventh.endswith("| seventh form, not told here |")
