"""A grade or speed that does not follow what the other channels say, and factors tried on them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from csv_tables import drive, speed, write_csv

from deeptruck_core.errors import InputError
from deeptruck_model.recordings import import_table, suggest_columns

D = drive(6000)
T, V = D["t"], speed(D["t"])
NOISE = np.random.default_rng(0).normal(0, 1, 6000)
ROAD = 0.03 * np.sin(2 * np.pi * T / 90)
COLUMNS = {
    "Time (s)": T, "Speed (km/h)": D["v"], "Throttle (%)": D["gas"], "Brake (%)": D["brake"],
}  # fmt: skip


def height(slope: Any) -> Any:
    return np.round(300 + np.cumsum(np.sin(np.arctan(slope)) * V) * 0.1 + 0.3 * NOISE, 1)


def proposed(columns: dict[str, Any], folder: Path) -> tuple[Any, str]:
    text = suggest_columns(write_csv(folder / "d.csv", columns)).text()
    return yaml.safe_load(text)["channels"], text


@pytest.mark.parametrize(
    ("grade", "slope", "says"),
    [
        ({"Pitch (deg)": -0.6 * D["a"] + 0.02 * NOISE}, 0.02 + 0 * T, "as the pitch of the body"),
        ({"pitch (deg)": 0.8 * D["a"] + 5.0 + 0.05 * NOISE}, ROAD, "as the pitch of the body"),
        ({"slope (%)": 3 * np.sin(2 * np.pi * T / 47)}, ROAD, "does not follow what height"),
    ],
)  # fmt: skip
def test_what_is_no_slope_of_the_road_is_not_taken(
    grade: dict[str, Any], slope: Any, says: str, tmp_path: Path
) -> None:
    (name,) = grade
    columns = {**COLUMNS, name: np.round(grade[name], 3), "Altitude (m)": height(slope)}
    channels, text = proposed(columns, tmp_path)
    assert "grade" not in channels and says in text
    (r,) = import_table(tmp_path / "d.csv", yaml.safe_load(text), tmp_path / "bag").recordings
    assert np.abs(r.channels["grade"] - slope).mean() < 0.005
    by_hand = {**channels, "grade": {"column": name, "unit": "deg" if "deg" in name else "percent"}}
    with pytest.raises(InputError, match=says):
        import_table(tmp_path / "d.csv", {**yaml.safe_load(text), "channels": by_hand}, tmp_path / "hand")


def test_a_slope_of_the_road_is_taken(tmp_path: Path) -> None:
    a = D["a"] - 0.3 * 9.81 * ROAD  # a truck that its hills slow
    v = 15 + np.cumsum(a) * 0.1
    columns = {
        **COLUMNS,
        "Speed (km/h)": np.round(3.6 * v, 2),
        "slope (%)": np.round(100 * ROAD + 0.2 * NOISE, 2),
    }
    columns["Altitude (m)"] = np.round(300 + np.cumsum(np.sin(np.arctan(ROAD)) * v) * 0.1, 1)
    channels, _ = proposed(columns, tmp_path)
    assert channels["grade"]["column"] == "slope (%)"


def test_counts_are_proposed_where_places_confirm_them(tmp_path: Path) -> None:
    """mm/s and counts of 1/256 km/h are of one size."""
    columns = {"time": T, "speed": np.round(1000 * V), "throttle (%)": D["gas"]}
    assert "speed" not in (proposed(columns, tmp_path)[0] or {})
    columns |= {"lat": np.round(48 + np.cumsum(V) * 0.1 / 111_200, 7), "lon": 0 * T + 11.5}
    channels, _ = proposed(columns, tmp_path)
    assert channels["speed"]["unit"] == "mm/s"
    places = {c: {"column": c[:3], "unit": "deg"} for c in ("latitude", "longitude")}
    meaning = {"time": {"column": "time", "unit": "s"},
               "channels": {"speed": {"column": "speed", "unit": "m/s"}, **places}}  # fmt: skip
    with pytest.raises(InputError, match=r"1000 times what latitude and longitude give.* mm/s\?"):
        import_table(tmp_path / "d.csv", meaning, tmp_path / "bag")


def test_one_component_of_an_acceleration_is_doubted(tmp_path: Path) -> None:
    north, east = V * np.cos(0.6), V * np.sin(0.6)
    columns = {"t (s)": T, "vx [m/s]": north.round(3), "vy [m/s]": east.round(3),
               "ax [m/s^2]": np.gradient(north, T).round(3)}  # fmt: skip
    channels, text = proposed(columns, tmp_path)
    assert channels["speed"]["column"] == ["vx [m/s]", "vy [m/s]"]
    assert "acceleration is 0.83 times" in text and "or of one component" in text
