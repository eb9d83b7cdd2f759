"""`deeptruck-model check-simulator`: its table, exit code and what it accepts; `evaluate` takes the same."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from deeptruck_model import simulators

Script = Callable[..., tuple[int, str, str]]


def test_the_table_of_a_sound_simulator(script: Script, shuttle: Path) -> None:
    text = f"python:{shuttle.stem}:make"
    code, said, errors = script("check-simulator", text, "--json", "table.json")
    assert code == 0 and "note  forces " in said and "NO " not in said, errors
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


def test_a_change_is_accepted_where_it_drives(script: Script, shuttle: Path) -> None:
    simulators.load(f"python:{shuttle.stem}:make").save(Path("kept"))
    code, _, errors = script("check-simulator", "truck:trucksim", "--accept")
    assert code == 2 and "stands for no outside simulator" in errors
    shuttle.write_text(shuttle.read_text() + "\n# a remark\n")
    code, _, errors = script("check-simulator", "kept")
    assert code == 2 and "check-simulator kept --accept" in errors
    code, said, _ = script("check-simulator", "kept", "--accept")
    assert code == 0, said
    assert script("check-simulator", "kept")[0] == 0


def test_evaluate_drives_it(script: Script, shuttle: Path, bag: Callable[..., Path]) -> None:
    friday = bag("friday", 120.0, seed=5)
    text = f"python:{shuttle.stem}:make"
    code, _, errors = script("evaluate", text, friday, "--out", "out", "--trials", "3", "--horizon", "20")
    assert code == 0 and Path("out/metrics.json").exists(), errors
