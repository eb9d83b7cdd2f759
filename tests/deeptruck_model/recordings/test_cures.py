"""Every cure that a refused table names, followed as it is written, ends in the values that were driven."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from csv_tables import COLUMNS, drive, speed, with_channels, write_csv

from deeptruck_core.errors import InputError
from deeptruck_model.recordings import import_table

Meaning = dict[str, Any]
DATES = [f"04.05.2026 09:58:{k // 10:02d}.{k % 10}" for k in range(600)]
SI = {"speed": {"column": "v", "unit": "m/s"}}


@dataclass(frozen=True)
class Row:
    """An input, what it is refused with, and the meaning by the cure, of which `says` catches the text."""

    columns: dict[str, Any]
    meaning: Meaning
    says: str
    cured: Callable[[Meaning, str], Meaning]
    encoding: str = "utf-8"


def key(name: str) -> Callable[[Meaning, str], Meaning]:
    """A key of COLUMNS gets the value that the message has, as YAML."""
    return lambda meaning, said: {**meaning, name: yaml.safe_load(said)}


def of_channel(channel: str) -> Callable[[Meaning, str], Meaning]:
    """A channel gets the keys that the message has, as YAML."""

    def cured(meaning: Meaning, said: str) -> Meaning:
        changed = {**meaning["channels"][channel], **yaml.safe_load("{" + said + "}")}
        return {**meaning, "channels": {**meaning["channels"], channel: changed}}

    return cured


def without(channel: str) -> Callable[[Meaning, str], Meaning]:
    """The channel named is left out."""
    return lambda meaning, said: {
        **meaning,
        "channels": {c: entry for c, entry in meaning["channels"].items() if c != channel},
    }


def column(channel: str) -> Callable[[Meaning, str], Meaning]:
    """The channel is taken from the column that the message lists."""
    return lambda meaning, said: of_channel(channel)(meaning, f"column: {said}")


D = drive()
A = {"column": "a", "unit": "m/s^2"}
LONG = drive(1500)
PLACES = {"lat": 50 + np.cumsum(speed(LONG["t"])) * 0.1 / 111_195.0, "lon": np.full(1500, 8.0)}
OF_PLACES = {"latitude": {"column": "lat", "unit": "deg"}, "longitude": {"column": "lon", "unit": "deg"}}
IN_MPH = {"speed": {"column": "v", "unit": "mph"}}
TWO = {**D, "car": np.where(np.arange(600) % 2, "a", "b")}

ROWS = {
    "dates": Row({**D, "t": DATES}, COLUMNS, r"set time: (\{.*?\})", key("time")),
    "iso dates": Row(
        {**D, "t": [f"2026-05-04 09:58:{k // 10:02d}.{k % 10}" for k in range(600)]},
        COLUMNS,
        r"set time: (\{.*?\})",
        key("time"),
    ),
    "whole seconds": Row({**D, "t": np.floor(D["t"])}, COLUMNS, r"set time: (\{.*?\})", key("time")),
    "one stamp": Row(
        {**D, "t": np.full(600, 7)},
        COLUMNS,
        r"set time: (\{rate_hz: )\.\.\.",
        lambda m, s: {**m, "time": {"rate_hz": 10}},
    ),
    "encoding": Row(
        {**D, "Höhe": D["v"]}, COLUMNS, r"set 'encoding' \(([\w-]+)", key("encoding"), encoding="latin-1"
    ),
    "unit in cells": Row(
        {**D, "v": [f"{v} km/h" for v in D["v"]]},
        with_channels(**SI),
        r"give it (unit: \S+)$",
        of_channel("speed"),
    ),
    "speed unit by range": Row(D, with_channels(**SI), r"'(unit: km/h)'", of_channel("speed")),
    "turned accelerometer": Row(
        {**D, "a": -D["a"]}, with_channels(acceleration=A), r"'(scale: -1)'", of_channel("acceleration")
    ),
    "accelerometer in g": Row(
        {**D, "a": D["a"] / 9.80665},
        with_channels(acceleration=A),
        r"'(scale: [\d.]+)'",
        of_channel("acceleration"),
    ),
    "accelerometer left out": Row(
        {**D, "a": 0.0 * D["a"]},
        with_channels(acceleration=A),
        r"(leave acceleration out)",
        without("acceleration"),
    ),
    "speed against places": Row(
        {**LONG, **PLACES},
        with_channels(**IN_MPH, **OF_PLACES),
        r"\((km/h) read as mph\): give it its unit",
        lambda m, s: of_channel("speed")(m, f"unit: {s}"),
    ),
    "brake with a sign": Row(
        {**D, "brake": -D["brake"]}, COLUMNS, r"'(scale: -1)'", of_channel("brake_command")
    ),
    "misspelt column": Row(
        D, with_channels(speed={"column": "V", "unit": "km/h"}), r"there is: t, (v),", column("speed")
    ),
    "unit that does not fit": Row(
        D,
        with_channels(speed={"column": "v", "unit": "kmph/s"}),
        r"use one of: m/s, \S+, (km/h)",
        lambda m, s: of_channel("speed")(m, f"unit: {s}"),
    ),
    "vehicle that is not there": Row(
        TWO, {**COLUMNS, "only": {"car": "c"}}, r"there is: (\w)", lambda m, s: {**m, "only": {"car": s}}
    ),
}


@pytest.mark.parametrize("name", ROWS)
def test_a_cure_that_is_followed_gives_what_was_driven(name: str, tmp_path: Path) -> None:
    row = ROWS[name]
    path = write_csv(tmp_path / "t.csv", row.columns)
    path.write_text(path.read_text(), encoding=row.encoding)
    try:
        done = import_table(path, row.meaning, tmp_path / "refused")
        pytest.fail(f"not refused: {done.recordings[0].notes}")
    except InputError as error:
        said = re.search(row.says, str(error))
        assert said is not None and "\n" not in str(error), error
    done = import_table(path, row.cured(row.meaning, said[1]), tmp_path / "bag")
    r = done.recordings[0]
    t = r.start_s + r.dt * np.arange(len(r))
    only = 2.0 if "only" in row.meaning else 1.0
    assert len(r) > 500 / only
    assert np.abs(r.channels["speed"] - speed(t - t[0])).max() < 0.3
    assert np.nanmax(np.abs(r.channels["acceleration"])) < 1.5
