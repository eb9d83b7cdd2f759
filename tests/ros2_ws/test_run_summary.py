"""The last words of a run, of signals whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_nodes import run_summary
from deeptruck_nodes.run_summary import Signals

TIME = 0.1 * np.arange(101)


def run(gap: float = 20.0, stamps: np.ndarray = TIME) -> Signals:
    gaps = np.full(101, gap)
    gaps[0] = np.nan  # nothing seen yet
    engaged = ((TIME > 0.95) & (TIME < 5.95) | (TIME > 7.95)).astype(float)
    return Signals((TIME, gaps), (TIME, engaged), stamps)


def test_gap_control_and_hand_backs() -> None:
    assert run_summary.sentences(run(), real_time=True) == [
        "smallest gap 20.0 m, no crash",
        "in control 7 of 10 s, handed back 1 time",
    ]
    assert run_summary.sentences(run(-0.5), real_time=True)[0] == "smallest gap 0.0 m, 1 crash"


def test_what_the_controller_counted_is_said() -> None:
    counts = {"drop_outs": 3, "shield_interventions": 1, "full_brakings": 0, "shield_acted": 9}
    assert run_summary.hazards(counts) == (
        "the radar lost the leader 3 times, the shield acted 1 time, the truck was braked fully 0 times"
    )


@pytest.mark.parametrize(("real_time", "says"), [(True, "late by up to 120 ms, 1 time"), (False, "")])
def test_a_late_machine_is_said_in_real_time_alone(real_time: bool, says: str) -> None:
    late = TIME + 0.12 * (TIME > 4.0)
    found = run_summary.sentences(run(stamps=late), real_time=real_time)
    assert (says in found[-1]) if says else len(found) == 2


def test_nothing_is_said_of_what_was_not_recorded() -> None:
    empty = np.zeros(0)
    assert run_summary.sentences(Signals((empty, empty), (empty, empty), empty), real_time=True) == []
