"""Sealed cases: repeatable, closed, and true to their level."""

import json

import numpy as np
import pytest

from deeptruck_exam import tool
from deeptruck_exam.absorption import retune
from deeptruck_exam.cases import Case, make_case, measure, open_truth
from deeptruck_exam.choice import mark, suitable
from deeptruck_exam.command import prove
from deeptruck_exam.construction import build
from deeptruck_exam.effects.planting import ALL, FAMILIES, FORMS
from deeptruck_exam.evaluation import arrays, open_loop, residual
from deeptruck_exam.jobs import Job
from deeptruck_exam.plans import LEVELS, draw_plan
from deeptruck_exam.worlds import trucks
from deeptruck_model import simulators
from deeptruck_model.errors import InputError
from deeptruck_model.recordings import read


def quick(level, seed=3, effect=None, minutes=0.7):
    return build(draw_plan(level, seed, effect, "physics", minutes))


def test_the_same_arguments_give_the_same_case(tmp_path):
    one = make_case(tmp_path / "a", "noise", 12, "dragging_brake", minutes=0.5)
    two = make_case(tmp_path / "b", "noise", 12, "dragging_brake", minutes=0.5)
    assert one.sha256 == two.sha256
    assert one == Case.read(tmp_path / "a")
    left, right = (read(c.paths(c.fit)[0])[0] for c in (one, two))
    np.testing.assert_array_equal(left.y, right.y)
    assert left.interface == simulators.load(one.simulator).interface
    open_to_the_tool = "".join(
        p.read_text() for p in (tmp_path / "a" / "case.json", tmp_path / "a" / "simulator.yaml")
    )
    assert "dragging" not in open_to_the_tool
    truth = json.loads((tmp_path / "a" / "sealed" / "truth.json").read_text())
    truth["effects"][0]["name"] = "headwind"
    (tmp_path / "a" / "sealed" / "truth.json").write_text(json.dumps(truth))
    with pytest.raises(InputError, match="sealed"):
        open_truth(one)
    with pytest.raises(InputError, match="exists"):
        make_case(tmp_path / "b", "noise", 12)


@pytest.mark.parametrize("level", LEVELS)
def test_plans_of_every_level(level):
    plans = [draw_plan(level, seed, None, "physics", 4.0) for seed in range(60)]
    assert all(p.truck in e.trucks for p in plans for e in p.effects)
    assert all((p.grade or p.truck == "freightliner" or p.effects[0].key == "road_grade") for p in plans)
    off = [np.ptp([p.believed.get(n, 1.0) / p.values.get(n, 1.0) for n in trucks.TUNABLE]) for p in plans]
    assert (np.median(off) > 0.05) == (level in ("wrong_parameters", "absorbed"))
    if level == "nothing_missing":
        assert all(not p.effects for p in plans)
        assert 0.0 < np.mean(np.array(off) > 0) < 1.0 and max(off) < 0.03
    else:
        assert len({p.effects[0].key for p in plans}) > 3
    if level == "several":
        assert {len(p.effects) for p in plans} == {2, 3}
        assert all(len({e.name for e in p.effects}) == len(p.effects) for p in plans)
    if level == "not_in_library":
        assert {bool(p.excluded) for p in plans} == {True, False}
        assert all(p.excluded or p.effects[0].name == "unknown" for p in plans)


def test_bad_requests_are_one_line():
    with pytest.raises(InputError, match="levels"):
        draw_plan("easy", 0, None, "physics", 4.0)
    with pytest.raises(InputError, match="effects"):
        draw_plan("noise", 0, "gremlins", "physics", 4.0)


def test_nothing_missing_is_nothing():
    built = quick("nothing_missing")
    assert np.abs(built.extra).max() < 1e-9
    assert built.nats < 1e-9


@pytest.mark.long
def test_a_rare_effect_is_rare():
    built = quick("rare", effect="dragging_brake", minutes=4.0)
    assert np.abs(built.extra).max() > 0.02
    windows = built.oracle.forces[0].opening
    active = np.minimum(windows.end_s, 240.0) - np.minimum(windows.start_s, 240.0)
    assert 0.0 < active.sum() < 0.02 * 8 * 240.0
    assert np.isfinite(windows.start_s[-2:]).any()


def test_a_confounded_effect_acts_under_its_condition_only():
    for seed in range(40):
        # in one world, whose cases a new family does not change: it has drives that are fast enough
        plan = draw_plan("confounded", seed, "driveline_loss", "physics", 0.7, forms="first")
        if plan.condition == "above 17 m/s" and plan.truck != "freightliner":
            break
    built = build(plan)
    slow = built.drives.channels["speed"] < 16.0
    # a gear that differs from the simulator's after a fast stretch may last into a slow one
    assert np.abs(built.extra[slow]).mean() < 0.2 * np.abs(built.extra[~slow]).mean() + 1e-6


def test_a_decoy_trends_along():
    built = quick("decoy", seed=4, effect="dragging_brake", minutes=2.0)
    channels = measure(built)
    smooth = np.concatenate([np.convolve(r, np.ones(200) / 200, mode="same") for r in built.extra])
    best = 0.0
    for name in ("gap", "ambient_temperature"):
        if name in channels[0]:
            decoy = np.concatenate([c[name] for c in channels])
            best = max(best, abs(np.corrcoef(decoy, smooth)[0, 1]))
    assert best > 0.7


def test_sensors_have_their_resolution_and_little_error():
    built = quick("nothing_missing", seed=8)
    measured, true = measure(built), built.drives.channels
    step = 1.0 / 3.6 / 256.0
    for row, channels in enumerate(measured):
        counts = channels["speed"] / step
        np.testing.assert_allclose(counts, np.rint(counts), atol=1e-6)
        assert np.std(channels["speed"] - true["speed"][row]) < 0.15
        assert abs(np.mean(channels["acceleration"] - true["acceleration"][row])) < 0.03


def test_faults_spoil_what_they_name():
    built = quick("measurement_fault", effect="speed_scale")
    true = built.drives.channels["speed"]
    ratio = np.median(measure(built)[0]["speed"][true[0] > 5.0] / true[0][true[0] > 5.0])
    (size,) = built.sizes
    assert ratio == pytest.approx(1.0 + np.sign(size["sign"]) * size["scale"], abs=0.003)
    hidden = quick("noise", effect="road_grade")
    assert "grade" not in measure(hidden)[0] and "elevation" not in measure(hidden)[0]


def test_retuning_without_the_effect_fits_better_and_the_oracle_fits_best(tmp_path):
    case = make_case(tmp_path / "a", "absorbed", 21, "dragging_brake", minutes=1.5)
    truth, simulator = open_truth(case), simulators.load(case.simulator)
    recordings = [read(path)[0] for path in case.paths(case.fit)]
    u, w, y = arrays(recordings)
    nominal = simulator.with_parameters(truth["nominal_parameters"])
    wrong = nominal.with_parameters({"mass": 1.2 * truth["nominal_parameters"]["mass"]})
    tuned = wrong.with_parameters(retune(wrong, {"mass": wrong.parameters()["mass"]}, recordings))
    error = [np.std(residual(s, u, w, y)) for s in (wrong, tuned)]
    assert error[1] < error[0]
    with np.load(case.folder / "sealed" / "drives.npz") as sealed:
        extra = sealed["extra"]
    before = open_loop(simulator, u, w, y).rmse()["speed_rmse"]
    oracle = open_loop(nominal, u, w, y, extra[: len(recordings)]).rmse()["speed_rmse"]
    assert oracle < 0.7 * before


def test_a_perfect_simulator_has_no_open_loop_error():
    built = quick("nothing_missing", seed=2, minutes=1.0)
    drives = built.drives
    errors = open_loop(built.oracle, drives.u, drives.w, drives.y)
    assert errors.speed.shape == (8, 400)
    assert np.abs(errors.speed).max() < 1e-9


@pytest.mark.parametrize("forms", (ALL, "fourth"))
@pytest.mark.parametrize("level", LEVELS)
def test_every_level_goes_through_all_effects_in_its_own_order(level, forms):
    count = len(suitable(level, forms)) or 1
    plans = [draw_plan(level, 1000 + k, None, "physics", 4.0, forms=forms) for k in range(count)]
    if level == "nothing_missing":
        assert all(not p.effects for p in plans)
        return
    if level != "not_in_library":
        assert {p.effects[0].key for p in plans} == {e.key for e in suitable(level, forms)}
    assert all(p.truck in e.trucks for p in plans for e in p.effects)
    families = {e.family for p in plans for e in p.effects if e.kind != "parameter_error"}
    assert families <= set(FAMILIES) if forms == ALL else families <= {forms}


def test_one_seed_hides_other_effects_at_other_levels():
    levels = [level for level in LEVELS if level != "nothing_missing"]
    assert len({mark(level, forms) for level in LEVELS for forms in FORMS}) == len(LEVELS) * len(FORMS)
    for seed in (0, 7, 100_003):
        plans = [draw_plan(level, seed, None, "physics", 4.0) for level in levels]
        assert len({p.effects[0].key for p in plans}) >= len(levels) - 2
        assert len({p.effect_seed for p in plans}) == len(levels)


@pytest.mark.parametrize("forms", FAMILIES)
def test_a_name_finds_the_family_asked_for(forms):
    assert draw_plan("noise", 0, "brake_fade", "physics", 1.0, forms=forms).effects[0].family == forms


def test_the_sealed_truth_alone_says_the_family(tmp_path):
    case = make_case(tmp_path / "a", "noise", 12, "dragging_brake", minutes=0.5, forms="third")
    truth = open_truth(case)
    assert truth["forms"] == truth["effects"][0]["family"] == "third"
    assert "third" not in (tmp_path / "a" / "case.json").read_text()
    assert len({Job("noise", 1, forms=f).folder for f in FORMS}) == len(FORMS)


def test_unknown_forms_are_refused_in_one_line(tmp_path):
    with pytest.raises(
        InputError, match="--forms: there are no effects of 'twenty-second'; choose from all, first"
    ):
        draw_plan("noise", 0, None, "physics", 1.0, forms="twenty-second")
    with pytest.raises(InputError, match="no effects of 'twenty-second'"):
        prove(tmp_path / "p", forms="twenty-second")
    assert not (tmp_path / "p").exists()


def test_the_tool_is_another_process_that_is_told_the_case_alone(tmp_path, monkeypatch):
    seen = {}
    monkeypatch.setattr(
        tool.subprocess, "run", lambda arguments, **more: seen.update(arguments=arguments) or Done
    )
    case = Case(tmp_path, "truck:volvo", ("drive_0",), ("drive_1",), {}, "")
    assert tool.run_tool(case, tmp_path / "found").returncode == 0
    recordings = tmp_path / "recordings"
    told = ["--simulator", "truck:volvo", "--recordings", str(recordings / "drive_0")]
    told += ["--held-out", str(recordings / "drive_1"), "--out", str(tmp_path / "found")]
    assert seen["arguments"][-len(told) - 1 :] == ["mismatch", *told]


class Done:
    returncode, stdout, stderr = 0, "", ""
