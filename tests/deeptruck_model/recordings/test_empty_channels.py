"""`import` lists no channel that has no valid sample, whatever it was imported from."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from csv_tables import write_csv
from foreign_bags import Message, S, bag_of, number, twist

from deeptruck_model.recordings import read

COLUMNS = """\
time: {column: t, unit: s}
channels:
  speed: {column: v, unit: m/s}
  engine_command: {column: e, unit: percent}
  brake_command: {column: b, unit: percent}
  grade: {column: g, unit: ratio}
  fuel_rate: {column: f, unit: cm3/s}
  gear: {column: gear}
"""
TOPICS = """\
speed: {topic: /speed, field: twist.linear.x}
engine_command: {topic: /e, field: data, unit: percent}
brake_command: {topic: /b, field: data, unit: percent}
grade: {topic: /g, field: data, unit: ratio}
fuel_rate: {topic: /f, field: data, unit: cm3/s}
gear: {topic: /gear, field: data}
"""
NAMES = {"b": "brake_command", "g": "grade", "f": "fuel_rate", "gear": "gear"}
VALID = {"e": 30.0, "b": 5.0, "g": 0.01, "f": 3.0, "gear": 7.0}
NAN = float("nan")
EMPTY = {  # what stands in a channel's k-th sample of 300
    "out of range": lambda k: 1e9,
    "not a number": lambda k: NAN,
    "a value once, out of range": lambda k: 1e9 if k == 7 else NAN,
}


def by_table(folder: Path, values: dict[str, Callable[[int], float]]) -> str:
    k = np.arange(300)
    write_csv(folder / "drive.csv", {"t": k / 10, "v": 0 * k + 10, **{c: map(values[c], k) for c in VALID}})
    (folder / "columns.yaml").write_text(COLUMNS)
    return "drive.csv"


def by_bag(folder: Path, values: dict[str, Callable[[int], float]]) -> str:
    messages: list[Message] = []
    for k in range(300):
        ns = S + k * S // 10
        messages.append(("/speed", twist(10.0, ns), ns))
        messages += [(f"/{c}", number(values[c](k)), ns) for c in VALID]
    bag_of(folder / "drive", messages)
    (folder / "columns.yaml").write_text(TOPICS)
    return "drive"


@pytest.mark.parametrize("source", [by_table, by_bag])
@pytest.mark.parametrize("empty", EMPTY)
@pytest.mark.parametrize("column", NAMES)
def test_what_is_never_valid_is_not_listed(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    script: Callable[..., tuple[int, str, str]],
    source: Callable[[Path, dict[str, Callable[[int], float]]], str],
    empty: str,
    column: str,
) -> None:
    values: dict[str, Callable[[int], float]] = {c: (lambda k, c=c: VALID[c]) for c in VALID}  # type: ignore[misc]
    values[column] = EMPTY[empty]
    given = source(tmp_path, values)
    monkeypatch.chdir(tmp_path)
    code, said, error = script("import", given, "--columns", "columns.yaml", "--out", "bag")
    name = NAMES[column]
    if source is by_table and empty == "not a number":  # of a table that is a mistake
        assert code == 2 and f"column '{column}' holds no numbers" in error
        return
    channels = next(line for line in said.splitlines() if line.startswith("channels: "))
    assert name not in channels and "engine_command" in channels
    said_so = f"{name}: left out, as no sample of it is valid" in said
    assert said_so == (empty != "not a number")  # of what was never there, what was not recorded is said
    (one,) = read("bag")
    assert name not in one.channels and name not in (*one.interface.u, *one.interface.w, *one.interface.y)
    assert all(not np.isnan(one.channels[c]).all() for c in one.channels)


def test_what_no_speed_stands_beside_is_not_listed(tmp_path: Path) -> None:
    """Commands that end before the speed begins, as by topics that were recorded one after the other."""
    messages: list[Message] = []
    for k in range(300):
        ns = S + k * S // 10
        messages += [("/e", number(30.0), ns), ("/speed", twist(10.0, ns + 100 * S), ns + 100 * S)]
        messages += [("/g", number(0.01), ns + 100 * S)]
    bag = bag_of(tmp_path / "drive", messages)
    lines = TOPICS.splitlines(keepends=True)
    (tmp_path / "topics.yaml").write_text(lines[0] + lines[1] + lines[3])
    (one,) = read(bag, topic_map=tmp_path / "topics.yaml")
    assert "engine_command" not in one.channels and "grade" in one.channels
    assert any(line.startswith("engine_command: left out") for line in one.account.remarks)
    assert one.account.balanced
