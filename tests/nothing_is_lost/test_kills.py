"""Runs that are ended at random moments; `python tests/nothing_is_lost/kills.py --runs 200` tries more."""

from __future__ import annotations

import kills
import pytest


@pytest.mark.long
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("command", [command.name for command in kills.COMMANDS])
def test_an_ended_run_leaves_nothing_half_written_and_is_gone_on_with(command: str) -> None:
    assert [one for one in kills.disturbed([command], runs=4, seed=1) if one.wrong] == []
