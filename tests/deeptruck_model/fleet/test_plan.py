"""What is wrong with a fleet's description is one line, said before anything is read."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from deeptruck_core.errors import InputError
from deeptruck_model.fleet import plan
from deeptruck_model.fleet.storage import place

LAYOUT = "{truck}/{date}/*.mcap"


@pytest.fixture
def refused(script):
    """refused(words) -> the one line of a refused `deeptruck-model fleet`."""

    def _refused(words: list[str]) -> str:
        code, _, says = script("fleet", *words)
        assert code == 2 and says.count("\n") == 1
        return says

    return _refused


def test_files_are_whose_and_of_which_day(drives):
    found = plan.drives(place(str(drives)), LAYOUT)
    assert [(d.truck, d.date, d.name) for d in found][:2] == [
        ("a", "2026-03-02", "2026-03-02/drive"), ("a", "2026-03-09", "2026-03-09/drive"),
    ]  # fmt: skip
    assert {d.date for d in plan.drives(place(str(drives)), "{truck}/**.mcap")} == {plan.NO_DATE}


def test_weeks():
    assert plan.week("2026-03-02") == plan.week("20260308") == "2026-W10" and plan.week("monday") is None


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (
            ["--layout", "{truck}/*.bag"],
            "matches nothing in .*: 4 files there, such as a/2026-03-02/drive.mcap",
        ),
        (["--layout", "*.mcap"], "has no {truck}"),
        (["--layout", LAYOUT, "--simulator", "truck:none"], "none"),
        (["--layout", LAYOUT, "--simulator", "classes.yaml"], "no simulator for class all"),
        (["--layout", LAYOUT, "--address", "ray://127.0.0.1:1"], "add --engine ray"),
        (["--layout", LAYOUT, "--engine", "ray", "--address", "ray://127.0.0.1:1"], "no Ray cluster answers"),
        (["--layout", LAYOUT, "--endpoint", "http://127.0.0.1:1"], "neither place is an s3:// address"),
        (["--layout", LAYOUT, "--trucks", "trucks.csv"], "line 3: sound is yes, no or empty, not 'maybe'"),
        (["--layout", LAYOUT, "--topic-map", "classes.yaml", "--columns", "classes.yaml"], "not both"),
    ],
)
def test_bad_input_is_one_line(drives, tmp_path, monkeypatch, refused, more, says):
    monkeypatch.chdir(tmp_path)
    Path("classes.yaml").write_text("heavy: truck:trucksim\n")
    Path("trucks.csv").write_text("truck,sound\na,yes\nb,maybe\n")
    given = ["--simulator", "truck:trucksim"] if "--simulator" not in more else []
    assert re.search(says, refused([str(drives), "--out", "out", *given, *more]))
    assert not Path("out").exists()


def test_stages_without_what_they_need(drives, tmp_path, refused):
    assert "fleet extract" in refused(["compare", str(tmp_path)])
    assert "fleet compare" in refused(["pool", str(tmp_path)])
    assert "has no verdicts" in refused(["show", str(tmp_path)])
    assert "with one of extract, compare" in refused(["walk", str(tmp_path)])
    assert "no such stage" in refused(["walk", str(tmp_path)])
    assert "does not exist" in refused(["pool", str(tmp_path / "none")])
    inside = ["--layout", LAYOUT, "--simulator", "truck:trucksim", "--out", str(drives / "out")]
    assert "is read here" in refused([str(drives), *inside])


def test_trucks_have_classes_and_traits(tmp_path):
    table = tmp_path / "trucks.csv"
    table.write_text("truck,class,sound,build\na,heavy,yes,2020\nb,,,\n")
    found = plan.trucks(table)
    assert found["a"] == plan.Truck("a", "heavy", True, {"build": "2020"})
    assert found["b"] == plan.Truck("b")
    table.write_text("name\na\n")
    with pytest.raises(InputError, match="column 'truck'"):
        plan.trucks(table)
