from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface, sensible
from deeptruck_model.recordings import Recording, Series, coverage, read, uniform, write_bag
from deeptruck_model.recordings.coverage_map import ACCELERATION_EDGES, GRADE_EDGES, SPEED_EDGES, judgement


def steady(speed: float, acceleration: float, grade: float | None, count: int = 100) -> Recording:
    values = {"speed": speed, "acceleration": acceleration} | ({} if grade is None else {"grade": grade})
    channels = {name: np.full(count, value) for name, value in values.items()}
    return Recording("r", 0.1, channels, TruckInterface("t"))


def test_time_is_counted_where_it_was_spent() -> None:
    found = coverage([steady(13.0, -1.1, 0.032), steady(90.0, -40.0, None, 50)])
    i = np.searchsorted(SPEED_EDGES, 13.0) - 1
    j = np.searchsorted(ACCELERATION_EDGES, -1.1) - 1
    k = np.searchsorted(GRADE_EDGES, 0.032) - 1
    assert found.seconds[i, j, k] == pytest.approx(10.0)
    assert found.seconds[-1, 0, -1] == pytest.approx(5.0)  # beyond the edges, and without a grade
    assert found.seconds.sum() == pytest.approx(15.0) == found.duration_s


def test_invalid_samples_are_shares_not_time(drive: Recording) -> None:
    found = coverage([drive])
    invalid = np.isnan(drive.channels["speed"]) | np.isnan(drive.channels["acceleration"])
    assert found.seconds.sum() == pytest.approx(0.1 * (600 - invalid.sum()))
    described = found.recordings[0]["channels"]["gap"]
    assert described["nan_share"] == pytest.approx(np.isnan(drive.channels["gap"]).mean(), abs=1e-6)
    assert described["max"] == np.nanmax(drive.channels["gap"])
    assert described["unit"] == "m"
    assert found.recordings[0]["channels"]["brake_command"]["unit"] == "bar"


def test_gaps_are_those_between_pieces_of_one_bag(drive: Recording) -> None:
    first = replace(drive, name="bag#0")
    second = replace(drive, name="bag#1", start_s=100.0)
    found = coverage([first, second, replace(drive, name="other")])
    assert [r["gap_before_s"] for r in found.recordings] == [None, pytest.approx(40.1), None]


def test_it_is_written_as_json_and_picture(tmp_path: Path, drive: Recording) -> None:
    all_nan = replace(drive, channels=drive.channels | {"grade": np.full(600, np.nan)})
    coverage([all_nan]).save(tmp_path / "out")
    data = json.loads((tmp_path / "out" / "coverage.json").read_text())
    assert data["recordings"][0]["channels"]["grade"] == {
        "unit": "ratio",
        "min": None,
        "max": None,
        "mean": None,
        "nan_share": 1.0,
    }
    assert np.array(data["occupancy"]["seconds"]).shape == (20, 52, 21)
    assert (tmp_path / "out" / "coverage.png").read_bytes().startswith(b"\x89PNG")
    assert coverage([drive])._repr_png_().startswith(b"\x89PNG")  # by which a notebook shows it
    names = {p.name for p in (tmp_path / "out").iterdir()}
    assert names == {"coverage.json", "coverage.png", "coverage.html", ".deeptruck.json"}


@pytest.mark.usefixtures("undrawn")
def test_the_page_has_the_numbers_and_fetches_nothing(tmp_path: Path, drive: Recording) -> None:
    found = coverage([drive])
    found.save(tmp_path / "out")
    text = (tmp_path / "out" / "coverage.html").read_text()
    told = found.to_dict()["recordings"][0]["channels"]["speed"]
    for key in ("min", "mean", "max"):
        assert f">{sensible(told[key])}<" in text
    grade = found.to_dict()["recordings"][0]["channels"]["grade"]
    assert (
        f'<td class="n">%</td><td class="n">{sensible(100 * grade["min"])}<' in text
    )  # as the figure has it
    assert "data:image/png;base64," in text and not re.search(r"https?://|<script|@import", text)


@pytest.mark.usefixtures("undrawn")
def test_the_account_of_each_source_is_written_once_and_shown(
    tmp_path: Path, interface: TruckInterface
) -> None:
    time = np.arange(600) / 10
    time[300:] += 20
    gap = np.full(600, 40.0)
    gap[5:15] = 2400.0
    series = {"speed": Series(time, np.full(600, 9.0)), "gap": Series(time, gap)}
    pieces = uniform(series, name="two<i>", interface=interface)
    coverage(pieces).save(tmp_path / "out")
    (account,) = json.loads((tmp_path / "out" / "coverage.json").read_text())["accounts"]
    assert len(pieces) == 2 and account["spans_s"] == [[0.0, 29.9], [50.0, 79.9]]
    assert account["channels"]["gap"] == {
        "read": 600,
        "used": 590,
        "set_aside": {"outside 0..500 m": {"count": 10, "first": "at 0.5 s (2400)"}},
    }
    page = (tmp_path / "out" / "coverage.html").read_text()
    assert (
        "What became of two&lt;i&gt;" in page
        and "gap: outside 0..500 m" in page
        and "at 0.5 s (2400)" in page
    )


@pytest.mark.usefixtures("undrawn")
def test_a_channel_that_a_bag_does_not_have_has_no_row(tmp_path: Path) -> None:
    drive = steady(13.0, 0.0, 0.01, 600)
    write_bag(tmp_path / "bag", [drive], interface=drive.interface)
    coverage(read(tmp_path / "bag")).save(tmp_path / "out")
    (account,) = json.loads((tmp_path / "out" / "coverage.json").read_text())["accounts"]
    assert account["channels"]["latitude"]["read"] == 0
    page = (tmp_path / "out" / "coverage.html").read_text()
    assert '<th scope="row">speed<' in page and '<th scope="row">latitude<' not in page


def test_nothing_to_look_at(tmp_path: Path, drive: Recording) -> None:
    with pytest.raises(InputError, match="no recording"):
        coverage([])
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="is a file; choose another"):
        coverage([drive]).save(tmp_path / "file")


def test_a_judgement_names_what_was_driven_too_little() -> None:
    seconds = np.zeros((20, 52, 21))
    seconds[4, 42, 10] = 1700.0
    assert "no, 28 min were driven" in judgement(seconds, seconds.sum(), commanded=True)
    seconds[12, 33, 10] = 200.0  # slowing by 1.75 m/s^2 at 24 m/s
    said = judgement(seconds, seconds.sum(), commanded=True)
    assert said.startswith("Enough to train: yes (32 min); below 4 m/s: no (0 s);")
    assert "slowing by more than 2 m/s²: no (0 s)" in said and "slowing by 0.5 to 2" not in said
    assert "no engine command" in judgement(seconds, seconds.sum(), commanded=False)


@pytest.mark.parametrize(
    ("value", "shown"),
    [(1.887e-05, "0"), (-0.0123, "-0.012"), (5.678, "5.68"), (1234.5, "1234"), (-0.0001, "0")],
)
def test_numbers_have_sensible_digits(value: float, shown: str) -> None:
    assert sensible(value) == shown


def test_speeds_are_shown_in_other_units_and_stored_in_m_s(tmp_path: Path) -> None:
    driven = steady(13.0, -1.1, 0.032, 20_000)
    found = coverage([replace(driven, channels=driven.channels | {"engine_command": np.ones(20_000)})])
    found.save(tmp_path / "out", units="km/h")
    shown = (tmp_path / "out" / "coverage.html").read_text()
    assert "14.4 to 57.6 km/h" in shown and "46.8" in shown and "slowing by 0.5 to 2 m/s²" in shown
    assert json.loads((tmp_path / "out" / "coverage.json").read_text())["judgement"] == found.judgement
    assert "above 16 m/s: no" in found.judgement
