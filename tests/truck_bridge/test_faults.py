"""Each fault in lock-step, and the judge against a bridge without a core."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from truck_bridge.safety import Safety

sys.path.insert(0, str(Path(__file__).parent))  # the runs are scripts, and stand beside each other
import fault_runs


@pytest.mark.parametrize("fault", list(fault_runs.FAULTS))
def test_no_invariant_breaks(fault, monkeypatch):
    monkeypatch.setattr(fault_runs, "FAULTS", {fault: fault_runs.FAULTS[fault]})
    verdict = fault_runs.play(0)
    assert verdict.engaged
    assert verdict.broken == ()


def test_runs_repeat_by_their_seed():
    assert fault_runs.play(11) == fault_runs.play(11)


@pytest.mark.parametrize("fault", ["brake pedal", "controller gone", "cancel"])
def test_the_judge_notices_a_bridge_without_a_core(fault, monkeypatch):
    monkeypatch.setattr(Safety, "release", lambda self, now, reason="": None)
    monkeypatch.setattr(Safety, "fade", lambda self, now, reason: None)
    monkeypatch.setattr(fault_runs, "FAULTS", {fault: fault_runs.FAULTS[fault]})
    assert fault_runs.play(0).broken


def test_the_judge_notices_a_step(monkeypatch):
    safety = sys.modules["truck_bridge.safety.core"].Safety
    monkeypatch.setattr(
        safety, "plan", lambda self, axis, now: 60.0 * (int(now * 5) % 2) * (axis.name == "engine")
    )
    monkeypatch.setattr(safety, "tx_hook", lambda self, can_id, data, now: True)
    monkeypatch.setattr(fault_runs, "FAULTS", {"nothing": fault_runs.FAULTS["nothing"]})
    broken = " ".join(fault_runs.play(0).broken)
    assert "stepped" in broken
    assert "before engagement" in broken
