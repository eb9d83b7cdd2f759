"""The second forms: they act in the right direction and size along real drives, and are drawn and sealed
like the first."""

import copy

import numpy as np
import pytest

from deeptruck_model.errors import InputError
from deeptruck_model.mismatch.proof.cases import make_case, measure, open_truth
from deeptruck_model.mismatch.proof.choice import suitable
from deeptruck_model.mismatch.proof.command import prove
from deeptruck_model.mismatch.proof.construction import build
from deeptruck_model.mismatch.proof.effects import EFFECTS, named, of_forms, of_kind, unknown
from deeptruck_model.mismatch.proof.jobs import Job
from deeptruck_model.mismatch.proof.plans import LEVELS, draw_plan

SECOND = [e for e in EFFECTS.values() if e.forms == "second"]
FORCES = [e for e in SECOND if e.gateable or e.key == "grade_from_a_coarse_map"]
HELPS = {"brake_fade", "drafting"}
BOTH_WAYS = {  # winds, slopes, masses and inertias push and hold; so does a brake that is late
    "headwind",
    "brake_lag",
    "road_grade",
    "payload_change",
    "rotating_inertia",
    "load_slosh",
    "driveline_backlash",
    "shift_interruption",
    "wheel_slip",
    "tunnels",
    "drums_out_of_round",
}
PUSHES = {"trolley_wire"}
SLOW = {"brake_fade", "torque_derate"}  # heat takes minutes


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


def driven(key, minutes=1.5):
    slow = EFFECTS[key].name in SLOW
    return build(draw_plan("noise", 3, key, "physics", 4.0 if slow else minutes, 2 * slow, forms="second"))


def along(built):
    """Acceleration (substeps, batch) of the hidden force along the drives, m/s2."""
    (force,) = built.oracle.forces
    log, drives = [], built.drives
    heard = built.oracle.with_forces([Listener(force, log)])
    heard.rollout(drives.u, drives.w, drives.y[:, 0], drives.y, inside=False)
    return np.array(log)


def test_second_forms_have_the_names_of_the_first_and_keys_of_their_own():
    first = {(e.kind, e.name) for e in EFFECTS.values() if e.forms == "first"}
    assert {(e.kind, e.name) for e in SECOND} <= first
    assert {e.name for e in named("second")} == {e.name for e in named("first")}
    assert all(e.forms == "second" for e in [*named("second"), *of_kind("measurement_fault", "second")])
    assert len({e.name for e in named("second")}) >= 16 and len(unknown("second")) >= 4
    assert {e.kind for e in of_forms("second") if e.forms == "first"} == {"parameter_error"}
    third = sum(e.forms == "third" for e in EFFECTS.values())
    assert len(of_forms("first")) + len(SECOND) + third == len(EFFECTS)


@pytest.mark.parametrize("key", [e.key for e in FORCES])
def test_a_force_has_a_plausible_size_and_the_right_sign(key):
    effect, built = EFFECTS[key], driven(key)
    force = along(built)
    assert np.isfinite(force).all()
    assert 0.02 < np.abs(force).max() < 6.0
    assert 0.002 < np.sqrt(np.mean(force**2)) < 0.6
    assert np.sqrt(np.mean(built.extra**2)) > 0.002
    names = {effect.name, key}
    if names & (HELPS | PUSHES):
        assert force.min() > -1e-9
    elif not names & BOTH_WAYS:
        assert force.max() < 1e-9
    else:
        assert force.min() < 0.0


def test_an_inertia_resists_change_and_a_late_brake_lets_run_on():
    built = driven("damped_flywheel")
    force, acceleration = along(built)[9::10], built.drives.y[:, 1:, 0].T
    assert np.corrcoef(force.ravel(), acceleration.ravel())[0, 1] < -0.4
    built = driven("relay_valve_sticks")
    force = along(built)[9::10]
    pressed = np.diff(built.drives.u[:, :, 1], axis=1).T
    assert force[pressed > 0.0].mean() > 0.0 > force[pressed < 0.0].mean()


@pytest.mark.parametrize("key", ["slow_bus", "progressive_release", "stator_freewheels"])
def test_what_is_no_force_acts_too(key):
    built = driven(key)
    assert 0.003 < np.sqrt(np.mean(built.extra**2)) < 0.8
    assert not built.oracle.forces


@pytest.mark.parametrize("key", ["slow_bus", "progressive_release"])
def test_a_filter_is_late_and_arrives(key):
    (one,) = driven(key, minutes=0.5).oracle.command_filters
    one.reset(2)
    before, after = np.tile([0.0, 0.0], (2, 1)), np.tile([20.0, 5.0], (2, 1))
    for k in range(300):
        np.testing.assert_array_equal(one.filter(before, 0.01 * k, 0.01), before)
    twin = copy.deepcopy(one)
    early = one.filter(after, 3.0, 0.01)[:, 0].copy()
    for k in range(2000):
        late = one.filter(after, 3.0 + 0.01 * k, 0.01)
    np.testing.assert_allclose(late, after)
    assert np.all(early < 5.0)
    np.testing.assert_array_equal(twin.filter(after, 3.0, 0.01)[:, 0], early)


@pytest.mark.parametrize("key", [e.key for e in SECOND if e.kind == "measurement_fault"])
def test_a_fault_spoils_one_channel(key):
    built = driven(key, minutes=0.7)
    channel = {"speed_scale": "speed", "grade_bias": "grade"}.get(EFFECTS[key].name, "acceleration")
    clean = build(draw_plan("nothing_missing", 3, None, "physics", 0.7)).drives.channels
    assert channel in clean and not np.any(built.extra)
    off = measure(built)[0][channel] - built.drives.channels[channel][0]
    assert np.sqrt(np.mean(off**2)) > (0.006 if channel == "grade" else 0.05)


def test_fade_needs_heat_and_pressure_together():
    (one,) = driven("stroke_runs_out", minutes=0.5).oracle.forces
    one.reset(1)
    full = one.truck.brake_capacity

    class View:
        speed, brake_force = np.array([15.0]), np.array([0.3 * full])

    cold = one.newtons(View, 0.01)[0]
    one.s.drum[:] = 320.0
    hot = one.newtons(View, 0.01)[0]
    View.brake_force = np.array([0.02 * full])
    gentle = one.newtons(View, 0.01)[0] / 0.02
    assert cold < 0.02 * full and 0.1 < hot / (0.3 * full) < 0.9 and gentle < hot / 0.3


@pytest.mark.parametrize("key", ["standing_water", "grade_from_a_coarse_map"])
def test_what_lies_on_the_road_lies_there_for_both_directions(key):
    built = driven(key, minutes=0.5)
    (one,) = built.oracle.forces
    road = one.road[one.setting.route[0]]
    assert (road != 0.0).mean() > 0.1 and np.abs(road).max() < 1.01
    if key == "grade_from_a_coarse_map":
        assert abs(road.sum() * 5.0) < 1.0 and built.faults.conceal == ("elevation",)


@pytest.mark.parametrize("level", LEVELS)
def test_every_level_goes_through_all_effects_in_its_own_order(level):
    count = len(suitable(level, "second")) or 1
    plans = [draw_plan(level, 1000 + k, None, "physics", 4.0, forms="second") for k in range(count)]
    if level == "nothing_missing":
        assert all(not p.effects for p in plans)
        return
    if level == "not_in_library":
        assert all(not p.excluded or p.effects[0].name in p.excluded for p in plans)
        assert all(p.excluded or p.effects[0].name == "unknown" for p in plans)
    else:
        assert {p.effects[0].key for p in plans} == {e.key for e in suitable(level, "second")}
    assert all(p.truck in e.trucks for p in plans for e in p.effects)
    assert all(e.forms == "second" or e.kind == "parameter_error" for p in plans for e in p.effects)


def test_one_seed_hides_other_effects_at_other_levels():
    levels = [level for level in LEVELS if level != "nothing_missing"]
    for seed in (0, 7, 100_003):
        plans = [draw_plan(level, seed, None, "physics", 4.0, forms="second") for level in levels]
        assert len({p.effects[0].key for p in plans}) >= len(levels) - 4
        assert len({p.effect_seed for p in plans}) == len(levels)
    first = [draw_plan(level, 7, None, "physics", 4.0).effects[0].key for level in ("plain", "noise")]
    assert first[0] == first[1], "old seeds must still mean what they meant"


def test_a_name_finds_the_form_asked_for():
    assert draw_plan("noise", 0, "brake_fade", "physics", 1.0).effects[0].forms == "first"
    assert draw_plan("noise", 0, "brake_fade", "physics", 1.0, forms="second").effects[0].forms == "second"
    with pytest.raises(InputError, match="forms"):
        draw_plan("noise", 0, None, "physics", 1.0, forms="fourth")


def test_the_sealed_truth_says_which_forms(tmp_path):
    case = make_case(tmp_path / "a", "noise", 12, "dragging_brake", minutes=0.5, forms="second")
    truth = open_truth(case)
    assert truth["forms"] == "second" and truth["effects"][0]["forms"] == "second"
    again = make_case(tmp_path / "b", "noise", 12, "dragging_brake", minutes=0.5, forms="second")
    assert again.sha256 == case.sha256
    assert "second" not in (tmp_path / "a" / "case.json").read_text()
    assert Job("noise", 1, forms="second").folder != Job("noise", 1).folder
    with pytest.raises(InputError, match="fourth"):
        prove(tmp_path / "p", forms="fourth")
