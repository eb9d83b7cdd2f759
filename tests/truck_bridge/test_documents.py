"""What the documents say is what the code does."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

from truck_bridge.safety import Timing

ROOT = Path(__file__).resolve().parents[2]


def test_the_layers_name_tests_that_exist():
    text = (ROOT / "docs" / "safety_core.md").read_text()
    tests = "".join(path.read_text() for path in (ROOT / "tests").rglob("test_*.py"))
    files = {path.stem for path in (ROOT / "tests").rglob("test_*.py")}
    named = set(re.findall(r"`(test_\w+)", text)) - files
    assert len(named) > 15
    missing = [name for name in named if f"def {name}" not in tests]
    assert missing == []


def test_the_table_of_times_is_that_of_the_core():
    text = (ROOT / "docs" / "vehicle_file.md").read_text().split("## Times of the core")[1]
    rows = re.findall(r"^\| `(\w+)` \| ([\d.]+) \| (.+) \| (.+) \|$", text, re.MULTILINE)
    assert {name: float(value) for name, value, *_ in rows} == dataclasses.asdict(Timing())
