"""The connection alone: what a bus that fails, floods or comes back does to frames in and out."""

from __future__ import annotations

import time

import can
import pytest

from truck_bridge.bus_connection import BURST, RETRY_S, BusConnection
from truck_bridge.j1939.address_claim import AddressClaim, name

CLAIM = 0x18EEFF2A


@pytest.fixture
def buses():
    made = [can.Bus(interface="virtual", channel="link") for _ in range(2)]
    yield made
    for bus in made:
        bus.shutdown()


@pytest.fixture
def connection(buses):
    return BusConnection(buses[0], AddressClaim(name(1), 0x2A))


def frame(**fields):
    return can.Message(**{"arbitration_id": 0x0CF00400, "data": bytes(8), **fields})


def test_only_extended_data_frames_are_heard(connection, buses):
    others = ({"is_extended_id": False, "arbitration_id": 1}, {"is_remote_frame": True, "data": None}, {})
    for fields in others:
        buses[1].send(frame(**fields))
    assert connection.hear(0.0) == [(0x0CF00400, bytes(8))]
    assert connection.received == 1


def test_a_flood_is_taken_in_bursts(connection, buses):
    for _ in range(BURST + 10):
        buses[1].send(frame())
    assert len(connection.hear(0.0)) == BURST
    assert len(connection.hear(0.0)) == 10


@pytest.mark.parametrize("hears", [True, False])
def test_bus_off_is_silence_until_a_frame_is_heard_or_the_next_try(connection, buses, hears):
    connection.start(0.0)
    assert connection.claims(0.0) == [(CLAIM, name(1))]
    assert connection.up(0.3)
    buses[1].send(frame(arbitration_id=0x40, is_error_frame=True, is_extended_id=False))
    assert connection.hear(0.4) == []
    assert (connection.lost, connection.up(0.4)) == (True, False)
    assert connection.claims(0.4) == []
    if hears:
        buses[1].send(frame())
        assert connection.hear(0.41) == [(0x0CF00400, bytes(8))]
        assert connection.claims(0.41) == [(CLAIM, name(1))]
    else:
        assert connection.claims(0.4 + RETRY_S - 0.01) == []
        assert connection.claims(0.4 + RETRY_S) == [(CLAIM, name(1))]
    assert (connection.lost, connection.up(0.55)) == (False, True)


def test_an_unplugged_bus_is_not_heard(connection, buses):
    connection.start(0.0)
    buses[0].shutdown()
    assert not connection.send(CLAIM, bytes(8), 0.3)
    assert connection.hear(0.31) == []
    assert connection.lost


def test_a_bus_that_is_off_at_the_start_is_claimed_by_the_next_try(connection, buses):
    buses[1].send(frame(arbitration_id=0x40, is_error_frame=True, is_extended_id=False))
    connection.start(0.0)
    assert connection.lost
    assert connection.claims(RETRY_S - 0.01) == []
    assert connection.claims(RETRY_S) == [(CLAIM, name(1))]


def test_a_flooded_bus_does_not_keep_the_bridge_from_starting(connection, buses, monkeypatch):
    monkeypatch.setattr(buses[0], "recv", lambda timeout: frame())
    connection.start(0.0)
    assert connection.claims(0.0) == [(CLAIM, name(1))]


def test_a_bus_that_cannot_send_is_lost(connection, buses):
    assert connection.send(CLAIM, bytes(8), 0.0)
    assert connection.sent == 1
    buses[0].shutdown()
    assert not connection.send(CLAIM, bytes(8), 0.1)
    assert connection.lost
    assert connection.sent == 1


def test_a_bus_that_cannot_be_made_again_is_no_bus(connection, buses):
    def fails():
        raise OSError("gone")

    connection.reopen = fails
    buses[0].shutdown()
    assert not connection.send(CLAIM, bytes(8), 0.0)
    assert connection.claims(RETRY_S) == []
    assert not connection.send(CLAIM, bytes(8), RETRY_S)
    begun = time.monotonic()
    connection.wait(0.05)  # and does not spin
    assert time.monotonic() - begun >= 0.05


def test_what_ended_the_wait_is_heard_next(connection, buses):
    buses[1].send(frame())
    connection.wait(1.0)
    assert len(connection.hear(0.0)) == 1
