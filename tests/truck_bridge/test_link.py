"""The link alone: what a bus that fails, floods or comes back does to frames in and out."""

from __future__ import annotations

import time

import can
import pytest

from truck_bridge.j1939.address_claim import AddressClaim, name
from truck_bridge.link import BURST, RETRY_S, Link

CLAIM = 0x18EEFF2A


@pytest.fixture
def buses():
    made = [can.Bus(interface="virtual", channel="link") for _ in range(2)]
    yield made
    for bus in made:
        bus.shutdown()


@pytest.fixture
def link(buses):
    return Link(buses[0], AddressClaim(name(1), 0x2A))


def frame(**fields):
    return can.Message(**{"arbitration_id": 0x0CF00400, "data": bytes(8), **fields})


def test_only_extended_data_frames_are_heard(link, buses):
    others = ({"is_extended_id": False, "arbitration_id": 1}, {"is_remote_frame": True, "data": None}, {})
    for fields in others:
        buses[1].send(frame(**fields))
    assert link.hear(0.0) == [(0x0CF00400, bytes(8))]
    assert link.received == 1


def test_a_flood_is_taken_in_bursts(link, buses):
    for _ in range(BURST + 10):
        buses[1].send(frame())
    assert len(link.hear(0.0)) == BURST
    assert len(link.hear(0.0)) == 10


def test_bus_off_is_silence_until_the_next_try(link, buses):
    link.start(0.0)
    assert link.claims(0.0) == [(CLAIM, name(1))]
    assert link.up(0.3)
    buses[1].send(frame(arbitration_id=0x40, is_error_frame=True, is_extended_id=False))
    assert link.hear(0.4) == []
    assert (link.lost, link.up(0.5)) == (True, False)
    buses[1].send(frame())
    assert link.hear(0.5) == []
    assert link.claims(0.4 + RETRY_S - 0.01) == []
    assert link.claims(0.4 + RETRY_S) == [(CLAIM, name(1))]
    assert (link.lost, link.up(1.5), link.up(1.7)) == (False, False, True)


def test_a_bus_that_cannot_send_is_lost(link, buses):
    assert link.send(CLAIM, bytes(8), 0.0)
    assert link.sent == 1
    buses[0].shutdown()
    assert not link.send(CLAIM, bytes(8), 0.1)
    assert link.lost
    assert link.sent == 1


def test_a_bus_that_cannot_be_made_again_is_no_bus(link, buses):
    def fails():
        raise OSError("gone")

    link.reopen = fails
    buses[0].shutdown()
    assert not link.send(CLAIM, bytes(8), 0.0)
    assert link.claims(RETRY_S) == []
    assert not link.send(CLAIM, bytes(8), RETRY_S)
    begun = time.monotonic()
    link.wait(0.05)  # and does not spin
    assert time.monotonic() - begun >= 0.05


def test_what_ended_the_wait_is_heard_next(link, buses):
    buses[1].send(frame())
    link.wait(1.0)
    assert len(link.hear(0.0)) == 1
