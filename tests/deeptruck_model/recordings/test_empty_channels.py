"""No channel is listed that has no valid sample, whatever it was imported from."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from csv_tables import write_csv
from foreign_bags import Message, S, bag_of, number, twist

from deeptruck_core.errors import InputError
from deeptruck_model.recordings import import_table, read

UNITS = {
    "engine_command": "percent", "brake_command": "percent", "grade": "ratio", "fuel_rate": "cm3/s",
        "gear": "1",
}  # fmt: skip
VALID = {"engine_command": 30.0, "brake_command": 5.0, "grade": 0.01, "fuel_rate": 3.0, "gear": 7.0}
NAN = float("nan")
EMPTY: dict[str, Callable[[int], float]] = {  # what stands in a channel's k-th sample of 300
    "out of range": lambda k: 1e9,
    "not a number": lambda k: NAN,
    "a value once, out of range": lambda k: 1e9 if k == 7 else NAN,
}
Values = dict[str, list[float]]


def by_table(folder: Path, values: Values) -> tuple[Path, dict[str, Any]]:
    k = np.arange(300)
    channels = {c: {"column": c, "unit": unit} for c, unit in UNITS.items()}
    meaning = {"time": {"column": "t", "unit": "s"},
               "channels": {"speed": {"column": "v", "unit": "m/s"}, **channels}}  # fmt: skip
    return write_csv(folder / "drive.csv", {"t": k / 10, "v": 0 * k + 10, **values}), meaning


def by_bag(folder: Path, values: Values, late_ns: int = 0) -> tuple[Path, dict[str, Any]]:
    messages: list[Message] = []
    for k in range(300):
        ns = S + k * S // 10
        messages.append(("/speed", twist(10.0, ns + late_ns), ns + late_ns))
        messages += [(f"/{c}", number(column[k]), ns) for c, column in values.items()]
    topics = {c: {"topic": f"/{c}", "field": "data", "unit": UNITS[c]} for c in values}
    meaning = {"speed": {"topic": "/speed", "field": "twist.linear.x"}, **topics}
    return bag_of(folder / "drive", sorted(messages, key=lambda m: m[2])), meaning


@pytest.mark.parametrize("source", [by_table, by_bag])
@pytest.mark.parametrize("empty", EMPTY)
@pytest.mark.parametrize("channel", ["brake_command", "grade", "fuel_rate", "gear"])
def test_what_is_never_valid_is_not_listed(
    tmp_path: Path, source: Callable[[Path, Values], tuple[Path, dict[str, Any]]], empty: str, channel: str
) -> None:
    values = {c: [value] * 300 for c, value in VALID.items()} | {channel: [*map(EMPTY[empty], range(300))]}
    given, meaning = source(tmp_path, values)
    if source is by_table and empty == "not a number":  # of a table that is a mistake
        with pytest.raises(InputError, match=f"column '{channel}' holds no numbers"):
            import_table(given, meaning, tmp_path / "bag")
        return
    (done,) = import_table(given, meaning, tmp_path / "bag").recordings
    assert done.account is not None
    said = [line for line in done.account.remarks if line.startswith(f"{channel}: left out")]
    assert bool(said) == (empty != "not a number")  # of what was never there, what was not recorded is said
    (one,) = read(tmp_path / "bag")
    assert channel not in one.channels and "engine_command" in one.channels
    assert channel not in (*one.interface.u, *one.interface.w, *one.interface.y)
    assert all(not np.isnan(x).all() for x in one.channels.values())


def test_what_no_speed_stands_beside_is_not_listed(tmp_path: Path) -> None:
    """Commands that end before the speed begins, as by topics that were recorded one after the other."""
    bag, meaning = by_bag(tmp_path, {"engine_command": [30.0] * 300}, late_ns=100 * S)
    (one,) = read(bag, topic_map=meaning)
    assert "engine_command" not in one.channels and one.account is not None and one.account.balanced
    assert any(line.startswith("engine_command: left out") for line in one.account.remarks)
