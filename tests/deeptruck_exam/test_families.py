"""What holds for every family of hidden laws: all names are there with sources, each law acts in its
direction and size along real drives, leaves a standing truck alone, comes again, and is sealed."""

import copy

import numpy as np
import pytest

from deeptruck_exam import makers, trucks
from deeptruck_exam.cases import make_case, measure, open_truth
from deeptruck_exam.choice import mark, suitable
from deeptruck_exam.command import prove
from deeptruck_exam.construction import build
from deeptruck_exam.effects import EFFECTS, named, of_forms, of_kind, unknown
from deeptruck_exam.hidden import FORMS
from deeptruck_exam.jobs import Job
from deeptruck_exam.plans import LEVELS, draw_plan
from deeptruck_model.errors import InputError

NAMES = {
    "brake_fade",
    "brake_lag",
    "dragging_brake",
    "headwind",
    "drafting",
    "drag_area",
    "road_grade",
    "rolling_resistance_speed",
    "rolling_resistance_warmup",
    "road_surface",
    "payload_change",
    "turbo_lag",
    "torque_derate",
    "torque_limit",
    "engine_brake",
    "engine_friction",
    "accessory_load",
    "driveline_loss",
    "shift_interruption",
    "torque_converter_slip",
    "wheel_slip",
    "rotating_inertia",
    "load_slosh",
    "command_delay",
    "command_rate_limit",
    "driveline_backlash",
}
FAULTS = {"clock_offset", "speed_scale", "acceleration_bias", "grade_bias"}
LATER = FORMS[1:]
OWN_WORLD = ("third", "fourth", "fifth", "sixth", "seventh")
MADE = [e for e in EFFECTS.values() if e.forms in LATER and e.kind == "missing_physics"]
NO_FORCE = {"stator_freewheels"}  # a truck with other parameters
FILTERS = [e.key for e in MADE if e.name.startswith("command") or e.key == "worn_linkage"]
FORCES = [e.key for e in MADE if e.key not in NO_FORCE and e.key not in FILTERS]
HELPS = {
    "brake_fade",
    "drafting",
    "trolley_wire",
    "steam_from_exhaust",
    "overboost",
    "pushed_by_a_second_tractor",
    "hydrostatic_front_axle",
    "antilock_is_fooled",
    "hole_in_the_blending",
    "fast_idle_pushes",
    "pedal_sticks_where_it_rests",
    "burns_its_own_oil",
    "remembers_a_speed",
    "dolly_pushes_uphill",
    "expander_pushes_late",
}
BOTH_WAYS = {  # winds, bodies, slopes, masses and late brakes push and hold; so do governors and mode changes
    "headwind",
    "exchanged_bodies",
    "lining_on_the_dynamometer",
    "brake_lag",
    "road_grade",
    "payload_change",
    "damped_flywheel",
    "blower_on_a_centrifugal_clutch",
    "load_slosh",
    "driveline_backlash",
    "clutch_meters_in",
    "wheel_slip",
    "torque_converter_slip",
    "tunnels",
    "drums_out_of_round",
    "all_speed_governor",
    "hydraulic_launch_assist",
    "cylinders_rest",
    "trucks_that_pass",
    "drum_on_a_belt",
    "rotor_behind_a_coupling",
    "worn_clutch_damper",
    "flywheel_behind_an_induction_coupling",
    "clunk_and_shuffle",
    "filled_gaps_are_paid_back",
}
CHANNEL = {"speed_scale": "speed", "grade_bias": "grade", "commands_from_another_clock": "brake_command"}


@pytest.mark.parametrize("forms", FORMS)
def test_every_name_has_an_effect_of_the_family(forms):
    assert {e.name for e in named(forms)} == NAMES
    assert {e.name for e in of_kind("measurement_fault", forms)} == FAULTS
    assert {e.name for e in of_kind("parameter_error", forms)} == set(trucks.TUNABLE)
    assert len(unknown(forms)) >= {"second": 4, "third": 8, "seventh": 7}.get(forms, 10)
    assert not any(e.accepts for e in unknown(forms))
    assert {e.kind for e in of_forms(forms) if e.forms != forms} <= {"parameter_error"}


def test_every_effect_belongs_to_one_family():
    assert {e.forms for e in EFFECTS.values()} == set(FORMS)
    marks = {mark(level, forms) for level in LEVELS for forms in FORMS}
    assert len(marks) == len(LEVELS) * len(FORMS)


@pytest.mark.parametrize("key", EFFECTS)
def test_source_and_ranges_are_stated(key):
    effect = EFFECTS[key]
    assert len(effect.source) > 40
    assert all(low < high for low, high in effect.ranges.values())
    drawn = [effect.draw(np.random.default_rng(k)) for k in range(20)]
    for name, (low, high) in effect.ranges.items():
        values = [d[name] for d in drawn]
        assert low <= min(values) < max(values) <= high


@pytest.mark.parametrize("key", [e.key for e in EFFECTS.values() if e.gateable])
def test_a_force_is_finite_leaves_a_standing_truck_alone_and_copies_apart(key, planted):
    parts, truck = planted(EFFECTS[key])
    truck = truck.with_forces(parts.forces)
    state = truck.reset(np.zeros((3, 3)))
    brake = 1.0 if truck.interface.brake_unit == "m/s^2" else 30.0
    u, w = np.tile([0.0, brake], (3, 1)), np.zeros((3, 1))
    for _ in range(10):
        state, y = truck.step(state, u, w)
        assert np.all(y[:, 1] == 0.0)
    state = truck.force(state, np.tile([0.0, 14.0, 1.0], (3, 1)))
    twin = copy.deepcopy(state)
    first, y = truck.step(state, u * [[1.0, 0.0]], w)
    assert np.isfinite(y).all()
    for _ in range(5):
        first, _ = truck.step(first, u * 0.5, w)
    _, z = truck.step(twin, u * [[1.0, 0.0]], w)
    np.testing.assert_array_equal(y, z)


@pytest.mark.parametrize("key", FORCES)
def test_a_force_has_a_plausible_size_and_the_right_sign_and_comes_again(key, driven, along):
    effect, built = EFFECTS[key], driven(key)
    force = along(built)
    assert np.isfinite(force).all()
    assert 0.02 < np.abs(force).max() < 6.0
    assert 0.002 < np.sqrt(np.mean(force**2)) < 0.6
    assert np.sqrt(np.mean(built.extra**2)) > 0.002
    names = {effect.name, key}
    if names & BOTH_WAYS:
        assert force.min() < 0.0
    elif names & HELPS:
        assert force.min() > -1e-9
    else:
        assert force.max() < 1e-9
    again = draw_plan("noise", 3, key, "physics", 0.2, forms=effect.forms)
    np.testing.assert_array_equal(build(again).drives.y, build(again).drives.y)


@pytest.mark.parametrize("key", NO_FORCE)
def test_other_parameters_act_too(key, driven):
    built = driven(key)
    assert 0.003 < np.sqrt(np.mean(built.extra**2)) < 0.8
    assert not built.oracle.forces


@pytest.mark.parametrize("key", FILTERS)
def test_a_filter_is_late_and_arrives(key, driven):
    built = driven(key)
    assert 0.003 < np.sqrt(np.mean(built.extra**2)) < 0.8 and not built.oracle.forces
    (one,) = built.oracle.command_filters
    one.reset(2)
    full = 0.5 * built.truck.full_command
    before, after = np.tile([0.0, 0.0], (2, 1)), np.tile([full, 5.0], (2, 1))
    for k in range(300):
        np.testing.assert_array_equal(one.filter(before, 0.01 * k, 0.01), before)
    twin = copy.deepcopy(one)
    early = one.filter(after, 3.0, 0.01)[:, 0].copy()
    for k in range(4000):
        late = one.filter(after, 3.0 + 0.01 * k, 0.01)
    lost = 0.4 if key == "worn_linkage" else 1e-6  # what play keeps back
    np.testing.assert_allclose(late, after, rtol=lost)
    assert np.all(early < (1.0 if key == "worn_linkage" else 0.25) * full)
    np.testing.assert_array_equal(twin.filter(after, 3.0, 0.01)[:, 0], early)


@pytest.mark.parametrize("key", [e.key for e in EFFECTS.values() if e.kind == "measurement_fault"])
def test_a_fault_spoils_its_channel_and_no_other(key, driven):
    effect, built = EFFECTS[key], driven(key, minutes=0.7)
    channel = CHANNEL.get(key, CHANNEL.get(effect.name, "acceleration"))
    assert not built.oracle.forces and not built.oracle.command_filters
    rows = {name: v[0] for name, v in built.drives.channels.items() if name != "distance"}
    (fault,) = built.faults.faults
    spoilt = {name: values.copy() for name, values in rows.items()}
    fault(spoilt, 0.1, np.random.default_rng(1))
    changed = {name for name in rows if np.any(spoilt[name] != rows[name])}
    late = key in ("commands_from_another_clock", "clock_offset_responses")  # more than one
    assert channel in changed and (late or changed == {channel})
    if channel != "brake_command":
        off = spoilt[channel] - rows[channel]
        assert np.sqrt(np.mean(off**2)) > (0.006 if channel == "grade" else 0.02)
    assert np.isfinite(measure(built)[0][channel]).all()


@pytest.mark.parametrize("forms", LATER)
@pytest.mark.parametrize("level", LEVELS)
def test_every_level_goes_through_all_effects_in_its_own_order(level, forms):
    count = len(suitable(level, forms)) or 1
    plans = [draw_plan(level, 1000 + k, None, "physics", 4.0, forms=forms) for k in range(count)]
    if level == "nothing_missing":
        assert all(not p.effects for p in plans)
        return
    if level == "not_in_library":
        assert all(not p.excluded or p.effects[0].name in p.excluded for p in plans)
        assert all(p.excluded or p.effects[0].name == "unknown" for p in plans)
    else:
        assert {p.effects[0].key for p in plans} == {e.key for e in suitable(level, forms)}
    assert all(p.truck in e.trucks for p in plans for e in p.effects)
    assert all(e.forms == forms or e.kind == "parameter_error" for p in plans for e in p.effects)


@pytest.mark.parametrize("forms", LATER)
def test_one_seed_hides_other_effects_at_other_levels(forms):
    levels = [level for level in LEVELS if level != "nothing_missing"]
    for seed in (0, 7, 100_003):
        plans = [draw_plan(level, seed, None, "physics", 4.0, forms=forms) for level in levels]
        assert len({p.effects[0].key for p in plans}) >= len(levels) - 4
        assert len({p.effect_seed for p in plans}) == len(levels)


@pytest.mark.parametrize("forms", FORMS)
def test_a_name_finds_the_form_asked_for_and_the_sealed_truth_alone_says_it(forms, tmp_path):
    assert draw_plan("noise", 0, "brake_fade", "physics", 1.0, forms=forms).effects[0].forms == forms
    case = make_case(tmp_path / "a", "noise", 12, "dragging_brake", minutes=0.5, forms=forms)
    truth = open_truth(case)
    assert truth["forms"] == forms and truth["effects"][0]["forms"] == forms
    again = make_case(tmp_path / "b", "noise", 12, "dragging_brake", minutes=0.5, forms=forms)
    assert again.sha256 == case.sha256
    assert forms not in (tmp_path / "a" / "case.json").read_text()
    assert len({Job("noise", 1, forms=f).folder for f in FORMS}) == len(FORMS)


def test_unknown_forms_are_refused_in_one_line(tmp_path):
    with pytest.raises(InputError, match="forms"):
        draw_plan("noise", 0, None, "physics", 1.0, forms="eighth")
    with pytest.raises(InputError, match="eighth"):
        prove(tmp_path / "p", forms="eighth")


def test_old_seeds_still_mean_what_they_meant():
    first = [draw_plan(level, 7, None, "physics", 4.0).effects[0].key for level in ("plain", "noise")]
    assert first[0] == first[1]


def test_worlds_are_others_for_physics_and_the_old_one_for_deep():
    worlds = {forms: makers.of(forms, "physics") for forms in FORMS}
    assert worlds["first"] is worlds["second"] is makers.OLD
    assert len({id(world) for world in worlds.values()}) == 1 + len(OWN_WORLD)
    assert all(makers.of(forms, "deep") is makers.OLD for forms in FORMS)


@pytest.mark.parametrize("forms", OWN_WORLD)
def test_a_world_has_speeds_roads_and_trucks_within_reason(forms):
    world, rng = makers.of(forms, "physics"), np.random.default_rng(4)
    for scenario, (low, high) in (
        ("highway", (14.0, 28.0)),
        ("suburban", (0.0, 18.0)),
        ("descent", (0.0, 20.0)),
    ):
        speed = world.speed_profile(rng, scenario, 3000, 0.1)
        assert speed.shape == (3000,) and low <= speed.min() and speed.max() <= high
        assert np.abs(np.diff(speed)).max() < 0.3
    roads = world.draw_roads(rng, ["hills"] * 4 + ["descent"] * 4, False)
    metres = np.arange(0.0, 5000.0, 10.0)
    grade = np.array([roads.grade_at(np.full(8, m)) for m in metres])
    assert np.abs(grade).max() < 0.09
    assert 0.015 < grade[:, :4].std() < 0.045 and np.all(grade[:, 4:].mean(axis=0) < -0.03)
    assert not world.draw_roads(rng, ["hills", "descent"], True).grade.any()
    masses = [world.draw_parameters("volvo", np.random.default_rng(k))["mass"] for k in range(30)]
    assert 13000.0 < min(masses) < 20000.0 and 36000.0 < max(masses) < 47000.0


@pytest.mark.parametrize("forms", OWN_WORLD)
def test_sensors_of_a_world_are_near_the_truth(forms):
    built = build(draw_plan("nothing_missing", 8, None, "physics", 0.7, forms=forms))
    measured, true = measure(built), built.drives.channels
    for row, channels in enumerate(measured):
        counts = channels["speed"] * 3.6 * 256.0
        np.testing.assert_allclose(counts, np.rint(counts), atol=1e-6)
        assert np.std(channels["speed"] - true["speed"][row]) < 0.15
        assert abs(np.mean(channels["acceleration"] - true["acceleration"][row])) < 0.04
        assert "grade" not in channels or np.std(channels["grade"] - true["grade"][row]) < 0.006
