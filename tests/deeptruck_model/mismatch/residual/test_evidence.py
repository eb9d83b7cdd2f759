"""Stacked recordings: every filter starts afresh with each of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.mismatch.residual.evidence import DriveRows, Evidence

SIZES, DT = (120, 80), 0.2


@pytest.fixture
def evidence() -> Evidence:
    n = sum(SIZES)
    drives = (
        DriveRows("a", 0, SIZES[0], 0.0, False),
        DriveRows("b", SIZES[0], n, 5.0, True),
    )
    rng = np.random.default_rng(0)
    valid = np.ones(n, dtype=bool)
    valid[:10] = False
    gear = np.full(n, np.nan)
    gear[:90] = 3.0
    signals = {"speed": rng.uniform(5.0, 20.0, n), "gear": gear}
    disagreement = np.zeros(n)
    disagreement[50] = 0.1
    return Evidence(
        DT, drives, rng.normal(size=n), np.zeros(n), disagreement, valid, signals, {}, 2e4,
        lambda name, amount: np.zeros(n),
    )  # fmt: skip


def test_what_acts_for_seconds_adds_up_as_much_however_long_the_driving(evidence: Evidence) -> None:
    """0.1 m/s^2 for the last second of a window of 2 s, in one of six windows of the fitted drive."""
    force = np.zeros(len(evidence))
    force[round(1.0 / DT) : round(2.0 / DT)] = 0.1
    rows = round(1.0 / DT)
    expected = 0.1 * DT * np.sqrt(np.mean(np.r_[np.zeros(rows), np.arange(1, rows + 1)] ** 2))
    windows = 120 / (2 * rows)
    whole = replace(evidence, valid=np.ones(len(evidence), dtype=bool))
    assert whole.adds_up(force, 2.0, where_it_acts=True) == pytest.approx(expected)
    assert whole.adds_up(force, 2.0) == pytest.approx(expected / np.sqrt(windows))
    assert whole.adds_up(np.zeros(len(evidence)), 2.0, where_it_acts=True) == 0.0


def test_bookkeeping(evidence: Evidence) -> None:
    assert len(evidence) == 200
    assert np.flatnonzero(evidence.starts).tolist() == [0, 120]
    assert evidence.record.tolist() == [0] * 120 + [1] * 80
    assert evidence.held_out.sum() == 80
    assert evidence.has("speed") and not evidence.has("gear") and not evidence.has("speed", "gap")


@pytest.mark.parametrize(("initial", "first"), [("first", 1.0), ("zero", 1.0 - np.exp(-DT / 2.0))])
def test_lag_answers_a_step_and_starts_again(evidence: Evidence, initial: str, first: float) -> None:
    x = np.where(np.arange(200) >= 120, 1.0, 0.0)
    out = evidence.lag(x, 2.0, initial)
    assert not out[:120].any() and out[120] == pytest.approx(first)
    rise = 1.0 - (1.0 - first) * np.exp(-np.arange(80) * DT / 2.0)
    assert out[120:] == pytest.approx(rise)


def test_since_integral_and_difference_do_not_look_across_recordings(evidence: Evidence) -> None:
    event = np.zeros(200, dtype=bool)
    event[110] = True
    since = evidence.since(event)
    assert np.isinf(since[:110]).all() and np.isinf(since[120:]).all()
    assert since[110:120] == pytest.approx(DT * np.arange(10))
    ones = np.ones(200)
    assert evidence.integral(ones)[[119, 120]] == pytest.approx([120 * DT, DT])
    difference = evidence.difference(np.r_[np.arange(120.0), np.full(80, -7.0)])
    assert difference[1:120] == pytest.approx(1.0 / DT) and not difference[[0, *range(120, 200)]].any()


def test_where_the_simulator_disagrees_with_itself_samples_weigh_less(evidence: Evidence) -> None:
    series = evidence.series(0.05)
    assert series.relative[50] > 3.0 and series.relative[0] == 1.0
    assert (series.relative[45:56] > 1.0).all()  # those it is whitened with, too


def test_changes_of_a_parameter_add_up_by_factors(evidence: Evidence) -> None:
    evidence.moved["mass"] = 0.1
    assert evidence.total_change("mass", 0.1) == pytest.approx(0.21)
    assert evidence.total_change("drag_area", 0.1) == pytest.approx(0.1)
