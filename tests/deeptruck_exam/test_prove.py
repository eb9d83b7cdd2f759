"""`prove` on one case of every level, from the drawing of the truck to the page."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from deeptruck_exam.cases.levels import LEVELS
from deeptruck_exam.command import prove

MINUTES = 0.7  # held-out errors are of windows of 40 s


@pytest.mark.long
@pytest.mark.timeout(3600)  # five minutes of CPU time, more on a busy machine
def test_a_case_of_every_level_is_made_and_scored(tmp_path: Path) -> None:
    board = prove(tmp_path / "proof", LEVELS, 1, seed=5, simulators=["physics"], minutes=MINUTES)
    assert board["broken"] == [] and board["cases"] == len(LEVELS)
    assert [row["n"] for row in board["levels"].values()] == [1] * len(LEVELS)
    for level in LEVELS:
        (score,) = (tmp_path / "proof" / "cases").glob(f"physics-{level}-*/score.json")
        result = json.loads(score.read_text())
        refused = level == "input_not_recorded" and result["input_stated"]
        assert result["returncode"] == 0 or refused, level
    assert "## By level" in (tmp_path / "proof" / "proof.md").read_text()
