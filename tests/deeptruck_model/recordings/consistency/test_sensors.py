"""Channels held against one another: what is doubted, in a word, and what is not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from csv_tables import drive, speed, write_csv
from scipy.ndimage import gaussian_filter1d

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings import Recording, import_table, suggest_columns
from deeptruck_model.recordings.consistency import accelerometer, sensors
from deeptruck_model.recordings.recording import FROM_SPEED

INTERFACE = TruckInterface("truck", "percent", "percent")
T = 0.1 * np.arange(3000)
V, A = speed(T), np.gradient(speed(T), T)
GRADE, TILT = 0.04 * np.sin(T / 23), np.radians(2.0)
HEIGHT = 200 + np.cumsum(GRADE * V) * 0.1
FELT = A * np.cos(TILT) + 9.80665 * np.sin(np.arctan(GRADE) + TILT)
NORTH, EAST = 50 + np.cumsum(V) * 0.1 / 111_195.0, np.full(3000, 8.0)
KM = 52_000.0 + np.cumsum(V) * 1e-4
FLAT = np.round(3.0 * np.sin(np.cumsum(V) * 0.1 / 400.0))  # heights in steps of a metre
NOISE = np.random.default_rng(0).normal(0, 1, 3000)
GAS, BRAKE = np.clip(40 * A, 0, 90), np.clip(-40 * A, 0, 90)
FAST = {"speed": 1.609344 * V, "acceleration": 1.609344 * A}
# of waves of a few seconds and of minutes, which filters part
LONG_T = 0.1 * np.arange(6000)
LONG_V = 15.0 + 8.0 * np.sin(LONG_T / 27.0) + 2.0 * np.sin(LONG_T / 3.0)
LONG_A = np.gradient(LONG_V, LONG_T)
SWAYS = {"speed": LONG_V, "acceleration": LONG_A}
LONG_FELT = LONG_A + 0.2 * np.sin(LONG_T / 31.0)
LATE = np.zeros(6000)
for _k in range(1, 6000):
    LATE[_k] = LATE[_k - 1] + (LONG_FELT[_k] - LATE[_k - 1]) * 0.1 / 1.5


def recording(**channels: Any) -> Recording:
    known = {"speed": V, "acceleration": A, **channels}
    return Recording("drive", 0.1, {c: np.asarray(x, float) for c, x in known.items()}, INTERFACE)


def said(**channels: Any) -> list[str]:
    return [doubt.says for doubt in sensors.doubts([recording(**channels)])]


DOUBTED: dict[str, tuple[dict[str, Any],
    tuple[str, ...]]] = {  # channels, and words of the doubts; none: sound
    "sound, with noise": ({"acceleration": A + 0.1 * NOISE}, ()),
    "backwards": ({"acceleration": -A}, ("has the wrong sign",)),
    "m/s^2 as g": ({"acceleration": 9.80665 * A}, ("m/s^2 read as g",)),
    "g as m/s^2": ({"acceleration": 0.102 * A}, ("g read as m/s^2",)),
    "stands still": ({"acceleration": 0 * T + 0.05}, ("stands still at 0.05 m/s²",)),
    "another axis": ({"acceleration": np.sin(T / 1.3)}, ("does not follow the speed",)),
    "tilted": ({"specific_force": FELT, "grade": GRADE}, ("specific_force is +0.34 m/s² off",)),
    "clipped": ({"specific_force": np.clip(A, -0.7, 0.7)}, ("its range is too small",)),
    "clipped to half": ({"specific_force": np.clip(A, -0.25, 0.25)}, ("its range is too small",)),
    "felt": ({**SWAYS, "specific_force": LONG_FELT}, ()),
    "low-passed": ({**SWAYS, "specific_force": LATE}, ("behind the derivative of speed, as by a filter",)),
    "high-passed": ({**SWAYS, "specific_force": LONG_FELT - gaussian_filter1d(LONG_FELT, 60)},
                    ("a filter has taken what is slow",)),
    "turned": ({**SWAYS, "specific_force": 0.8 * LONG_FELT}, ("as of a sensor that is turned",)),
    "late": ({"acceleration": np.roll(A, 27)}, ("behind the derivative",)),
    "places": ({"latitude": NORTH, "longitude": EAST}, ()),
    "places in steps of 111 m": ({"latitude": NORTH.round(3), "longitude": EAST}, ()),
    "half the way in steps of 111 m": ({"latitude": np.round(50 + 0.5 * (NORTH - 50), 3), "longitude": EAST},
        ()),
    "places and mph": ({**FAST, "latitude": NORTH, "longitude": EAST}, ("km/h read as mph",)),
    "an odometer": ({"odometer_km": KM, "distance_to_leader_m": 1000.0 * KM}, ()),
    "an odometer and mph": ({**FAST, "odometer_km": KM}, ("leave 'odometer_km' out",)),
    "gears": ({"engine_speed": np.where(V < 12.0, 14.0, np.where(V < 18.0, 9.0, 6.0)) * V}, ()),
    "km/h as m/s": ({"speed": 3.6 * V, "acceleration": 3.6 * A, "engine_speed": 6.0 * V},
        ("too few for any gear",)),
    "no gears": ({"engine_speed": 6.0 * V * np.exp(np.linspace(0.0, 2.0, 3000))},
        ("another clock (late_s)",)),
    "a grade": ({"grade": GRADE, "elevation": HEIGHT}, ()),
    "a grade downhill": ({"grade": -GRADE, "elevation": HEIGHT}, ("scale: -1",)),
    "a grade of a hundredth": ({"grade": 0.01 * GRADE, "elevation": HEIGHT}, ("ratio, percent, deg",)),
    "a grade on a flat road": ({"grade": 0.002 * np.sin(T / 3), "elevation": FLAT}, ()),
    "a grade that is off": ({"grade": GRADE + 0.03, "elevation": HEIGHT}, ("correct it by 'offset', or",)),
    "a tilt that is no grade": ({"grade": 0.05 + 0.002 * NOISE, "elevation": 300 + 0.02 * np.cumsum(V) * 0.1},
        ("that it follows them is not seen: leave it out",)),
    "pedals": ({"engine_command": GAS, "brake_command": BRAKE}, ()),
    "pedals swapped": ({"engine_command": BRAKE, "brake_command": GAS}, ("are the two swapped?",)),
    "pedals, accelerometer backwards": ({"engine_command": GAS, "brake_command": BRAKE, "acceleration": -A},
                                        ("acceleration has the wrong sign",)),
    "one pedal twice": ({"engine_command": GAS, "brake_command": GAS}, ("are both above half",)),
    "pedals of ratios": ({"engine_command": GAS / 90, "brake_command": BRAKE / 90},
                         ("engine_command reaches 0", "brake_command reaches")),
    "144 km/h": ({"speed": np.full(3000, 40.0), "acceleration": 0 * T},
        ("and trucks drive at most 130 km/h",)),
}  # fmt: skip


@pytest.mark.parametrize("name", DOUBTED)
def test_what_is_doubted(name: str) -> None:
    channels, words = DOUBTED[name]
    found = said(**channels)
    for word in words:
        assert any(word in line for line in found), found
    assert bool(found) == bool(words), found


def test_what_is_wrong_is_refused() -> None:
    for name in ("backwards", "m/s^2 as g", "g as m/s^2", "stands still", "another axis"):
        with pytest.raises(InputError, match="'drive': acceleration"):
            sensors.refuse([recording(**DOUBTED[name][0])])


def test_brakes_in_bar_have_the_pressure_of_air_brakes() -> None:
    bar = replace(
        recording(engine_command=GAS, brake_command=BRAKE),
        interface=TruckInterface("truck", "percent", "bar"),
    )
    assert any("is it in percent?" in doubt.says for doubt in sensors.doubts([bar]))


def test_a_doubt_names_the_drives_that_show_it() -> None:
    odd, sound = recording(acceleration=-A), [replace(recording(), name=name) for name in "abc"]
    (doubt,) = sensors.doubts([odd])
    assert sensors.of_inputs([odd], ("acceleration",)) == [doubt.says]
    (alone,) = sensors.of_inputs([*sound, replace(odd, name="odd")], ("acceleration",))
    assert alone.startswith("odd: ") and sensors.of_inputs([odd], ("speed",)) == []


def test_tilt_and_gravity_are_found_by_the_grade() -> None:
    tilted = [recording(acceleration=FELT, grade=GRADE)]
    found = accelerometer.accelerometer(tilted)
    assert found is not None and found.gravity == pytest.approx(1.0, abs=0.02)
    assert np.degrees(np.arcsin(found.offset / 9.80665)) == pytest.approx(2.0, abs=0.05)
    assert found.slope == pytest.approx(1.0, abs=0.02)
    kind = accelerometer.felt(tilted, "acceleration")
    assert kind is not None and kind.channel == "specific_force"


def test_an_acceleration_that_was_derived_is_no_accelerometer() -> None:
    assert sensors.doubts([replace(recording(acceleration=np.roll(A, 27)), notes=(FROM_SPEED,))]) == []


def test_what_is_proposed_is_turned_and_a_lateral_sensor_is_not_proposed(tmp_path: Path) -> None:
    columns = drive()
    headers = {"Time (s)": columns["t"], "Speed (km/h)": columns["v"], "LatAcc (g)": np.sin(columns["t"]),
               "Acc (m/s2)": -columns["a"], "Acceleration 2 (m/s2)": np.cos(columns["t"])}  # fmt: skip
    found = suggest_columns(write_csv(tmp_path / "t.csv", headers))
    one = found.taken("acceleration")
    assert one is not None and one.field.path == "Acc (m/s2)" and "scale: -1" in one.line
    (other,) = [c for c in found.candidates["acceleration"] if c is not one]
    assert other.field.path == "Acceleration 2 (m/s2)" and "does not follow the speed" in other.needs
    (r,) = import_table(tmp_path / "t.csv", yaml.safe_load(found.text()), tmp_path / "bag").recordings
    np.testing.assert_allclose(r.channels["acceleration"], columns["a"])


def test_a_slope_that_slows_the_truck_is_proposed_and_the_pitch_of_its_body_is_not(tmp_path: Path) -> None:
    d, noise = drive(6000), np.random.default_rng(0).normal(0, 1, 6000)
    road = 0.03 * np.sin(2 * np.pi * d["t"] / 90)
    v = 15 + np.cumsum(d["a"] - 0.3 * 9.81 * road) * 0.1
    columns = {"Time (s)": d["t"], "Speed (km/h)": np.round(3.6 * v, 2), "Throttle (%)": d["gas"]}
    columns["Altitude (m)"] = np.round(300 + np.cumsum(np.sin(np.arctan(road)) * v) * 0.1, 1)
    for name, grade, taken in (
        ("slope (%)", 100 * road + 0.2 * noise, True),
        ("Pitch (deg)", -0.6 * np.gradient(v, 0.1) + 0.02 * noise, False),
    ):
        found = suggest_columns(write_csv(tmp_path / "d.csv", {**columns, name: np.round(grade, 3)}))
        assert (found.taken("grade") is not None) == taken, found.text()


def test_one_component_of_an_acceleration_is_doubted(tmp_path: Path) -> None:
    d = drive(6000)
    v = speed(d["t"])
    north, east = v * np.cos(0.6), v * np.sin(0.6)
    columns = {"t (s)": d["t"], "vx [m/s]": north.round(3), "vy [m/s]": east.round(3),
               "ax [m/s^2]": np.gradient(north, d["t"]).round(3)}  # fmt: skip
    found = suggest_columns(write_csv(tmp_path / "d.csv", columns))
    assert any("acceleration is 0.83 times" in doubt for doubt in found.doubts)
