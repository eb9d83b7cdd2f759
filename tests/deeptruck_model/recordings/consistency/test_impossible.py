"""What no truck can do is set aside before anything is derived, counted, and nothing else is."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from csv_tables import COLUMNS, drive, speed, with_channels, write_csv

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_model.recordings import import_table
from deeptruck_model.recordings.consistency.impossible import (
    FROZEN,
    SPIKES,
    Places,
    changed_unit,
    impossible,
    lost_decimals,
    moving_at_zero,
    zero_changes,
)
from deeptruck_model.recordings.extract import read

T = np.round(0.1 * np.arange(1200), 1)
V = speed(T)


def found(t: Array, v: Array, channel: str = "speed") -> dict[str, list[int]]:
    return {reason: np.flatnonzero(these).tolist() for reason, these in impossible(channel, "", t, v)}


@pytest.mark.parametrize(
    ("step_s", "rows", "by_m_s"),
    [
        (0.1, [150, 400, 401, 700, 950], 30.0),
        (0.1, [150, 400, 401, 700, 950], -4.0),
        (0.1, [0, 1199], 30.0),
        (1.0, [50, 200, 201, 400], 18.0),
        (0.02, [300, 301, 302, 900], 3.0),
    ],
)
def test_samples_far_off_are_set_aside_alone(step_s: float, rows: list[int], by_m_s: float) -> None:
    t = step_s * np.arange(1200)
    v = np.round(speed(t), 2)
    assert found(t, v) == {}
    v[rows] += by_m_s
    assert found(t, v) == {SPIKES: rows}


def test_an_account_has_the_spikes_of_an_import_and_of_its_bag(tmp_path: Path) -> None:
    columns = drive(1200)
    columns["v"][[150, 400, 401, 700, 950]] += 110.0
    (r,) = import_table(write_csv(tmp_path / "d.csv", columns), COLUMNS, tmp_path / "bag").recordings
    assert r.account is not None and r.account.balanced
    assert r.account.channels["speed"].aside[SPIKES].count == 5 and r.account.channels["speed"].used == 1195
    assert np.nanmax(np.abs(r.channels["acceleration"])) < 1.5
    (again,) = read(tmp_path / "bag")
    assert any(f"5 of 1200 samples {SPIKES}" in note for note in again.notes)
    np.testing.assert_array_equal(again.channels["acceleration"], r.channels["acceleration"])


def test_an_acceleration_across_a_jump_is_counted(tmp_path: Path) -> None:
    columns = drive(1200)
    columns["v"][600:] += 40.0
    (r,) = import_table(write_csv(tmp_path / "d.csv", columns), COLUMNS, tmp_path / "bag").recordings
    (aside,) = r.account.channels["acceleration"].aside.items()
    assert "jumps faster than any truck" in aside[0] and aside[1].count == 1


def test_a_speed_that_stands_still_and_jumps_is_none() -> None:
    v = np.round(V, 2)
    v[300:420] = v[300]
    assert found(T, v) == {FROZEN: [*range(301, 420)]}
    cruise = np.round(np.where((T > 20) & (T < 60), 20.0, 20.0 + 0.1 * np.maximum(T - 60, 0)), 2)
    coarse = np.round(V)
    assert found(T, cruise) == {} and found(T, coarse) == {}


HEIGHT = 300.0 + np.round(0.02 * np.cumsum(V), 1)
LEVEL = HEIGHT.copy()
LEVEL[200:600] = LEVEL[200]
LEVEL[600:] += LEVEL[200] - HEIGHT[599]  # the road goes on where it was


def test_a_height_that_stands_still_and_jumps_is_none() -> None:
    """A level road is no fault, a driver holds a pedal, and an engine that idles takes the same fuel."""
    held = HEIGHT.copy()
    held[300:420] = held[300]
    assert found(T, held, "elevation") == {FROZEN: [*range(301, 420)]}
    assert found(T, LEVEL, "elevation") == found(T, held, "engine_command") == {}
    idling = np.where((T > 30.0) & (T < 50.0), 2.5, np.round(0.4 * V, 2))
    assert found(T, idling, "fuel_rate") == {}


@pytest.mark.parametrize(
    ("step_s", "by_m", "noise_m"), [(0.1, -42.0, 0.0), (1.0, 12.0, 0.3), (0.1, 6.0, 0.0)]
)
def test_a_height_that_changes_its_zero(step_s: float, by_m: float, noise_m: float, tmp_path: Path) -> None:
    t = step_s * np.arange(1200)
    v = speed(t)
    h = 300 + 0.02 * np.cumsum(v) * step_s + np.random.default_rng(0).normal(0, noise_m, 1200)
    assert zero_changes(t, h, np.zeros(0)) == []
    rows = {"t": t.round(3), "v": (3.6 * v).round(2), "gas": 0 * t, "brake": 0 * t}
    rows["h"] = np.round(np.where(np.arange(1200) < 500, h, h + by_m), 1)
    meaning = with_channels(elevation={"column": "h", "unit": "m"})
    (r,) = import_table(write_csv(tmp_path / "d.csv", rows), meaning, tmp_path / "bag").recordings
    assert np.abs(r.channels["grade"] - 0.02).max() < 0.01
    (said,) = [note for note in r.notes if "changes its zero by" in note]
    assert float(said.split("by ")[1].split()[0]) == pytest.approx(by_m, abs=4 * noise_m + 0.3)


def test_hills_and_noise_change_no_zero() -> None:
    t = np.arange(600.0)
    h = 200 + 8 * np.sin(t / 20) + np.cumsum(np.random.default_rng(1).normal(0, 1.0, 600))
    assert zero_changes(t, h, np.zeros(0)) == []


@pytest.mark.parametrize("seconds", [10, 60])
def test_zero_while_a_pose_moves_is_no_speed(seconds: int) -> None:
    t = 0.1 * np.arange(10 * seconds)
    x = np.cumsum(speed(t)) * 0.1
    assert moving_at_zero(t, 0 * t, [Places(t, x, 0 * t)]).all()
    assert not moving_at_zero(t, 0 * t, [Places(t, 0 * t + 5.0, 0 * t)]).any()


@pytest.mark.parametrize(
    ("second", "what"),
    [(lambda v: v / 1.6093, "km/h to mph"), (lambda v: v / 3.6, "km/h to m/s"), (lambda v: v, "")],
)
def test_a_unit_that_changes_within_is_seen(second: Callable[[Array], Array], what: str) -> None:
    kmh = np.round(3.6 * V, 1)
    said = changed_unit(T, np.where(T < 60, kmh, np.round(second(kmh), 1)))
    assert what in said and bool(said) == bool(what)


def test_lost_decimal_points_are_refused_and_no_factor_is_advised(tmp_path: Path) -> None:
    columns = drive(1200)
    columns["v"] = [f"{v:.2f}".rstrip("0").rstrip(".").replace(".", "") for v in columns["v"]]
    path = write_csv(tmp_path / "d.csv", columns)
    for scale in (1.0, 0.01):
        meaning = with_channels(speed={"column": "v", "unit": "km/h", "scale": scale})
        with pytest.raises(InputError, match="ten times their neighbours") as error:
            import_table(path, meaning, tmp_path / "bag")
        assert "scale" not in str(error.value)
    assert lost_decimals(V) == "" and lost_decimals(np.random.default_rng(0).uniform(0, 30, 1000)) == ""
