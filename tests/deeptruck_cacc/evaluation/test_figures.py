"""What the figures say, and that no legend lies over a curve."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from deeptruck_cacc.environments.hard_scenes import long_following
from deeptruck_cacc.environments.rollouts import Trace
from deeptruck_cacc.evaluation import figures
from deeptruck_core.signals import TruckInterface


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


def test_a_short_learning_curve_has_no_half_iterations(drawn, tmp_path):
    axis = drawn(figures.learning_curve, [[{"cost": 1.0}] * 4], tmp_path / "x.png").axes[0]
    np.testing.assert_array_equal(axis.get_xticks() % 1.0, 0.0)


def test_a_run_is_drawn_with_units_and_its_legends_outside(drawn, tmp_path):
    scene = long_following(np.random.default_rng(0), 1, 100, 0.1)
    names = ("leader_speed", "speed", "time_gap_error", "engine_command", "brake_command", "acceleration")
    trace = Trace(0.1, scene, {name: np.ones((100, 1)) for name in ("gap", *names)})
    interface = TruckInterface("mine", engine_unit="percent", brake_unit="m/s^2")
    figure = drawn(figures.field_run, trace, tmp_path / "x.png", interface)
    labels = {axis.get_ylabel() for axis in figure.axes}
    assert {"engine\n[%]", "brake\n[m/s²]"} <= labels
    assert_legends_are_outside(figure)


def test_error_bands_name_their_units_and_keep_their_legend_outside(drawn, tmp_path):
    scene = long_following(np.random.default_rng(0), 3, 100, 0.1)
    names = ("gap", "time_gap_error", "speed_error")
    trace = Trace(0.1, scene, {name: np.ones((100, 3)) for name in names})
    figure = drawn(figures.error_bands, trace, tmp_path / "x.png")
    assert [axis.get_ylabel() for axis in figure.axes] == ["time-gap error [s]", "speed error [m/s]"]
    assert_legends_are_outside(figure)


def test_amplification_says_which_controller_outside_the_curves(drawn, tmp_path):
    row = {"frequency_hz": [0.01, 0.1], "worst_speed_amplification": [1.0, 0.5]}
    row["worst_gap_error_amplification"] = [1.0, 0.2]
    rows = dict.fromkeys(("policy, V2V", "policy, radar", "acc", "cacc"), row)
    figure = drawn(figures.amplification, rows, tmp_path / "x.png")
    assert_legends_are_outside(figure)
