"""The third forms and their world: each law acts in its direction and size along real drives, is nothing
where it should be nothing, and comes again with its seed."""

import copy
from types import SimpleNamespace

import numpy as np
import pytest

from deeptruck_model.mismatch.proof import trucks
from deeptruck_model.mismatch.proof.cases import make_case, measure, open_truth
from deeptruck_model.mismatch.proof.choice import mark, suitable
from deeptruck_model.mismatch.proof.construction import build
from deeptruck_model.mismatch.proof.effects import EFFECTS, named, of_forms, of_kind, unknown
from deeptruck_model.mismatch.proof.hidden import Setting
from deeptruck_model.mismatch.proof.other_makers import world
from deeptruck_model.mismatch.proof.plans import LEVELS, draw_plan

THIRD = [e for e in EFFECTS.values() if e.forms == "third"]
FORCES = [e for e in THIRD if e.gateable or e.key in ("tangents_not_in_the_map", "lockup_hunts")]
FILTERS = ["good_and_bad_hours", "limited_jerk"]
HELPS = {"brake_fade", "drafting", "steam_from_exhaust", "overboost"}
BOTH_WAYS = {  # winds, bodies, slopes, masses and late brakes push and hold; so does a governor
    "headwind",
    "drag_area",
    "brake_lag",
    "road_grade",
    "payload_change",
    "load_slosh",
    "driveline_backlash",
    "wheel_slip",
    "torque_converter_slip",
    "all_speed_governor",
}
SLOW = {"brake_fade"}  # heat takes minutes


class Listener:
    """A force that tells what it does; copies share the log."""

    def __init__(self, inner, log):
        self.inner, self.log = inner, log

    def reset(self, batch):
        self.inner.reset(batch)

    def force(self, view, dt):
        value = self.inner.force(view, dt)
        self.log.append(value / view.mass)
        return value

    def __deepcopy__(self, memo):
        return Listener(copy.deepcopy(self.inner, memo), self.log)


def driven(key, minutes=1.5, seed=3):
    slow = EFFECTS[key].name in SLOW
    plan = draw_plan("noise", seed, key, "physics", 3.0 if slow else minutes, 2 * slow, forms="third")
    return build(plan)


def along(built):
    """Acceleration (substeps, batch) of the hidden force along the drives, m/s2."""
    (force,) = built.oracle.forces
    log, drives = [], built.drives
    heard = built.oracle.with_forces([Listener(force, log)])
    heard.rollout(drives.u, drives.w, drives.y[:, 0], drives.y, inside=False)
    return np.array(log)


def alone(key, name="trucksim", batch=2):
    """The law with sizes in the middle of their ranges, started."""
    effect = EFFECTS[key]
    setting = Setting(
        trucks.namespace(trucks.make(name, {})),
        batch,
        60.0,
        0.1,
        5,
        np.full(batch, 9000.0),
        np.array([1.0, -1.0][:batch]),
        np.zeros(batch, int),
        np.full((batch, 600), np.nan),
    )
    sizes = {n: 0.5 * (low + high) for n, (low, high) in effect.ranges.items()}
    (law,) = effect.build(setting, SimpleNamespace(**sizes)).forces
    law.reset(batch)
    return law


def scene(**given):
    """A view of two trucks that roll at 15 m/s, half loaded, in a middle gear."""
    base = dict.fromkeys(("acceleration", "shifting", "brake_force", "grade", "distance"), 0.0)
    base |= {"speed": 15.0, "mass": 2e4, "gear": 8.0, "ratio": 6.0, "engine_speed": 140.0}
    base |= {"engine_torque": 700.0, "traction_force": 8000.0, "drag_force": 700.0, "u0": 600.0, "u1": 0.0}
    values = {n: np.full(2, float(v)) for n, v in {**base, **given}.items() if n != "time"}
    u = np.stack([values.pop("u0"), values.pop("u1")], axis=1)
    return SimpleNamespace(**values, u=u, time=given.get("time", 1.0))


def held(law, seconds, **given):
    for k in range(round(seconds * 100)):
        out = law.newtons(scene(**given, time=0.01 * k), 0.01)
    return out


def test_third_forms_have_every_name_and_keys_of_their_own():
    assert {e.name for e in named("third")} == {e.name for e in named("first")}
    faults = of_kind("measurement_fault", "third")
    assert {e.name for e in faults} == {e.name for e in of_kind("measurement_fault", "first")}
    assert all(e.forms == "third" for e in [*named("third"), *faults, *unknown("third")])
    assert len(unknown("third")) >= 8 and not any(e.accepts for e in unknown("third"))
    assert {e.kind for e in of_forms("third") if e.forms == "first"} == {"parameter_error"}


@pytest.mark.parametrize("key", [e.key for e in FORCES])
def test_a_force_has_a_plausible_size_and_the_right_sign_and_comes_again(key):
    effect, built = EFFECTS[key], driven(key)
    force = along(built)
    assert np.isfinite(force).all()
    assert 0.02 < np.abs(force).max() < 6.0
    assert 0.002 < np.sqrt(np.mean(force**2)) < 0.6
    assert np.sqrt(np.mean(built.extra**2)) > 0.002
    names = {effect.name, key}
    if names & HELPS:
        assert force.min() > -1e-9
    elif not names & BOTH_WAYS:
        assert force.max() < 1e-9
    else:
        assert force.min() < 0.0
    again = draw_plan("noise", 3, key, "physics", 0.2, forms="third")
    np.testing.assert_array_equal(build(again).drives.y, build(again).drives.y)


@pytest.mark.parametrize("key", [e.key for e in FORCES if e.leader is False])
def test_a_standing_truck_without_commands_is_left_alone(key):
    law = alone(key)
    still = {"speed": 0.0, "u0": 0.0, "u1": 30.0, "engine_torque": 0.0, "traction_force": 0.0, "ratio": 0.0}
    force = held(law, 3.0, **still, drag_force=0.0, engine_speed=62.8)
    np.testing.assert_allclose(force, 0.0, atol=1e-6)


def test_what_needs_a_cause_is_nothing_without_it():
    assert np.all(held(alone("pads_stay_on"), 2.0) == 0.0)
    assert np.all(held(alone("long_pipes"), 2.0) == 0.0)
    assert np.all(held(alone("soaking_heat"), 2.0) == 0.0)
    assert np.all(held(alone("speed_held_downhill"), 2.0) == 0.0)
    assert np.all(held(alone("axle_torque_limit"), 2.0, traction_force=500.0) == 0.0)
    np.testing.assert_allclose(held(alone("pocket_behind_leader"), 2.0), 0.0, atol=1e-9)
    assert np.all(held(alone("dogs_miss"), 2.0) == 0.0)
    assert np.all(held(alone("stuck_after_standing"), 2.0) == 0.0)
    assert np.all(held(alone("overboost"), 2.0, engine_torque=200.0) == 0.0)
    np.testing.assert_allclose(held(alone("freewheeling_rotor"), 2.0), 0.0, atol=5.0)
    np.testing.assert_allclose(held(alone("bore_in_the_tank"), 2.0), 0.0, atol=1e-6)
    np.testing.assert_allclose(held(alone("two_masses_and_play"), 9.0), 0.0, atol=80.0)


def test_what_has_a_cause_acts():
    law = alone("pads_stay_on")
    held(law, 1.0, brake_force=2e4)
    dragging = held(law, 0.01)
    assert np.all(dragging < -500.0) and np.all(held(law, 120.0) > 0.5 * dragging)
    law = alone("soaking_heat")
    early, late = held(law, 1.0, brake_force=1e4), held(law, 100.0, brake_force=3e4)
    assert np.all(early < 1.0) and np.all(late > 0.08 * 3e4)
    law = alone("speed_held_downhill")
    shut = {"u0": 0.0, "engine_torque": -100.0}
    first = held(law, 3.0, **shut)
    assert np.all(held(law, 3.0, **shut, speed=17.0) < first) and np.all(first < 0.0)
    law = alone("stuck_after_standing")
    held(law, 6.0, speed=0.0)
    assert np.all(held(law, 0.1, speed=1.0) < -0.02 * 2e4 * 9.81)
    assert np.all(held(law, 60.0, speed=10.0) > -50.0)
    law = alone("floating_ice")
    slow, resonant, fast = (held(law, 60.0, speed=v) for v in (2.0, 9.5, 22.0))
    assert np.all(resonant < 5.0 * slow) and np.all(resonant < 5.0 * fast)
    law = alone("bearing_runs_hot")
    assert np.all(held(law, 90.0, speed=22.0) < 3.0 * held(law, 300.0, speed=8.0))


def test_a_rotor_takes_and_does_not_give_back():
    law = alone("freewheeling_rotor")
    held(law, 0.1, speed=10.0)
    assert np.all(held(law, 0.2, speed=12.0) < -500.0)
    assert np.all(held(law, 0.2, speed=8.0) == 0.0)


def test_stretches_lie_on_the_road_and_slopes_keep_their_height():
    for key in ("soft_ground", "tangents_not_in_the_map"):
        law = alone(key)
        assert (law.road != 0.0).mean() > 0.2
        law.setting.start_m[:] = [9000.0, 9400.0]
        there = law.newtons(scene(distance=200.0), 0.01)
        np.testing.assert_allclose(there[0], there[1] * (1.0 if key == "soft_ground" else -1.0))


@pytest.mark.parametrize("key", FILTERS)
def test_a_filter_is_late_and_arrives(key):
    built = driven(key)
    assert 0.003 < np.sqrt(np.mean(built.extra**2)) < 0.8 and not built.oracle.forces
    (one,) = built.oracle.command_filters
    one.reset(2)
    before, after = np.tile([0.0, 0.0], (2, 1)), np.tile([20.0, 5.0], (2, 1))
    for k in range(300):
        np.testing.assert_array_equal(one.filter(before, 0.01 * k, 0.01), before)
    twin = copy.deepcopy(one)
    early = one.filter(after, 3.0, 0.01)[:, 0].copy()
    for k in range(4000):
        late = one.filter(after, 3.0 + 0.01 * k, 0.01)
    np.testing.assert_allclose(late, after)
    assert np.all(early < 5.0)
    np.testing.assert_array_equal(twin.filter(after, 3.0, 0.01)[:, 0], early)


@pytest.mark.parametrize("key", [e.key for e in THIRD if e.kind == "measurement_fault"])
def test_a_fault_spoils_its_channel_and_no_other(key):
    built = driven(key, minutes=0.7)
    channel = {"speed_scale": "speed", "grade_bias": "grade"}.get(EFFECTS[key].name, "acceleration")
    channel = "brake_command" if key.startswith("commands") else channel
    assert not built.oracle.forces and not built.oracle.command_filters
    rows = [
        (name, values[0])
        for name, values in built.drives.channels.items()
        if name not in ("gear", "distance")
    ]
    clean = {name: values.copy() for name, values in rows}
    (fault,) = built.faults.faults
    spoilt = {name: values.copy() for name, values in clean.items()}
    fault(spoilt, 0.1, np.random.default_rng(1))
    changed = {name for name in clean if np.any(spoilt[name] != clean[name])}
    assert changed - {"engine_command"} <= {channel} and len(changed) > 0
    if channel != "brake_command":
        off = spoilt[channel] - clean[channel]
        assert np.sqrt(np.mean(off**2)) > (0.006 if channel == "grade" else 0.02)
    assert np.isfinite(measure(built)[0][channel]).all()


@pytest.mark.parametrize("level", LEVELS)
def test_every_level_goes_through_all_third_effects(level):
    count = len(suitable(level, "third")) or 1
    plans = [draw_plan(level, 1000 + k, None, "physics", 4.0, forms="third") for k in range(count)]
    if level == "nothing_missing":
        assert all(not p.effects for p in plans)
        return
    if level == "not_in_library":
        assert all(p.excluded or p.effects[0].name == "unknown" for p in plans)
    else:
        assert {p.effects[0].key for p in plans} == {e.key for e in suitable(level, "third")}
    assert all(p.truck in e.trucks for p in plans for e in p.effects)
    assert all(e.forms == "third" or e.kind == "parameter_error" for p in plans for e in p.effects)
    assert mark(level, "third") not in {mark(level, "first"), mark(level, "second")}


def test_the_sealed_truth_says_third_and_the_case_does_not(tmp_path):
    case = make_case(tmp_path / "a", "noise", 12, "dragging_brake", minutes=0.5, forms="third")
    truth = open_truth(case)
    assert truth["forms"] == "third" and truth["effects"][0]["forms"] == "third"
    again = make_case(tmp_path / "b", "noise", 12, "dragging_brake", minutes=0.5, forms="third")
    assert again.sha256 == case.sha256
    assert "third" not in (tmp_path / "a" / "case.json").read_text()


def test_the_world_is_another_for_physics_and_the_old_one_for_deep():
    assert world.of("third", "physics") is world.NEW
    assert (
        world.of("third", "deep") is world.of("second", "physics") is world.of("first", "deep") is world.OLD
    )
    rng = np.random.default_rng(4)
    for scenario, (low, high) in (("highway", (15.0, 28.0)), ("suburban", (0.0, 18.0))):
        speed = world.speed_profile(rng, scenario, 3000, 0.1)
        assert speed.shape == (3000,) and low <= speed.min() and speed.max() <= high
        assert np.abs(np.diff(speed)).max() < 0.3
    grade = world.draw_profile(rng, 0.03)
    assert 0.02 < grade.std() < 0.035 and np.abs(grade).max() <= 0.075
    masses = [world.draw_parameters("volvo", np.random.default_rng(k))["mass"] for k in range(30)]
    assert 16000.0 < min(masses) < 20000.0 and 37000.0 < max(masses) < 41000.0


def test_sensors_of_the_new_world_are_near_the_truth():
    built = build(draw_plan("nothing_missing", 8, None, "physics", 0.7, forms="third"))
    measured, true = measure(built), built.drives.channels
    for row, channels in enumerate(measured):
        counts = channels["speed"] * 3.6 * 256.0
        np.testing.assert_allclose(counts, np.rint(counts), atol=1e-6)
        assert np.std(channels["speed"] - true["speed"][row]) < 0.15
        assert abs(np.mean(channels["acceleration"] - true["acceleration"][row])) < 0.04
        assert "grade" not in channels or np.std(channels["grade"] - true["grade"][row]) < 0.006
