"""`prove` on one case of every level, from the drawing of the truck to the page."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from deeptruck_exam.cases.levels import LEVELS
from deeptruck_exam.command import prove


@pytest.mark.long
@pytest.mark.parametrize("level", LEVELS)
def test_a_case_of_every_level_is_made_and_scored(level: str, tmp_path: Path) -> None:
    board = prove(tmp_path / "proof", [level], 1, seed=5, simulators=["physics"])
    assert board["broken"] == [] and board["cases"] == 1
    (row,) = board["levels"].values()
    assert row["n"] == 1
    (score,) = (tmp_path / "proof" / "cases").glob("*/score.json")
    result = json.loads(score.read_text())
    refused = level == "input_not_recorded" and result["input_stated"]
    assert result["returncode"] == 0 or refused
    assert "## By level" in (tmp_path / "proof" / "proof.md").read_text()
