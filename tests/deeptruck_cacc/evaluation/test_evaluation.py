from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from matplotlib.figure import Figure

from deeptruck_cacc.controllers.baselines import baseline
from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.environments import hard_scenes
from deeptruck_cacc.environments.hard_scenes import long_following
from deeptruck_cacc.environments.rollouts import Trace, roll_out
from deeptruck_cacc.evaluation import evaluate, figures, metrics, platoon, report, table
from deeptruck_core.signals import TruckInterface


@pytest.fixture
def cacc(toy):
    return baseline("cacc", toy.interface, PedalMap.calibrate(toy))


FEW = ("acc", "cacc")


@pytest.fixture(scope="module")
def evaluated(shared_toy, tmp_path_factory):
    """An evaluation beside FEW baselines, and what it returned."""
    cacc = baseline("cacc", shared_toy.interface, PedalMap.calibrate(shared_toy))
    out = tmp_path_factory.mktemp("evaluated") / "e"
    return out, evaluate(cacc, shared_toy, out, rollouts=4, baselines=FEW)


def test_evaluate_writes_metrics_and_figures(evaluated):
    out, results = evaluated
    assert json.loads((out / "metrics.json").read_text()) == results
    assert set(results["sets"]) == {"paper", "moving", "gap_closing", "long_following"}
    for name in results["sets"]:
        assert (out / f"{name}.png").stat().st_size > 10_000
    row = results["sets"]["paper"]
    closing = results["sets"]["gap_closing"]
    assert 0 < closing["closed_s_paper_bounds_median"] <= closing["closed_s_paper_bounds"]
    assert row["crashes"] == 0 and row["time_gap_error_after_10s"]["worst_abs"] < 0.2
    assert table(results).row_count == 4 * (1 + len(FEW))
    assert results["sets"] == results["baselines"]["cacc"]  # the policy is that baseline
    text = (out / "evaluation.html").read_text()
    assert f">{row['time_gap_error_after_10s']['worst_abs']:.3f}<" in text
    assert re.search(
        r"<h1>Mean time-gap error \d\.\d{3} s \(ACC: \d\.\d{3} s\), smallest gap \d+\.\d m, no crash", text
    )
    assert text.count("data:image/png;base64,") == 4 and "http" not in text.partition("<body>")[2]


def test_a_summary_counts_only_where_the_truck_had_the_power(toy, cacc):
    trace = roll_out(toy, cacc, hard_scenes.moving(np.random.default_rng(0), 4, 300, toy.dt))
    trace.signals["time_gap_error"] = np.zeros((300, 4))
    trace["time_gap_error"][150, 1:3] = 0.3, 0.2
    reach = np.ones((300, 4), bool)
    reach[150, 1] = False
    row = metrics.summary(trace, reach)
    assert row["time_gap_error_after_10s"]["worst_abs"] == 0.3
    assert row["time_gap_worst_within_reach"] == 0.2 and row["rollouts_within_0.1_s"] == 3
    assert row["time_gap_p99_within_reach"] == 0.0


def test_brake_pulses_are_counted_an_hour():
    brake = np.zeros((3600, 2))
    brake[100:110, 0] = brake[300:305, 0] = brake[50:, 1] = 10.0
    trace = Trace(0.1, hard_scenes.settled(2, 3600, 20.0, 2.0), {"brake_command": brake})
    assert metrics.brake_pulses_per_h(trace) == pytest.approx(3 / 0.2, rel=1e-3)


def test_settling_time_is_the_last_time_outside():
    scene = hard_scenes.settled(2, 4, 20.0, 2.0)
    errors = np.array([[1.0, 0.0], [0.0, 0.0], [0.4, 0.0], [0.0, 0.9]])
    trace = Trace(0.1, scene, {"time_gap_error": errors, "speed_error": 0 * errors})
    np.testing.assert_allclose(metrics.settling_time(trace, 0.35, 0.2), [0.3, np.inf])


@pytest.mark.parametrize("name", sorted(hard_scenes.HARD))
def test_every_scene_is_well_formed_and_drivable(toy, cacc, name):
    draw, seconds = hard_scenes.HARD[name]
    steps = round(min(seconds, 40.0) / toy.dt)
    scene = draw(np.random.default_rng(0), 5, steps, toy.dt)
    assert scene.batch == 5 and scene.steps == steps
    for history in (scene.gap_jump, scene.seen, scene.seen_gap_offset, scene.hidden_grade):
        assert history is None or history.shape == (5, steps)
    from deeptruck_cacc.safety.guard import guard

    trace = roll_out(toy, guard(cacc, shield=False), scene)
    assert np.isfinite(trace["gap"]).all() and not np.isnan(trace["engine_command"]).any()


def test_platoon_followers_follow_the_truck_before_them(toy, cacc):
    first = hard_scenes.settled(2, 100, 18.0, 1.5)
    pull = np.zeros((2, 100))
    pull[:, 20:40] = -1.0
    traces = platoon.drive(toy, cacc, replace(first, leader_acceleration=pull), trucks=3)
    np.testing.assert_allclose(traces[1]["leader_speed"], traces[0]["speed"], atol=1e-9)


def test_a_linear_follower_amplifies_as_its_transfer_function_says(toy):
    class Proportional:
        """v' = k (v_leader - v) on a truck without lag: gain k / sqrt(k^2 + w^2)."""

        interface, dt = toy.interface, 0.1

        def reset(self):
            pass

        def act(self, o):
            wanted = 0.5 * (o["leader_speed"] - o["speed"])
            u = wanted + 0.05
            return 1000 * np.maximum(u, 0), np.maximum(-u, 0) / 0.06

    toy = replace(toy, lag=0.1)
    row = platoon.string_stability(toy, Proportional(), trucks=2)
    gain = 0.5 / np.hypot(0.5, 2 * np.pi * np.array(row["frequency_hz"]))
    np.testing.assert_allclose(row["worst_speed_amplification"], gain, rtol=0.08)
    np.testing.assert_allclose(row["head_to_tail_speed_amplification"], gain**2, rtol=0.16)
    few = platoon.string_stability(toy, Proportional(), trucks=2, frequencies=platoon.FREQUENCIES[::3])
    for key in ("frequency_hz", "worst_speed_amplification", "head_to_tail_speed_amplification"):
        np.testing.assert_allclose(few[key], row[key][::3])


@pytest.mark.long
def test_baselines_stand_behind_the_same_shield_and_steps_are_told(toy, tmp_path, monkeypatch):
    """Two scenes, and pairs of trucks; other tests have the rest."""
    monkeypatch.setattr(report, "HARD", {name: hard_scenes.HARD[name] for name in ("paper", "stop")})
    monkeypatch.setattr(report, "LEADERS", ())
    monkeypatch.setattr(platoon, "string_stability", partial(platoon.string_stability, trucks=2, draws=1))
    said = []
    driver = baseline("acc", toy.interface)
    behind, bare = (
        evaluate(driver, toy, tmp_path / n, rollouts=2, shield=on, full=True, draw=False, say=said.append)
        for n, on in (("behind", True), ("bare", False))
    )
    assert {"driving paper, policy", "driving stop, cacc", "driving platoons"} <= {*said}
    assert all(sets["stop"]["crashes"] == 0 for sets in behind["baselines"].values())
    assert any(sets["stop"]["crashes"] > 0 for sets in bare["baselines"].values())


# Figures say what they show, and no legend lies over a curve


@pytest.fixture
def drawn(monkeypatch, tmp_path):
    """The figure that a function of `figures` would have saved."""
    kept: list[Figure] = []
    monkeypatch.setattr(figures, "_save", lambda figure, path: kept.append(figure))

    def _drawn(draw, *arguments) -> Figure:
        draw(*arguments)
        kept[-1].canvas.draw()
        return kept[-1]

    return _drawn


def assert_legends_are_outside(figure: Figure) -> None:
    shown = [axis for axis in figure.axes if axis.get_legend() is not None]
    assert shown
    for axis in shown:
        legend = axis.get_legend().get_window_extent()
        assert not any(legend.overlaps(other.get_window_extent()) for other in figure.axes)
        assert not legend.overlaps(axis.title.get_window_extent()) or not axis.get_title()
        assert not axis.get_title(loc="left") or not legend.overlaps(axis._left_title.get_window_extent())


@pytest.mark.parametrize(("seeds", "says"), [(1, "the only seed"), (3, "mean of 3 seeds")])
def test_a_learning_curve_counts_its_seeds(drawn, tmp_path, seeds, says):
    runs = [[{"cost": 1.0 / (n + 1) + k} for n in range(20)] for k in range(seeds)]
    figure = drawn(figures.learning_curve, runs, tmp_path / "x.png")
    texts = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert says in texts and ("min, max" in texts) == (seeds > 1)
    assert_legends_are_outside(figure)


def test_a_run_is_drawn_with_units_and_its_legends_outside(drawn, tmp_path):
    scene = long_following(np.random.default_rng(0), 1, 100, 0.1)
    names = ("leader_speed", "speed", "time_gap_error", "engine_command", "brake_command", "acceleration")
    trace = Trace(0.1, scene, {name: np.ones((100, 1)) for name in ("gap", *names)})
    interface = TruckInterface("mine", engine_unit="percent", brake_unit="m/s^2")
    figure = drawn(figures.field_run, trace, tmp_path / "x.png", interface)
    labels = {axis.get_ylabel() for axis in figure.axes}
    assert {"engine\n[%]", "brake\n[m/s²]"} <= labels
    assert_legends_are_outside(figure)
