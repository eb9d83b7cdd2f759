"""Sealed cases: repeatable, closed, and true to their level."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_exam import tool
from deeptruck_exam.cases.absorption import retune
from deeptruck_exam.cases.build import build
from deeptruck_exam.cases.case import Case, further_drives, make_case, measure, open_truth
from deeptruck_exam.cases.levels import (
    LEVELS,
    NO_EFFECT,
    NOT_RECORDED,
    choose,
    suitable,
)
from deeptruck_exam.cases.plan import draw_plan
from deeptruck_exam.scoring.evaluation import arrays, open_loop
from deeptruck_exam.worlds import trucks
from deeptruck_model import simulators
from deeptruck_model.recordings import read


def quick(level, seed=3, effect=None, minutes=0.7):
    return build(draw_plan(level, seed, effect, "physics", minutes))


@pytest.fixture(scope="module")
def sticking(tmp_path_factory):
    return make_case(tmp_path_factory.mktemp("case") / "a", "noise", 12, "sticking_cam", minutes=0.5)


def test_the_same_arguments_give_the_same_case(sticking, tmp_path):
    one, two = sticking, make_case(tmp_path / "a", "noise", 12, "sticking_cam", minutes=0.5)
    assert one.sha256 == two.sha256
    assert two == Case.read(tmp_path / "a")
    left, right = (read(c.paths(c.fit)[0])[0] for c in (one, two))
    np.testing.assert_array_equal(left.y, right.y)
    assert left.interface == simulators.load(one.simulator).interface
    open_to_the_tool = "".join(
        p.read_text() for p in (tmp_path / "a" / "case.json", tmp_path / "a" / "simulator.yaml")
    )
    assert "sticking" not in open_to_the_tool
    truth = json.loads((tmp_path / "a" / "truth" / "truth.json").read_text())
    truth["effects"][0]["name"] = "headwind"
    (tmp_path / "a" / "truth" / "truth.json").write_text(json.dumps(truth))
    with pytest.raises(InputError, match="the one that was written"):
        open_truth(two)
    with pytest.raises(InputError, match="exists"):
        make_case(tmp_path / "a", "noise", 12)


def test_further_drives_are_other_drives_of_the_same_truck(sticking):
    case, truth = sticking, open_truth(sticking)
    further = further_drives(truth)
    own = [read(path)[0] for path in case.paths(case.fit + case.held_out)]
    assert len(further) == len(own)
    for one, other in zip(own, further, strict=True):
        assert set(one.channels) == set(other.channels)
        assert not np.allclose(one.channels["speed"], other.channels["speed"][: len(one)], atol=0.5)
    plan = draw_plan("noise", 12, "sticking_cam", "physics", 0.5, truth["attempt"])
    assert build(replace(plan, further=1)).sizes == build(plan).sizes


def test_nothing_missing_is_nothing():
    built = quick("nothing_missing")
    assert np.abs(built.extra).max() < 1e-9
    assert built.nats < 1e-9


@pytest.mark.long
def test_a_rare_effect_is_rare():
    built = quick("rare", effect="sticking_cam", minutes=4.0)
    assert np.abs(built.extra).max() > 0.02
    windows = built.oracle.forces[0].opening
    active = np.minimum(windows.end_s, 240.0) - np.minimum(windows.start_s, 240.0)
    assert 0.0 < active.sum() < 0.02 * 8 * 240.0
    assert np.isfinite(windows.start_s[-2:]).any()


def test_a_law_of_one_condition_acts_under_its_condition_only():
    for seed in range(40):
        plan = draw_plan("one_condition", seed, "mesh_and_churning", "physics", 0.7)
        if plan.condition == "above 17 m/s" and plan.truck != "freightliner":
            break
    built = build(plan)
    slow = built.drives.channels["speed"] < 16.0
    # a gear that differs from the simulator's after a fast segment may last into a slow one
    assert np.abs(built.extra[slow]).mean() < 0.2 * np.abs(built.extra[~slow]).mean() + 1e-6


def test_a_decoy_trends_along():
    built = quick("decoy", seed=4, effect="sticking_cam", minutes=2.0)
    channels = measure(built)
    smooth = np.concatenate([np.convolve(r, np.ones(200) / 200, mode="same") for r in built.extra])
    best = 0.0
    for name in ("gap", "ambient_temperature"):
        if name in channels[0]:
            decoy = np.concatenate([c[name] for c in channels])
            best = max(best, abs(np.corrcoef(decoy, smooth)[0, 1]))
    assert best > 0.7


def test_faults_spoil_what_they_name():
    built = quick("fault", effect="tyre_factor")
    true = built.drives.channels["speed"]
    ratio = np.median(measure(built)[0]["speed"][true[0] > 5.0] / true[0][true[0] > 5.0])
    (size,) = built.sizes
    assert ratio == pytest.approx(1.0 + np.sign(size["sign"]) * size["scale"], abs=0.003)
    hidden = quick("noise", effect="slope_not_recorded")
    assert "grade" not in measure(hidden)[0] and "elevation" not in measure(hidden)[0]


def test_retuning_without_the_effect_fits_better_and_the_oracle_fits_best(tmp_path):
    case = make_case(tmp_path / "a", "absorbed", 21, "sticking_cam", minutes=1.5)
    truth, simulator = open_truth(case), simulators.load(case.simulator)
    recordings = [read(path)[0] for path in case.paths(case.fit)]
    u, w, y = arrays(recordings)
    nominal = simulator.with_parameters(truth["nominal_parameters"])
    wrong = nominal.with_parameters({"mass": 1.2 * truth["nominal_parameters"]["mass"]})
    tuned = wrong.with_parameters(retune(wrong, {"mass": wrong.parameters()["mass"]}, recordings))
    error = [np.std((y - simulators.forced_run(s, u, w, y).y)[:, 1:, 0]) for s in (wrong, tuned)]
    assert error[1] < error[0]
    with np.load(case.folder / "truth" / "drives.npz") as kept:
        extra = kept["extra"]
    before = open_loop(simulator, u, w, y).rmse()["speed_rmse"]
    oracle = open_loop(nominal, u, w, y, extra[: len(recordings)]).rmse()["speed_rmse"]
    assert oracle < 0.7 * before


def test_a_perfect_simulator_has_no_open_loop_error():
    built = quick("nothing_missing", seed=2, minutes=1.0)
    drives = built.drives
    errors = open_loop(built.oracle, drives.u, drives.w, drives.y)
    assert errors.speed.shape == (8, 400)
    assert np.abs(errors.speed).max() < 1e-9


def test_the_tool_is_another_process_that_gets_the_case_alone(tmp_path, monkeypatch):
    seen = {}
    monkeypatch.setattr(
        tool.subprocess, "run", lambda arguments, **more: seen.update(arguments=arguments) or Done
    )
    case = Case(tmp_path, "truck:volvo", ("drive_0",), ("drive_1",), {}, "")
    assert tool.run_tool(case, tmp_path / "found").returncode == 0
    recordings = tmp_path / "recordings"
    given = ["--simulator", "truck:volvo", "--recordings", str(recordings / "drive_0")]
    given += ["--held-out", str(recordings / "drive_1"), "--out", str(tmp_path / "found"), "--overwrite"]
    assert seen["arguments"][-len(given) - 1 :] == ["mismatch", *given]


class Done:
    returncode, stdout, stderr = 0, "", ""


@pytest.mark.parametrize("seed", range(4))
def test_a_withheld_input_is_in_no_recording_and_hides_no_other_truth(tmp_path, seed):
    case = make_case(tmp_path / "a", "input_not_recorded", seed, minutes=0.5)
    truth = open_truth(case)
    channels = {
        "brake": ["brake_command"],
        "gear": ["gear", "engine_speed"],
        "slope": ["grade", "elevation"],
        "gap": ["gap", "leader_speed"],
    }
    (recording,) = read(case.paths(case.fit)[0])
    for name in channels[truth["not_recorded"]]:
        assert not np.isfinite(recording.channels.get(name, np.nan)).any()
    assert truth["effects"] == [] and truth["verdict"] == "nothing_missing"


@pytest.mark.parametrize("key", ["slope_not_recorded", "steady_wind"])
def test_an_accelerometer_feels_a_slope_and_no_wind(key):
    felt = quick("slope_or_wind_felt", effect=key)
    assert "specific_force" not in measure(quick("slope_or_wind", effect=key))[0]
    for channels, grade in zip(measure(felt), felt.drives.channels["grade"], strict=True):
        beyond = channels["specific_force"] - channels["acceleration"]
        gravity = 9.81 * np.sin(np.arctan(grade))
        assert "grade" not in channels and abs(np.mean(beyond[50:] - gravity[50:])) < 0.15
        assert bool(np.std(gravity) > 0.02) is (key == "slope_not_recorded")


# Which laws the levels hide


@pytest.mark.parametrize("level", LEVELS)
def test_plans_of_every_level(level: str) -> None:
    plans = [draw_plan(level, seed, None, "physics", 4.0) for seed in range(60)]
    assert all(p.truck in e.trucks for p in plans for e in p.effects)
    off = [
        np.ptp([p.simulator_values.get(n, 1.0) / p.values.get(n, 1.0) for n in trucks.TUNABLE]) for p in plans
    ]
    assert (np.median(off) > 0.05) == (level in ("wrong_parameters", "absorbed", "only_parameters"))
    if level == "nothing_missing":
        assert all(not p.effects for p in plans) and 0.0 < max(off) < 0.03
    elif level == "only_parameters":
        assert not any(p.effects for p in plans)
    elif level == "input_not_recorded":
        assert {p.hidden_input for p in plans} == set(NOT_RECORDED)
    else:
        assert len({p.effects[0].key for p in plans}) >= 3
    if level == "several":
        assert {len(p.effects) for p in plans} == {2, 3}
        assert all(len({e.name for e in p.effects}) == len(p.effects) for p in plans)
    if level == "unknown":
        assert {bool(p.excluded) for p in plans} == {True, False}
        assert all(p.excluded or p.effects[0].name == "unknown" for p in plans)


@pytest.mark.parametrize(
    "level", [n for n in LEVELS if n not in (*NO_EFFECT, "input_not_recorded", "unknown")]
)
def test_a_level_goes_through_all_that_suit_in_its_own_order(level: str) -> None:
    some = suitable(level)
    chosen = [choose(level, 1000 + k, None)[0][0].key for k in range(len(some))]
    assert sorted(chosen) == sorted(e.key for e in some)
