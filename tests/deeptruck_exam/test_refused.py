"""Requests that an examination cannot meet: one line, and nothing is written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from deeptruck_core.errors import InputError
from deeptruck_exam.cases.plan import draw_plan
from deeptruck_exam.command import prove
from deeptruck_exam.folder import check_plant, check_real
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
