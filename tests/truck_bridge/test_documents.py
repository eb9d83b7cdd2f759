"""What the documents say is what the code does."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def test_the_layers_name_tests_that_exist():
    text = (ROOT / "docs" / "can_bridge.md").read_text()
    tests = "".join(path.read_text() for path in (ROOT / "tests").rglob("test_*.py"))
    files = {path.stem for path in (ROOT / "tests").rglob("test_*.py")}
    named = set(re.findall(r"`(test_\w+)", text)) - files
    assert len(named) > 15
    missing = [name for name in named if f"def {name}" not in tests]
    assert missing == []


@pytest.mark.parametrize("command", ["decode", "check", "record", "replay", "convert"])
def test_the_commands_exist(command):
    text = (ROOT / "docs" / "can_bridge.md").read_text()
    assert f"truck-bridge {command} " in text
