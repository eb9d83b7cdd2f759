from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.benefit import experiment, report
from benchmarks.benefit.belief import believed
from benchmarks.benefit.effects import CASES, Case, LateEngine, SlowBrake, UnsensedRoad, downhill
from benchmarks.benefit.experiment import benefit
from benchmarks.benefit.plan import BENEFIT, EFFECTS, Effort
from benchmarks.benefit.run import start
from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.environments import scenes
from deeptruck_cacc.environments.rollouts import Trace
from deeptruck_model import files, simulators
from deeptruck_model.errors import InputError

TINY = Effort(seeds=1, iterations=2, rollouts=3, paths=2, window=20)


def speeds(truck, engine: float, brake: float, seconds: float = 10.0) -> np.ndarray:
    steps = round(seconds / 0.1)
    u = np.tile([engine, brake], (1, steps, 1))
    w = np.zeros((1, steps, len(truck.interface.w)))
    return simulators.free_run(truck, u, w, np.array([[0.0, 15.0, 0.0]])).y[0, :, 1]


@pytest.mark.parametrize(
    ("name", "engine", "brake", "sign"),
    [
        ("road_grade", 800.0, 0.0, -1),  # slower uphill
        ("payload", 1500.0, 0.0, -1),  # slower away
        ("brake_lag", 0.0, 40.0, +1),  # later to stop
    ],
)
def test_the_true_truck_has_the_effect_and_the_old_simulator_has_not(name, engine, brake, sign):
    case = CASES[name]
    apart = speeds(case.truck, engine, brake, 5.0)[-1] - speeds(case.old, engine, brake, 5.0)[-1]
    assert sign * apart > 0.1


def test_every_effect_has_its_case():
    assert tuple(CASES) == EFFECTS


def test_only_hot_brakes_fade():
    case = CASES["brake_fade"]
    drag = speeds(case.truck, 1200.0, 12.0, 240.0) - speeds(case.old, 1200.0, 12.0, 240.0)
    assert np.abs(drag[:50]).max() < 1e-6 and drag[-1] > 0.5


def test_a_late_engine_is_late_by_its_delay():
    late = LateEngine()
    late.reset(1)
    sent = [np.array([[float(k), 0.0]]) for k in range(200)]
    arrived = [late.filter(u, 0.0, 0.01)[0, 0] for u in sent]
    assert arrived[150] == 150 - 60


def test_a_slow_brake_has_its_time_constant():
    slow = SlowBrake()
    slow.reset(1)
    for _ in range(80):
        out = slow.filter(np.array([[0.0, 1.0]]), 0.0, 0.01)
    assert out[0, 1] == pytest.approx(1 - np.exp(-1.0))


def test_the_road_is_as_steep_as_it_says():
    class View:
        mass, distance = np.array([1e3]), np.linspace(0, 50e3, 5000)

    slope = -UnsensedRoad().force(View, 0.01) / (1e3 * 9.81)
    assert 0.019 < slope.min() < slope.max() < 0.041 and slope.mean() == pytest.approx(0.03, abs=1e-3)


def test_downhill_changes_the_road_alone():
    flat, steep = (d(np.random.default_rng(0), 5, 100, 0.1) for d in (scenes.moving, downhill(scenes.moving)))
    assert (steep.grade <= -0.02).all() and (steep.grade >= -0.05).all()
    np.testing.assert_array_equal(flat.leader_acceleration, steep.leader_acceleration)


@pytest.mark.long
def test_one_case_from_drives_to_page(tmp_path, monkeypatch):
    """A payload at a hundredth of the effort: the tool finds it, and the policy is that of the true truck."""
    monkeypatch.setattr(experiment, "DRIVES", 3)
    monkeypatch.setattr(experiment, "HELD_OUT", 1)
    monkeypatch.setattr(experiment, "DRIVE_S", 120.0)
    out = tmp_path / "benefit"

    def kill(line: str) -> None:
        if "corrected" in line:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        benefit(out, ["payload"], ["trusting"], TINY, say=kill)
    assert [path.name for path in tmp_path.iterdir()] == [".benefit.unfinished"]
    drive = Path("work") / "cases" / "payload" / "drive0"
    stamp = (files.unfinished(out) / drive).stat().st_mtime_ns
    with pytest.raises(InputError, match=r"was begun and not finished .*; add --resume"):
        benefit(out, ["payload"], ["trusting"], TINY)
    results = benefit(out, ["payload"], ["trusting"], TINY, resume=True)["payload"]
    assert (out / drive).stat().st_mtime_ns == stamp  # not driven again
    assert results["applied"] and {"mass", "payload_change"} & set(results["found"])
    before, _, after = results["free_run_speed_rmse"].values()
    assert after < 0.5 * before
    least = {kind: seeds[0]["stop"]["min_gap_m"] for kind, seeds in results["recipes"]["trusting"].items()}
    assert min(least.values()) > 2.0  # the shield keeps 2 m with each policy
    # The corrected simulator teaches what the true one does; the old one teaches something else.
    assert abs(least["corrected"] - least["true"]) < 0.25 * abs(least["old"] - least["true"])
    assert "runs that end below 2 m" in (out / "benefit.md").read_text()
    assert json.loads((out / "benefit.json").read_text())["payload"]["found"] == results["found"]
    assert (out / "benefit.png").stat().st_size > 10_000
    with pytest.raises(InputError, match=r"holds a benefit of correction already; .*--overwrite"):
        benefit(out, ["payload"], ["trusting"], TINY)
    assert BENEFIT.check(out, overwrite=True)
    BENEFIT.claim(out)
    assert BENEFIT.check(out, overwrite=True)  # each file is known by its name
    (out / "work" / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match=r"holds work/notes.txt, which is no part of"):
        benefit(out, ["payload"], ["trusting"], TINY, overwrite=True)


def test_a_shield_learns_the_fade_from_a_simulator_that_has_it():
    case = CASES["brake_fade"]
    bold, wary = (believed(truck, hot=True) for truck in (case.old, case.truck))
    heat = np.array([3000.0])
    assert bold.braking_when(heat) > 0.9 * bold.braking
    assert wary.braking_when(heat) < 0.7 * wary.braking
    assert wary.needed_gap(np.array([15.0]), np.array([15.0]), heat, 0.1) > 1.5 * bold.needed_gap(
        np.array([15.0]), np.array([15.0]), heat, 0.1
    )


def test_what_was_done_with_the_same_effort_is_not_done_again(tmp_path):
    done = []

    def do():
        done.append(1)
        return [{"moving": {"e": len(done)}}]

    assert [experiment._once(tmp_path / "x" / "e.json", e, do)[0]["moving"]["e"] for e in (TINY, TINY)] == [
        1,
        1,
    ]
    assert experiment._once(tmp_path / "x" / "e.json", Effort(), do)[0]["moving"]["e"] == 2


def test_without_a_correction_the_old_simulator_stands(tmp_path):
    truck = simulators.load("truck:trucksim")
    case = Case("nothing", truck, truck, "trucksim")
    (tmp_path / "cases" / "nothing").mkdir(parents=True)
    truck.save(tmp_path / "cases" / "nothing" / "old")
    found = experiment._simulators("nothing", case, tmp_path)
    assert found["corrected"][1].parameters() == found["old"][1].parameters()


def test_errors_count_where_the_truck_had_the_power():
    truck = simulators.load("truck:trucksim")
    scene = scenes.paper(np.random.default_rng(0), 2, 300, 0.1)
    scene = replace(scene, grade=np.stack([np.zeros(300), np.full(300, 0.3)]))  # no truck climbs 30 %
    scene = replace(scene, speed=scene.leader_speed)
    ones = np.ones((300, 2))
    signals = dict.fromkeys(
        ("gap", "ttc", "acceleration", "jerk", "fuel", "acted", "reward", "crash", "speed_error"), ones
    )
    signals |= {"speed": 10 * ones, "time_gap_error": ones * [0.1, 9.0], "brake_command": 20 * ones}
    row = experiment.measured(Trace(0.1, scene, signals), PedalMap.calibrate(truck))
    assert row["time_gap_rms_s"] == pytest.approx(0.1) and row["brake_share"] == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("old", "corrected", "says"),
    [
        ([0.5, 0.6], [0.1, 0.2], "yes, x 0.27"),
        ([0.1, 0.2], [0.5, 0.6], "no, x 3.67"),
        ([0.1, 0.5], [0.2, 0.1], "unclear, x 0.50"),
        ([0.5, 0.6], [0.5, 0.59], "no difference, x 0.99"),
    ],
)
def test_it_pays_only_where_no_seed_says_otherwise(old, corrected, says):
    kinds = {k: [{"s": {"e": x}} for x in xs] for k, xs in (("old", old), ("corrected", corrected))}
    assert report.paid(kinds, "s", "e") == says


def test_unknown_names_are_refused(tmp_path, monkeypatch, capsys):
    with pytest.raises(InputError, match="no effect 'moon'; known: road_grade"):
        benefit(tmp_path / "out", ["moon"])
    monkeypatch.setattr(sys, "argv", ["run.py", "--out", str(tmp_path), "--recipe", "haste"])
    with pytest.raises(SystemExit) as ended:
        start()
    assert ended.value.code == 2 and "haste" in capsys.readouterr().err


def test_a_file_in_the_way_is_refused(tmp_path):
    (tmp_path / "f").write_text("x")
    with pytest.raises(InputError, match="f is a file; choose another --out"):
        benefit(tmp_path / "f")
