from __future__ import annotations

from pathlib import Path

import numpy as np
from csv_tables import HILLY, hilly, write_csv

from deeptruck_model.recordings import grade_from_elevation, import_table, read


def test_a_constant_slope_is_found_to_its_ends() -> None:
    speed = np.full(2000, 20.0)
    elevation = 100 + 0.03 * np.arange(2000) * 2.0
    np.testing.assert_allclose(grade_from_elevation(speed, elevation, 0.1), 0.03, atol=1e-9)


def test_a_wavy_road_with_steps_of_a_metre() -> None:
    """Elevation as TUM's car logs it, in whole metres."""
    distance = np.arange(20_000) * 1.5
    true = 0.03 * np.sin(distance / 600)
    elevation = np.round(-0.03 * 600 * np.cos(distance / 600))
    found = grade_from_elevation(np.full(20_000, 15.0), elevation, 0.1)
    assert np.sqrt(np.mean((found - true) ** 2)) < 0.005


def test_standing_still_with_a_noisy_barometer_adds_no_slope() -> None:
    rng = np.random.default_rng(0)
    speed = np.concatenate([np.full(600, 10.0), np.zeros(3000), np.full(600, 10.0)])
    elevation = 0.02 * np.cumsum(speed) * 0.1 + np.where(speed == 0, rng.normal(0, 2.0, len(speed)), 0.0)
    found = grade_from_elevation(speed, elevation, 0.1)
    assert np.abs(found - 0.02).max() < 0.005


def test_too_little_road_gives_no_grade() -> None:
    assert np.isnan(grade_from_elevation(np.full(10, 1.0), np.arange(10.0), 0.1)).all()
    assert np.isnan(grade_from_elevation(np.full(100, 20.0), np.full(100, np.nan), 0.1)).all()


def test_a_stretch_without_elevation_gives_none_there() -> None:
    speed, elevation = np.full(6000, 20.0), 0.01 * np.arange(6000) * 2.0
    elevation[2000:4000] = np.nan
    found = grade_from_elevation(speed, elevation, 0.1)
    assert np.isnan(found[2500:3500]).all()
    np.testing.assert_allclose(found[[100, 1900, 4100, 5900]], 0.01, atol=1e-9)


def test_grade_comes_from_elevation_where_it_is_not_given(tmp_path: Path) -> None:
    import_table(write_csv(tmp_path / "drive.csv", hilly()), HILLY, tmp_path / "bag")
    (recording,) = read(tmp_path / "bag")
    np.testing.assert_allclose(recording.channels["grade"], 0.02, atol=1e-9)
    assert recording.interface.grade
    assert any("grade derived from elevation" in note for note in recording.notes)
