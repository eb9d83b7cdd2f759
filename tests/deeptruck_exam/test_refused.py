"""Requests that an examination cannot meet: one line, and nothing is written."""

from __future__ import annotations

import json
import operator
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from deeptruck_core.errors import InputError
from deeptruck_exam.cases.levels import LEVELS
from deeptruck_exam.cases.plan import draw_plan
from deeptruck_exam.command import prove
from deeptruck_exam.folder import check_plant, check_real
from deeptruck_exam.jobs import in_parallel
from deeptruck_exam.real.fleets import examine_real

REFUSED: dict[str, tuple[Callable[[Path], object], str]] = {
    "a plan of no level": (lambda here: draw_plan("easy", 0, None, "physics", 4.0), "levels"),
    "a plan of no law": (lambda here: draw_plan("noise", 0, "gremlins", "physics", 4.0), "laws"),
    "no level": (lambda here: prove(here / "out", levels=["easy"]), "there is no 'easy'"),
    "no simulator": (lambda here: prove(here / "out", simulators=["kraken"]), "there is no 'kraken'"),
    "no resumption": (lambda here: prove(here / "mine", resume=False), "exists"),
    "somebody's folder": (lambda here: prove(here / "mine"), "holds notes.txt"),
    "a file": (lambda here: prove(here / "mine" / "notes.txt"), "is a file"),
    "no plant": (lambda here: check_plant("multi-body", here / "out"), "there is no 'multi-body'"),
    "no logs": (lambda here: check_real(here / "nowhere", here / "out"), "there is no folder"),
    "no log of ours": (lambda here: examine_real(here / "mine", here / "out"), "none of the logs"),
    "somebody's result": (lambda here: check_real(Path(__file__).parent, here / "mine"), "holds notes.txt"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_request_that_cannot_be_met_is_one_line(name: str, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("mine")
    call, says = REFUSED[name]
    with pytest.raises(InputError, match=says) as refused:
        call(tmp_path)
    assert "\n" not in str(refused.value)
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["mine", "notes.txt"]


# Cases side by side


def test_each_comes_with_its_result() -> None:
    assert dict(in_parallel(operator.neg, [1, 2, 3], 2, "cases")) == {1: -1, 2: -2, 3: -3}


def test_a_killed_process_is_one_line() -> None:
    with pytest.raises(InputError, match="a process was killed; is there memory for 1 at once"):
        list(in_parallel(os._exit, [1], 1, "cases"))


# `prove` on one case of every level, from the drawing of the truck to the page


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
