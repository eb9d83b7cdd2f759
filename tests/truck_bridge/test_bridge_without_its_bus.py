"""The bridge on a bus that lies, falls silent or goes away, and by a clock that goes back."""

from __future__ import annotations

import math

import can
import pytest
from bridge_world import RESEARCH, SIGNED, in_units

from truck_bridge.bus_connection import RETRY_S
from truck_bridge.j1939.address_claim import name as j1939_name


def test_an_address_lost_is_silence_and_stays_so(world):
    w = world("trucksim").engage(500.0)
    w.run(1.0, engine=500.0)
    w.ear.send(can.Message(arbitration_id=0x18EEFF2A, data=j1939_name(0)))
    w.received.clear()
    w.run(2.0, engine=500.0)
    assert [m.arbitration_id for _, m in w.received if m.arbitration_id & 0xFF == 0xFE] == [0x18EEFFFE]
    assert w.ours_on_the_bus() == []
    assert w.bridge.status.losses == {"link lost": 1}
    assert "no bus or no address" in w.bridge.engage(w.now, person=True, lead_vehicle=True)


def test_a_signed_message_bent_on_its_way_is_refused_whatever_the_bit(world):
    w = world(SIGNED).engage(500.0)
    w.run(2.0, engine=500.0)
    said = [bytes(m.data) for _, m in w.received if m.arbitration_id & 0x03FFFFFF == 0xFEBF0B]
    assert [data[7] & 15 for data in said] == [k % 16 for k in range(len(said))]
    assert w.bridge.status.refusals == {}
    bent = int.from_bytes(said[-1], "little")
    for bit in range(64):
        data = (bent ^ 1 << bit).to_bytes(8, "little")
        w.bridge.safety.rx_hook(0x18FEBF0B, data, w.now)
    assert w.bridge.status.refusals["EBC2 checksum"] == 64


def test_two_controllers_that_send_the_same_message_do_not_silence_each_other(world):
    w = world(RESEARCH).run(0.5)
    ccvs1 = {m.arbitration_id & 0xFF for _, m in w.received if m.arbitration_id & 0x03FFFF00 == 0xFEF100}
    assert ccvs1 == {0x00, 0x31}
    silent_on_speed = w.vehicle.codec["CCVS1"].encode({"BrakeSwitch": 0.0})
    w.trucks.send(can.Message(arbitration_id=0x18FEF131, data=silent_on_speed))
    w.signals = w.bridge.poll(w.now)
    assert w.signals["speed"] == pytest.approx(15.0, abs=0.5)
    w.trucks.send(can.Message(arbitration_id=0x18FEF100, data=silent_on_speed))
    assert math.isnan(w.bridge.poll(w.now)["speed"])


@pytest.mark.parametrize("jump", [-30.0, -0.05])
def test_a_clock_that_goes_back_is_answered_with_release_frames_in_time(world, name, jump):
    w = world(name).engage(in_units(name, 50))
    w.run(2.0, engine=in_units(name, 50))
    w.received.clear()
    since, true = w.now, w.bridge.poll
    w.bridge.poll = lambda now: true(now + jump)
    w.run(0.5)
    assert [at - since <= 0.09 for at, d in w.demands("engine") if math.isnan(d)] == [True] * 4
    assert not [d for _, d in w.demands("engine") if not math.isnan(d)]
    assert w.bridge.status.losses == {"clock went back": 1}
    assert w.bridge.status.address_claimed
    assert w.signals["speed"] == pytest.approx(w.truck.speed, abs=0.5)  # received anew


def test_no_signal_survives_a_clock_that_goes_back(world):
    w = world("trucksim").run(1.0)
    assert w.signals["speed"] == pytest.approx(15.0, abs=0.5)
    assert w.bridge.poll(w.now - 30.0) == {}


def test_a_lost_bus_is_reopened_silently(world):
    w = world("trucksim")
    spare = w.open()
    w.bridge._connection.reopen = lambda: spare
    w.engage(500.0)
    w.ours.shutdown()
    w.run(2.5, engine=500.0)
    assert w.bridge.status.state == "standby"
    assert w.bridge.status.address_claimed
    assert w.bridge.status.losses == {"link lost": 1}
    assert w.bridge.engage(w.now, person=True, lead_vehicle=True) == ()
    w.run(0.5, engine=500.0)
    assert w.bridge.status.engaged
    spare.shutdown()


def test_a_bus_that_stays_away_is_tried_again_and_again(world):
    w = world("trucksim")
    tries = []

    def reopen():
        tries.append(w.now)
        raise can.CanInitializationError("still gone")

    w.bridge._connection.reopen = reopen
    w.engage(500.0)
    w.ours.shutdown()
    w.run(4.5 * RETRY_S, engine=500.0)
    assert len(tries) == 4
    assert not w.bridge.status.address_claimed
