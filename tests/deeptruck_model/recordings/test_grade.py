"""The slope of the road from an accelerometer, from heights, and which column is an accelerometer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from csv_tables import HILLY, hilly, write_csv

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings import grade_from_elevation, import_table, read, write_bag
from deeptruck_model.recordings.grade import felt_slope, with_slope
from deeptruck_model.recordings.recording import Recording

DT, N = 0.1, 12_000
G = 9.80665


def drive(hills: float = 0.03, bias: float = 0.06, pitch: float = 0.03, seed: int = 0) -> dict[str, Array]:
    """Twenty minutes over hills, with an accelerometer of this bias and pitch."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(N)
    speed = 15.0 + 5.0 * np.sin(t / 19) + 2.0 * np.sin(t / 5.3)
    rate = np.gradient(speed, DT)
    distance = np.cumsum(speed) * DT
    slope = hills * (np.sin(distance / 300) + 0.5 * np.sin(distance / 137 + 1.0))
    force = (1 + pitch) * rate + G * np.sin(np.arctan(slope)) + bias + rng.normal(0.0, 0.05, N)
    elevation = np.round(300.0 + np.cumsum(slope * speed) * DT)
    return {"time": t, "speed": speed + rng.normal(0.0, 0.005, N), "force": force, "slope": slope,
            "elevation": elevation, "rate": rate, "torque": 100.0 + 50 * rate}  # fmt: skip


def recording(*names: str, **changed: float) -> tuple[Recording, Array]:
    d = drive(**changed)
    known = {"specific_force": d["force"], "elevation": d["elevation"]}
    channels = {"speed": d["speed"], "acceleration": d["rate"], "engine_command": d["torque"]}
    channels |= {name: known[name] for name in names}
    interface = TruckInterface("mine", "N m", None, grade=False, fuel=False)
    return Recording("drive", DT, channels, interface), d["slope"]


def test_the_slope_is_what_the_accelerometer_reads_beyond_the_speed() -> None:
    r, slope = recording("specific_force")
    found = felt_slope([r])
    off = found.of[0].grade - slope
    assert np.corrcoef(found.of[0].grade, slope)[0, 1] > 0.98
    assert np.std(off) < 0.004
    assert np.mean(found.pitch) == pytest.approx(0.03, abs=0.005)


def test_a_turned_accelerometer_gives_the_slope_by_its_share_of_the_speed() -> None:
    r, slope = recording("specific_force")
    r.channels["specific_force"] *= np.cos(np.radians(30.0))
    found = felt_slope([r])
    assert np.polyfit(slope, found.of[0].grade, 1)[0] == pytest.approx(1.0, abs=0.06)


def test_elevation_settles_the_bias() -> None:
    with_heights, slope = recording("specific_force", "elevation", bias=0.2)
    without, _ = recording("specific_force", bias=0.2)
    fused, alone = felt_slope([with_heights]), felt_slope([without])
    assert fused is not None and alone is not None
    assert abs(np.mean(fused.of[0].grade - slope)) < 0.002
    assert abs(fused.bias - 0.2) < 0.02
    assert np.mean(fused.of[0].sd) < np.mean(alone.of[0].sd)
    assert np.abs((alone.of[0].grade - slope) / alone.of[0].sd).mean() < 2.0


def test_the_stated_error_is_that_of_the_slope() -> None:
    r, slope = recording("specific_force", "elevation")
    found = felt_slope([r])
    off = (found.of[0].grade - slope) / found.of[0].sd
    assert 0.3 < np.sqrt(np.mean(off**2)) < 2.0


def test_a_source_that_is_not_there_is_refused_in_one_line() -> None:
    r, _ = recording("specific_force")
    with pytest.raises(InputError, match="slope_from: elevation needs elevation"):
        with_slope([r], "elevation")
    (one,) = with_slope([r], "accelerometer")
    assert one.interface.grade and "derived from the accelerometer" in one.notes[-1]


def table(path: Path, d: dict[str, Array], *names: str) -> Path:
    """A CSV with some columns of a drive."""
    rows = [",".join(names), *(",".join(f"{d[n][k]:.6g}" for n in names) for k in range(N))]
    path.write_text("\n".join(rows) + "\n")
    return path


def columns(**channels: str) -> dict[str, object]:
    units = {"speed": "m/s", "engine_command": "N m", "elevation": "m", "grade": "ratio"}
    return {
        "time": {"column": "time", "unit": "s"},
        "vehicle": "car",
        "channels": {c: {"column": n, "unit": units.get(c, "m/s^2")} for c, n in channels.items()},
    }


def test_an_accelerometer_called_acceleration_is_told_by_the_data(tmp_path: Path) -> None:
    d = drive(bias=0.02, pitch=0.0)
    log = table(tmp_path / "log.csv", d, "time", "speed", "torque", "force")
    meaning = columns(speed="speed", engine_command="torque", acceleration="force")
    (r,) = import_table(log, meaning, tmp_path / "bag").recordings
    assert "specific_force" in r.channels and "grade" in r.channels
    assert any("acceleration is taken as specific_force" in note for note in r.notes)
    assert np.corrcoef(r.channels["grade"], d["slope"])[0, 1] > 0.97
    assert np.std(r.channels["acceleration"][10:-10] - d["rate"][10:-10]) < 0.1


def test_a_derivative_called_specific_force_is_told_by_the_slope(tmp_path: Path) -> None:
    d = drive()
    d["noisy"] = d["rate"] + np.random.default_rng(1).normal(0.0, 0.03, N)
    log = table(tmp_path / "log.csv", d, "time", "speed", "torque", "noisy", "slope")
    meaning = columns(speed="speed", engine_command="torque", specific_force="noisy", grade="slope")
    (r,) = import_table(log, meaning, tmp_path / "bag").recordings
    assert "specific_force" not in r.channels
    assert any("specific_force is taken as acceleration" in note for note in r.notes)


def test_a_flat_drive_asks_in_one_line(tmp_path: Path) -> None:
    d = drive(hills=0.0012, bias=0.0, pitch=0.0)
    log = table(tmp_path / "log.csv", d, "time", "speed", "torque", "force")
    meaning = columns(speed="speed", engine_command="torque", acceleration="force")
    (r,) = import_table(log, meaning, tmp_path / "bag").recordings
    assert "specific_force" not in r.channels
    assert any("if a sensor measured it, call it specific_force" in note for note in r.notes)


def test_bags_keep_the_channel_and_older_ones_are_mended(tmp_path: Path) -> None:
    r, _ = recording("specific_force")
    write_bag(tmp_path / "new", [r], interface=r.interface)
    (back,) = read(tmp_path / "new")
    np.testing.assert_array_equal(back.channels["specific_force"], r.channels["specific_force"])
    force = r.channels["specific_force"]
    channels = {"speed": r.channels["speed"], "engine_command": r.channels["engine_command"]}
    old = Recording("old", DT, {**channels, "acceleration": force}, r.interface, 0.0,
                    ("imported from the table log.csv",))  # fmt: skip
    write_bag(tmp_path / "old", [old], interface=r.interface)
    (mended,) = read(tmp_path / "old")
    np.testing.assert_array_equal(mended.channels["specific_force"], force)


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
