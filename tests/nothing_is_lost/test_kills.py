"""Runs that are ended at random moments; `python tests/nothing_is_lost/kills.py --runs 200` tries more."""

from __future__ import annotations

import kills
import pytest

QUICKEST = ("train", "record")  # one that goes on by --resume, and the recorder


@pytest.mark.timeout(3600)
@pytest.mark.parametrize(
    "command",
    [
        pytest.param(name, marks=pytest.mark.long if name in QUICKEST else pytest.mark.hours)
        for name in kills.COMMANDS
    ],
)
def test_an_ended_run_leaves_nothing_half_written_and_is_gone_on_with(command: str) -> None:
    assert [what for what in kills.disturbed([command], runs=2, seed=1) if what[1]] == []
