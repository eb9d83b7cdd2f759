"""`deeptruck-model check-simulator`: its table, exit code and what it accepts; `evaluate` takes the same."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from deeptruck_model import simulators
from deeptruck_model.cli.simulators import _change

Script = Callable[..., tuple[int, str, str]]


def test_the_table_of_a_sound_simulator(script: Script, shuttle: Path) -> None:
    text = f"python:{shuttle.stem}:make"
    code, said, errors = script("check-simulator", text, "--json", "table.json")
    assert code == 0 and re.search(rf"{text} is fit for use, but for \d+ notes? above\n$", said), errors
    assert "note  forces " in said and "NO " not in said
    assert re.search(r"step +[\d.]+ ms a step of 3 rows", said)
    table = json.loads(Path("table.json").read_text())
    assert table["simulator"] == text
    assert {"about", "state", "says", "mend"} == set(table["rows"][0])
    code, _, errors = script("check-simulator", text, "--json", "table.json")
    assert code == 2 and "table.json" in errors


@pytest.mark.parametrize(
    ("source", "says"),
    [
        ("class make:\n    dt = 0.1\n", "NO    reset "),
        ("import shuttle as s\n", "is no function or class|raised ModuleNotFoundError"),
    ],
)
def test_what_lacks_something_is_exit_code_2(script: Script, shuttle: Path, source: str, says: str) -> None:
    shuttle.write_text(source)
    code, said, errors = script("check-simulator", f"python:{shuttle.stem}:make")
    assert code == 2 and errors.count("\n") == 1
    assert any(word in said + errors for word in says.split("|"))


def test_a_fault_on_the_road_is_exit_code_2_with_the_row(script: Script, shuttle: Path) -> None:
    shuttle.write_text(shuttle.read_text().replace("- GRAVITY * w[:, 0]", "+ GRAVITY * w[:, 0]"))
    code, said, errors = script("check-simulator", f"python:{shuttle.stem}:make")
    assert code == 2 and "NO    grade" in said
    assert errors.endswith("is not fit for use: mend grade, as the table says\n")


def test_a_change_is_accepted_where_it_drives(script: Script, shuttle: Path) -> None:
    simulators.load(f"python:{shuttle.stem}:make").save(Path("kept"))
    code, _, errors = script("check-simulator", "truck:trucksim", "--accept")
    assert code == 2 and "stands for no outside simulator" in errors
    shuttle.write_text(shuttle.read_text() + "\n# a remark\n")
    code, _, errors = script("check-simulator", "kept")
    assert code == 2 and "check-simulator kept --accept" in errors
    code, said, _ = script("check-simulator", "kept", "--accept")
    assert code == 0 and "accepted: kept stands for it as it is now" in said
    assert script("check-simulator", "kept")[0] == 0


def test_evaluate_drives_it(script: Script, shuttle: Path, bag: Callable[..., Path]) -> None:
    friday = bag("friday", 120.0, seed=5)
    text = f"python:{shuttle.stem}:make"
    code, said, errors = script("evaluate", text, friday, "--out", "out", "--trials", "3", "--horizon", "20")
    assert code == 0, errors
    assert "3 free runs of 20 s" in said and Path("out/metrics.json").exists()


@pytest.mark.parametrize(
    ("low", "high", "says"),
    [
        (0.06, 0.29, "smaller by 6 to 29 %"),
        (-0.1, 0.2, "between 10 % larger and 20 % smaller"),
        (-2.57, -1.48, "larger by 148 to 257 %"),
    ],
)
def test_a_change_of_the_error_is_said_with_its_direction(low: float, high: float, says: str) -> None:
    assert _change(low, high) == says
