"""The JSON Schemas for editors take what the program takes, refuse what it refuses, and are up to date."""

from __future__ import annotations

import copy
import json
import re
import runpy
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

from deeptruck_core.errors import InputError
from deeptruck_core.signals import CHANNELS
from deeptruck_model.recordings import topic_map
from deeptruck_model.recordings.tables.columns import load_columns
from deeptruck_model.recordings.units import conversion, known_units

ROOT = Path(__file__).parents[1]
SCHEMAS = ROOT / "docs" / "schemas"
VEHICLES = [
    *(ROOT / "src/truck_bridge/vehicles").glob("*.yaml"),
    *(ROOT / "tests/truck_bridge").glob("*.yaml"),
]
COLUMNS = sorted((ROOT / "layouts/columns").glob("*.yaml"))
SHOWN = re.findall(r"```yaml\n(.*?)```", (ROOT / "docs/recordings.md").read_text(), flags=re.S)
SPEED = {"column": "v", "unit": "m/s"}
TABLE = {"time": {"column": "t", "unit": "s"}, "channels": {"speed": SPEED}}
TOPICS = {"speed": {"topic": "/odom", "field": "twist.twist.linear.x"}}
TRUCK = yaml.safe_load((ROOT / "src/truck_bridge/vehicles/trucksim.yaml").read_text())


def schema(name: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((SCHEMAS / f"{name}.schema.json").read_text(encoding="utf-8"))
    return found


def fits(name: str, data: Any) -> bool:
    return not list(jsonschema.Draft7Validator(schema(name)).iter_errors(data))


def changed(base: dict[str, Any], where: str, value: Any) -> dict[str, Any]:
    """A copy with another value in one place; None removes it."""
    data = copy.deepcopy(base)
    *way, last = where.split(".")
    place = data
    for key in way:
        place = place[key]
    if value is None:
        del place[last]
    else:
        place[last] = value
    return data


def test_the_files_are_what_the_source_makes() -> None:
    texts = runpy.run_path(str(SCHEMAS / "generate.py"))["texts"]()
    assert {path.name for path in SCHEMAS.glob("*.json")} == set(texts)
    for name, text in texts.items():
        assert (SCHEMAS / name).read_text(encoding="utf-8") == text, "run 'make schemas'"
        jsonschema.Draft7Validator.check_schema(json.loads(text))


@pytest.mark.parametrize("path", [*COLUMNS, *VEHICLES], ids=lambda path: path.stem)
def test_what_is_shipped_fits(path: Path) -> None:
    assert fits("columns" if path in COLUMNS else "vehicle", yaml.safe_load(path.read_text()))


def test_what_is_documented_fits() -> None:
    assert len(COLUMNS) >= 4 and len(VEHICLES) >= 5 and len(SHOWN) == 2
    assert fits("topics", yaml.safe_load(SHOWN[0])) and fits("columns", yaml.safe_load(SHOWN[1]))


def program_takes(read: Callable[[], object]) -> bool:
    try:
        read()
    except InputError:
        return False
    return True


@pytest.mark.parametrize(
    ("where", "value", "good"),
    [
        ("delimiter", ";;", False),
        ("time", None, False),
        ("time", {"column": "t", "rate_hz": 1.0}, False),
        ("time.unit", "iso", True),
        ("channels.speed.unit", None, False),
        ("channels.speed.unit", "rpm", False),
        ("channels.mass", {"column": "m", "unit": "kg"}, False),
        ("channels.grade", {"column": "g", "unit": 1}, True),
        ("channels.fuel_rate", {"column": "f", "unit": "g/s", "density": 832}, True),
        ("split_at", {"speed_step": 2.5}, True),
        ("conceal", ["speed"], False),
        ("vehicle", "tractor", False),
        ("mass_kg", 300_000, False),
    ],
)
def test_columns(where: str, value: Any, good: bool) -> None:
    data = changed(TABLE, where, value)
    assert program_takes(lambda: load_columns(data)) == good
    assert fits("columns", data) == good


@pytest.mark.parametrize(
    ("where", "value", "good"),
    [
        ("speed.unit", "km/h", True),
        ("speed.unit", "N m", False),
        ("speed", None, False),
        ("gear", {"topic": "/g", "field": "data"}, True),
        ("mass", {"topic": "/m", "field": "data"}, False),
    ],
)
def test_topic_maps(where: str, value: Any, good: bool) -> None:
    data = changed(TOPICS, where, value)
    assert program_takes(lambda: topic_map.load(data)) == good
    assert fits("topics", data) == good


def spelled(unit: str) -> Iterator[str]:
    """Ways in which people write one unit."""
    yield from (unit, unit.upper(), f" [{unit}] ", f"({unit})", unit.replace("/", " / "))
    yield from (unit.replace("^2", "²").replace("^3", "³"), unit.replace("^", "**"), " ".join(unit))


@pytest.mark.parametrize("channel", CHANNELS)
def test_units_in_any_spelling(channel: str) -> None:
    entry = schema("columns")["properties"]["channels"]["properties"][channel]
    kinds = entry.get("anyOf", [entry])[0]["properties"]["unit"]  # a brake command may be derived instead
    validator = jsonschema.Draft7Validator(kinds)
    units = {unit for other in CHANNELS for unit in known_units(other)}
    for text in {text for unit in units for text in spelled(unit)} | {"", "furlong", "m/s/s", "km/hh"}:
        taken = bool(text) and program_takes(lambda text=text: conversion(channel, text))  # type: ignore[misc]
        assert validator.is_valid(text) == taken, text
