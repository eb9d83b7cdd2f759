from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from csv_tables import SPEED, write_csv

from deeptruck_core.signals import CHANNELS, TruckInterface
from deeptruck_model.recordings import Recording, coverage, import_table, read, suggest_columns, write_bag
from deeptruck_model.recordings.not_recorded import INPUTS, not_recorded

CHANNELS_OF = {
    "brake": ("brake_command",),
    "gear": ("gear",),
    "slope": ("grade", "elevation"),
    "gap": ("gap",),
    "commands obeyed": ("engine_torque",),
}


def without(drive: Recording, *channels: str) -> Recording:
    return replace(drive, channels={c: v for c, v in drive.channels.items() if c not in channels})


@pytest.fixture
def whole(drive: Recording) -> Recording:
    return replace(drive, interface=replace(drive.interface, mass_kg=24000.0))


def test_of_a_whole_recording_nothing_is_missing(whole: Recording) -> None:
    assert not_recorded([whole]) == []


@pytest.mark.parametrize("name", CHANNELS_OF)
@pytest.mark.parametrize("how", ["absent", "all invalid"])
def test_each_input_is_missed_alone(whole: Recording, name: str, how: str) -> None:
    lacking = without(whole, *CHANNELS_OF[name])
    if how == "all invalid":
        nothing = {c: np.full(600, np.nan) for c in CHANNELS_OF[name]}
        lacking = replace(whole, channels=whole.channels | nothing)
    (missing,) = not_recorded([lacking])
    assert missing.to_dict() == {"input": name, "hides": missing.input.hides, "signal": missing.input.signal}


def test_the_mass_is_missed_where_no_interface_has_it(drive: Recording) -> None:
    assert [m.input.name for m in not_recorded([drive])] == ["mass"]


def test_a_brake_counts_as_recorded_where_no_speed_shows_that_it_never_moved(whole: Recording) -> None:
    assert "brake" not in [m.input.name for m in not_recorded([without(whole, "speed")])]


def test_no_gap_is_missed_where_the_user_states_that_no_vehicle_was_ahead(whole: Recording) -> None:
    lacking = without(whole, "gap")
    assert [m.input.name for m in not_recorded([lacking])] == ["gap"]
    assert not_recorded([replace(lacking, no_vehicle_ahead=True)]) == []


def test_elevation_serves_for_the_slope(whole: Recording) -> None:
    assert not_recorded([without(whole, "grade")]) == []


def test_bags_are_named_where_only_some_lack_it_and_pieces_are_no_bags(whole: Recording) -> None:
    first, second = replace(without(whole, "gear"), name="a#0"), replace(whole, name="a#1")
    assert not_recorded([first, second]) == []
    (missing,) = not_recorded([first, second, replace(without(whole, "gear"), name="b")])
    assert missing.to_dict()["sources"] == ["b"]


def test_of_a_table_the_columns_are_named_and_no_topics(tmp_path: Path) -> None:
    k = np.arange(50)
    write_csv(tmp_path / "drive.csv", {"t": k / 10, "v": 10 + k % 3})
    columns = {"time": {"column": "t"}, "channels": SPEED}
    bag = import_table(tmp_path / "drive.csv", columns, tmp_path / "bag").bag
    found = coverage(read(bag)).not_recorded
    assert [m["input"] for m in found] == [one.name for one in INPUTS]
    for missing, one in zip(found, INPUTS, strict=True):
        names = re.findall("`(.+?)`", one.column)
        assert names and {*names} <= {
            *CHANNELS, "mass_kg", "driven_by", "--mass-kg", "--no-vehicle-ahead"
        }  # fmt: skip
        assert missing["signal"].endswith(one.column) and "/" not in missing["signal"]
        assert "in COLUMNS.yaml" in missing["signal"]


@pytest.mark.usefixtures("undrawn")
def test_it_comes_first_on_the_terminal_in_the_numbers_and_on_the_page(
    tmp_path: Path, drive: Recording, script: Callable[..., tuple[int, str, str]]
) -> None:
    bare = TruckInterface("t", brake_unit=None, grade=False, fuel=False)
    lacking = replace(without(drive, "brake_command", "grade", "elevation"), interface=bare)
    bag = write_bag(tmp_path / "bag", [lacking], interface=bare)
    _, said, _ = script("coverage", bag, "--out", tmp_path / "out")
    lines = said.splitlines()
    assert [line.partition(".")[0] for line in lines[:3]] == [
        "not recorded: brake",
        "not recorded: slope",
        "not recorded: mass",
    ]
    assert "SPN 521" in lines[0] and not lines[3].startswith("not recorded")
    data = json.loads((tmp_path / "out" / "coverage.json").read_text())
    assert list(data)[:2] == ["judgement", "not_recorded"]
    assert [m["input"] for m in data["not_recorded"]] == ["brake", "slope", "mass"]
    page = (tmp_path / "out" / "coverage.html").read_text()
    body = page[page.index("<body") :]
    assert body.index("<h1>") < body.index("Not recorded: ") < body.index("SPN 521")
    assert body.index("SPN 521") < body.index("data:image")
    assert coverage([lacking]).not_recorded == data["not_recorded"]


def test_the_pedals_of_a_person_were_obeyed(tmp_path: Path) -> None:
    k = np.arange(300)
    columns = {"t": k / 10, "v": 10 + k / 100, "accelerator_pedal_pct": k % 90}
    table = write_csv(tmp_path / "drive.csv", columns)
    pedal = {"column": "accelerator_pedal_pct", "unit": "percent"}
    meaning = {"time": {"column": "t"}, "channels": {**SPEED, "engine_command": pedal}}
    for name, stated in (("unstated", {}), ("stated", {"driven_by": "person"})):
        import_table(table, {**meaning, **stated}, tmp_path / name)
        (found,) = read(tmp_path / name)
        assert found.interface.driven_by == stated.get("driven_by")
        lacking = {missing.input.name for missing in not_recorded([found])}
        assert ("commands obeyed" in lacking) == (not stated)
    topics = {"speed": {"topic": "/truck/twist", "field": "twist.linear.x"}, "driven_by": "person"}
    (mapped,) = read(tmp_path / "unstated", topic_map=topics)
    assert mapped.interface.driven_by == "person"
    suggested = suggest_columns(table).text()
    assert ("\ndriven_by: person\n" in suggested) == ("\n  engine_command: {" in suggested)
