"""Channels held against one another: what is set aside, said and refused, and that the cures cure."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from csv_tables import COLUMNS, drive, speed, with_channels, write_csv
from scipy.ndimage import gaussian_filter1d

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings import Recording, import_table, suggest_columns
from deeptruck_model.recordings.consistency import accelerometer, impossible, sensors
from deeptruck_model.recordings.recording import FROM_SPEED

ACCELERATION = {"column": "a", "unit": "m/s^2"}
INTERFACE = TruckInterface("truck", "percent", "percent")
T = 0.1 * np.arange(3000)
V, A = speed(T), np.gradient(speed(T), T)


def recording(**channels: Any) -> Recording:
    known = {"speed": V, "acceleration": A, **channels}
    return Recording("drive", 0.1, {c: np.asarray(x, float) for c, x in known.items()}, INTERFACE)


def said(**channels: Any) -> list[str]:
    return [doubt.says for doubt in sensors.doubts([recording(**channels)])]


def test_a_sound_drive_is_not_doubted() -> None:
    noise = np.random.default_rng(0).normal(0, 0.1, 3000)
    assert said(acceleration=A + noise) == []


@pytest.mark.parametrize(
    ("factor", "wrong"),
    [(-1.0, "has the wrong sign"), (9.80665, "m/s^2 read as g"), (0.102, "g read as m/s^2")],
)
def test_sign_and_scale_of_an_accelerometer(factor: float, wrong: str) -> None:
    (line,) = said(acceleration=factor * A)
    assert wrong in line
    with pytest.raises(InputError, match="derivative of speed"):
        sensors.refuse([recording(acceleration=factor * A)])


def test_another_axis_stands_still_or_does_not_follow() -> None:
    (line,) = said(acceleration=np.full(3000, 0.05))
    assert "stands still at 0.05 m/s²" in line
    sideways = said(acceleration=np.sin(0.1 * np.arange(3000) / 1.3))
    assert len(sideways) == 1 and "does not follow the speed" in sideways[0]


def test_a_doubt_names_the_drives_that_show_it() -> None:
    odd, sound = recording(acceleration=-A), [replace(recording(), name=name) for name in "abc"]
    (doubt,) = sensors.doubts([odd])
    assert sensors.of_inputs([odd], ("acceleration",)) == [doubt.says]
    (alone,) = sensors.of_inputs([*sound, replace(odd, name="odd")], ("acceleration",))
    assert alone.startswith("odd: ") and sensors.of_inputs([odd], ("speed",)) == []


def test_tilt_and_gravity_are_found_by_the_grade() -> None:
    grade, tilt = 0.04 * np.sin(T / 23), np.radians(2.0)
    felt = A * np.cos(tilt) + 9.80665 * np.sin(np.arctan(grade) + tilt)
    found = accelerometer.accelerometer([recording(acceleration=felt, grade=grade)])
    assert found.gravity == pytest.approx(1.0, abs=0.02)
    assert np.degrees(np.arcsin(found.offset / 9.80665)) == pytest.approx(2.0, abs=0.05)
    assert found.slope == pytest.approx(1.0, abs=0.02)
    (line,) = said(specific_force=felt, grade=grade)
    assert "specific_force is +0.34 m/s² off" in line and "tilted by 2.0 degrees" in line
    kind = accelerometer.felt([recording(acceleration=felt, grade=grade)], "acceleration")
    assert kind is not None and kind.channel == "specific_force" and "1.00 g times the recorded" in kind.by


def test_a_clipped_accelerometer_is_reported() -> None:
    felt = np.clip(A, -0.7, 0.7)
    assert any("its range is too small" in line for line in said(specific_force=felt))
    (line,) = said(specific_force=np.clip(felt, -0.25, 0.25))  # which makes it half of dv/dt
    assert "its range is too small" in line


def test_a_filtered_or_turned_accelerometer_is_reported() -> None:
    t = 0.1 * np.arange(6000)
    v = 15.0 + 8.0 * np.sin(t / 27.0) + 2.0 * np.sin(t / 3.0)
    rate = np.gradient(v, t)
    felt, late = rate + 0.2 * np.sin(t / 31.0), np.zeros(6000)
    for k in range(1, 6000):
        late[k] = late[k - 1] + (felt[k] - late[k - 1]) * 0.1 / 1.5

    def reads(x: Any) -> list[str]:
        return said(speed=v, acceleration=rate, specific_force=x)

    assert reads(felt) == []
    assert any("behind the derivative of speed, as by a filter" in line for line in reads(late))
    assert any(
        "a filter has taken what is slow" in line for line in reads(felt - gaussian_filter1d(felt, 60))
    )
    assert any("as of a sensor that is turned" in line for line in reads(0.8 * felt))


def test_an_acceleration_that_was_derived_is_no_accelerometer() -> None:
    late = recording(acceleration=np.roll(recording().channels["acceleration"], 27))
    assert any("behind the derivative" in doubt.says for doubt in sensors.doubts([late]))
    assert sensors.doubts([replace(late, notes=(FROM_SPEED,))]) == []


def test_speed_is_held_against_places() -> None:
    north = np.cumsum(V) * 0.1 / 111_195.0
    assert said(latitude=50 + north, longitude=np.full(3000, 8.0)) == []
    for half in (False, True):  # in steps of 0.001 degrees, 111 m, positions give no speed
        coarse = np.round(50 + (0.5 if half else 1.0) * north, 3)
        assert said(latitude=coarse, longitude=np.full(3000, 8.0)) == []
    lines = said(speed=1.609344 * V, acceleration=1.609344 * A,
                   latitude=50 + north, longitude=np.full(3000, 8.0))  # fmt: skip
    assert "km/h read as mph" in lines[0]


def test_speed_is_held_against_a_distance_of_a_user() -> None:
    km = 52_000.0 + np.cumsum(V) * 1e-4
    assert said(odometer_km=km, distance_to_leader_m=1000.0 * km) == []
    lines = said(speed=1.609344 * V, acceleration=1.609344 * A, odometer_km=km)
    assert "km/h read as mph" in lines[0] and "leave 'odometer_km' out" in lines[0]


def test_engine_speed_turns_in_ratios_of_gears() -> None:
    ratios = np.where(V < 12.0, 14.0, np.where(V < 18.0, 9.0, 6.0))
    assert said(engine_speed=ratios * V) == []
    lines = said(speed=3.6 * V, acceleration=3.6 * A, engine_speed=6.0 * V)
    assert "too few for any gear: give speed and" in lines[0]
    drifting = 6.0 * V * np.exp(np.linspace(0.0, 2.0, 3000))
    assert "another clock (late_s)" in said(engine_speed=drifting)[0]


def test_minus_one_percent_is_no_value_where_it_is_jumped_to() -> None:
    t = 0.1 * np.arange(100)
    command = np.where(t < 5.0, 40.0, 0.0)
    command[30:33] = -1.0
    ((reason, found),) = impossible.impossible("engine_command", "percent", t, command)
    assert "not available" in reason and list(np.flatnonzero(found)) == [30, 31, 32]
    retarding = np.where(t > 8.0, -10.0 * (t - 8.0) - 1.0, command)
    assert not list(impossible.impossible("engine_command", "percent", t, retarding))


def test_grade_is_held_against_height() -> None:
    grade = 0.04 * np.sin(T / 23)
    height = 200 + np.cumsum(grade * V) * 0.1
    assert said(grade=grade, elevation=height) == []
    assert "scale: -1" in said(grade=-grade, elevation=height)[0]
    assert "ratio, percent, deg" in said(grade=0.01 * grade, elevation=height)[0]


def test_heights_in_steps_refute_no_grade_of_a_flat_road() -> None:
    way = np.cumsum(V) * 0.1
    height, grade = np.round(3.0 * np.sin(way / 400.0)), 0.002 * np.sin(T / 3)
    assert said(elevation=height, grade=grade) == []


def test_pedals_that_are_swapped_pressed_together_or_in_bar() -> None:
    gas, brake = np.clip(40 * A, 0, 90), np.clip(-40 * A, 0, 90)
    assert said(engine_command=gas, brake_command=brake) == []
    assert "are the two swapped?" in said(engine_command=brake, brake_command=gas)[0]
    (turned,) = said(engine_command=gas, brake_command=brake, acceleration=-A)
    assert "acceleration has the wrong sign" in turned
    assert "are both above half" in said(engine_command=gas, brake_command=gas)[0]
    small = said(engine_command=gas / 90, brake_command=brake / 90)
    assert len(small) == 2 and all("is it a ratio?" in line for line in small)
    bar = Recording("drive", 0.1, recording(engine_command=gas, brake_command=brake).channels,
                    TruckInterface("truck", "percent", "bar"))  # fmt: skip
    assert any("is it in percent?" in doubt.says for doubt in sensors.doubts([bar]))


def test_speed_that_no_truck_drives() -> None:
    assert any("and trucks drive at most 130 km/h" in line for line in said(speed=np.full(3000, 40.0)))


@pytest.mark.parametrize(("code", "count"), [(-1.0, 60), (0.0, 18)])
def test_drop_outs_of_speed_are_set_aside_and_counted(tmp_path: Path, code: float, count: int) -> None:
    columns = drive()
    for start in (180, 380, 580):
        columns["v"][start : start + count // 3] = code
    done = import_table(write_csv(tmp_path / "t.csv", columns), COLUMNS, tmp_path / "bag")
    values = np.concatenate([r.channels["speed"] for r in done.recordings])
    gained = np.concatenate([r.channels["acceleration"] for r in done.recordings])
    assert np.nanmin(values) > 7.0 and np.nanmax(np.abs(gained)) < 1.5
    account = done.recordings[0].account
    assert account is not None and account.balanced
    assert account.channels["speed"].aside[impossible.DROPPED].count == count
    derived = account.channels["acceleration"]
    assert derived.read == sum(map(len, done.recordings)) and derived.used == int(np.isfinite(gained).sum())


def test_a_standstill_is_no_drop_out() -> None:
    t = 0.1 * np.arange(400)
    v = np.clip(20 - 2.0 * t, 0, None)
    assert list(impossible.impossible("speed", "m/s", t, v)) == []
    v[50:60] = 0.0
    ((reason, these),) = impossible.impossible("speed", "m/s", t, v)
    assert reason == impossible.DROPPED and these.sum() == 10


def test_a_standstill_behind_a_cut_is_no_drop_out() -> None:
    """A log of several drives without their gaps, which ends standing."""
    t = np.arange(400.0)
    v = np.where(t < 300, 20.0 + np.sin(t / 9), 0.0)
    assert list(impossible.impossible("speed", "m/s", t, v)) == []
    assert list(impossible.impossible("speed", "m/s", t, v[::-1])) == []


def test_places_and_heights_before_a_fix() -> None:
    t = 0.1 * np.arange(100)
    for channel, value in (("latitude", 49.0), ("longitude", -8.0), ("elevation", 300.0)):
        values = np.where(t < 2.0, 0.0, value + 1e-5 * t)
        ((_, these),) = impossible.impossible(channel, "", t, values)
        assert these.sum() == 20 and these[:20].all()


def test_codes_for_not_available_are_no_commands(tmp_path: Path) -> None:
    columns = drive()
    for name, code in (("gas", 102), ("brake", 102)):
        columns[name][200:260] = code
    columns |= {"demand": np.where(columns["gas"] == 102, 130, columns["gas"])}
    for engine in ("gas", "demand"):
        meaning = with_channels(engine_command={"column": engine, "unit": "percent"})
        done = import_table(write_csv(tmp_path / f"{engine}.csv", columns), meaning, tmp_path / engine)
        (r,) = done.recordings
        for command in ("engine_command", "brake_command"):
            assert np.isnan(r.channels[command]).sum() == 60 and np.nanmax(r.channels[command]) < 91
            assert r.account is not None and r.account.channels[command].left_out == 60


def test_what_is_proposed_is_turned_and_a_lateral_sensor_is_not_proposed(tmp_path: Path) -> None:
    columns = drive()
    headers = {"Time (s)": columns["t"], "Speed (km/h)": columns["v"], "LatAcc (g)": np.sin(columns["t"]),
               "Acc (m/s2)": -columns["a"], "Acceleration 2 (m/s2)": np.cos(columns["t"])}  # fmt: skip
    found = suggest_columns(write_csv(tmp_path / "t.csv", headers))
    one = found.taken("acceleration")
    assert one is not None and one.field.path == "Acc (m/s2)" and "scale: -1" in one.line
    (other,) = [c for c in found.candidates["acceleration"] if c is not one]
    assert other.field.path == "Acceleration 2 (m/s2)" and "does not follow the speed" in other.needs
    (tmp_path / "columns.yaml").write_text(found.text())
    (r,) = import_table(tmp_path / "t.csv", tmp_path / "columns.yaml", tmp_path / "bag").recordings
    np.testing.assert_allclose(r.channels["acceleration"], columns["a"])


def test_the_tilt_of_an_accelerometer_is_cured_by_its_offset(tmp_path: Path) -> None:
    columns = drive()
    path = write_csv(tmp_path / "t.csv", {**columns, "a": columns["a"] + 0.5})
    (r,) = import_table(path, with_channels(acceleration=ACCELERATION), tmp_path / "a").recordings
    assert r.account is not None and any("correct it by 'offset'" in line for line in r.account.remarks)
    cured = with_channels(acceleration={**ACCELERATION, "offset": -0.5})
    (r,) = import_table(path, cured, tmp_path / "b").recordings
    assert r.account is not None and r.account.remarks == []


@pytest.mark.parametrize("every", [2, 4])
def test_a_second_sender_in_the_column_of_speed_is_refused(every: int, tmp_path: Path) -> None:
    rows = drive()
    late = np.round(3.6 * 1.01 * speed(rows["t"] - 0.8), 3)
    rows["v"] = np.where(np.arange(600) % every == 1, late, rows["v"])
    with pytest.raises(InputError, match=f"every {every}. sample"):
        import_table(write_csv(tmp_path / "d.csv", rows), COLUMNS, tmp_path / "bag")


def test_a_coarse_speed_that_flickers_is_of_one_sender() -> None:
    flickering = np.round(V + 0.5 * (np.arange(3000) % 2))
    assert not impossible.senders(flickering)
