"""Which faults are active when, and what the channels say of them."""

from __future__ import annotations

import pytest

from truck_bridge.faults import HOLD_S, MOST, ActiveFaults, Fault
from truck_bridge.j1939.diagnostics import LAMPS, Code, Report, report

HOT, DERATED = Code(110, 16), Code(1569, 31)
CLEAR = report(bytes.fromhex("00FF00000000FFFF"))


def said(*codes, lamps=()):
    return Report({lamp: lamp in lamps for lamp in LAMPS}, dict.fromkeys(codes, 1))


def test_nothing_is_known_before_the_first_dm1():
    faults = ActiveFaults()
    assert (faults.active(0.0), faults.channels(0.0)) == ([], {})
    faults.take(0, CLEAR, 1.0)
    assert faults.active(1.0) == []
    assert set(faults.channels(1.0).values()) == {0.0}


def test_a_fault_is_active_while_it_is_said_and_for_five_seconds():
    faults = ActiveFaults()
    for now in (0.0, 4.0, 8.0):
        faults.take(0, said(HOT, lamps=["red_stop_lamp"]), now)
    both = [Fault(0, HOT), Fault(0, "red_stop_lamp")]
    assert faults.active(8.0 + HOLD_S) == both
    assert faults.active(8.0 + HOLD_S + 1e-6) == []
    faults.take(0, CLEAR, 9.0)  # another controller with the same address may have said it
    assert faults.active(9.0) == both
    faults.take(0, CLEAR, 14.0)
    assert faults.active(14.0) == []


@pytest.mark.parametrize("derate", [DERATED, Code(5, 31, (1569,))])
def test_the_channels_show_the_newest_code_and_a_derate(derate):
    faults = ActiveFaults()
    faults.take(0, said(Code(191, 9), lamps=["malfunction_lamp"]), 0.0)
    faults.take(0, said(Code(191, 9), HOT), 1.0)
    shown = faults.channels(1.0)
    assert (shown["fault_count"], shown["fault_spn"], shown["fault_fmi"]) == (2.0, 110.0, 16.0)
    assert (shown["derate_active"], shown["malfunction_lamp"], shown["red_stop_lamp"]) == (0.0, 1.0, 0.0)
    faults.take(0, said(derate), 2.0)
    assert faults.channels(2.0)["derate_active"] == 1.0
    faults.take(0, CLEAR, 9.0)
    assert set(faults.channels(9.0).values()) == {0.0}


def test_beyond_the_most_faults_are_counted_until_some_have_ended():
    faults = ActiveFaults()
    for n in range(3 * MOST):
        faults.take(n % 200, said(Code(1000 + n, 1)), 1e-3 * n)
    assert len(faults.active(0.5)) == MOST and faults.left_out == 2 * MOST
    faults.take(0, said(HOT), 1.0 + HOLD_S)
    assert Fault(0, HOT) in faults.active(1.0 + HOLD_S)
