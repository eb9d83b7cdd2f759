"""J1939-81: claim, contention, loss, echo, requests."""

from __future__ import annotations

import time

import can
import j1939
import pytest

from truck_bridge.j1939.address_claim import AddressClaim, name

OURS = name(1000)
CLAIM, CANNOT = 0x18EEFF2A, 0x18EEFFFE


@pytest.fixture
def claim():
    claim = AddressClaim(OURS, 0x2A)
    claim.start(10.0)
    return claim


@pytest.mark.parametrize(("now", "claimed"), [(10.0, False), (10.249, False), (10.2501, True), (99.0, True)])
def test_claimed_after_250_ms_unopposed(claim, now, claimed):
    assert claim.due(10.0) == [(CLAIM, OURS)]
    assert claim.due(10.0) == []
    assert claim.claimed(now) == claimed


def test_a_lower_name_wins_and_we_fall_silent(claim):
    claim.due(10.0)
    claim.hear(CLAIM, name(999), 10.1)
    assert claim.lost
    assert not claim.claimed(99.0)
    assert claim.due(10.0) == [(CANNOT, OURS)]


def test_a_higher_name_is_answered_and_we_stay(claim):
    claim.due(10.0)
    claim.hear(CLAIM, name(1001), 10.1)
    assert claim.claimed(11.0)
    assert claim.due(10.0) == [(CLAIM, OURS)]


def test_our_own_echo_and_other_addresses_are_no_conflict(claim):
    claim.due(10.0)
    claim.hear(CLAIM, OURS, 10.1)
    claim.hear(0x18EEFF2B, name(1), 10.1)
    assert claim.claimed(11.0)
    assert claim.due(10.0) == []


@pytest.mark.parametrize(
    ("can_id", "answered"), [(0x18EAFF00, True), (0x18EA2A00, True), (0x18EA2B00, False)]
)
def test_a_request_is_answered(claim, can_id, answered):
    claim.due(10.0)
    claim.hear(can_id, bytes([0x00, 0xEE, 0x00]), 10.1)
    assert claim.due(10.0) == ([(CLAIM, OURS)] if answered else [])
    claim.hear(can_id, bytes([0xEB, 0xFE, 0x00]), 10.1)
    assert claim.due(10.0) == []


def test_a_lost_address_stays_lost_until_a_new_start(claim):
    claim.hear(CLAIM, name(1), 10.1)
    claim.due(10.0)
    claim.hear(0x18EAFF00, bytes([0x00, 0xEE, 0x00]), 10.1)
    assert claim.due(10.0) == [(CANNOT, OURS)]
    claim.hear(CLAIM, name(2000), 10.1)
    assert claim.lost
    claim.start(20.0)
    assert claim.claimed(20.3)


@pytest.mark.parametrize(("address", "waits"), [(127, False), (128, True), (247, True), (248, False)])
def test_an_address_that_was_ours_is_used_at_once_after_an_interruption(address, waits):
    claim = AddressClaim(OURS, address)
    claim.start(10.0)
    assert not claim.claimed(10.0)
    assert claim.claimed(10.3)
    claim.stop()
    assert not claim.claimed(10.4)
    claim.start(10.5)
    assert claim.claimed(10.5) == (not waits)
    assert claim.claimed(10.8)
    assert len(claim.due(10.8)) == 1


def test_a_twin_with_our_own_name_is_no_echo(claim):
    """Two runs with one vehicle file on one bus: who was there first gives way, as it may be in control."""
    claim.due(10.0)
    claim.hear(CLAIM, OURS, 10.25)
    assert claim.claimed(10.3)
    claim.hear(CLAIM, OURS, 10.26)
    assert not claim.claimed(10.3)
    assert claim.due(10.3) == [(CANNOT, OURS)]


class Rival:
    """can-j1939's own claim of the same address on the same bus, in real time."""

    def __init__(self, channel, identity):
        self.ecu = j1939.ElectronicControlUnit()
        self.ecu.connect(interface="virtual", channel=channel)
        its_name = j1939.Name(
            arbitrary_address_capable=0, industry_group=1, function=0xFF, manufacturer_code=0x7FF,
            identity_number=identity,
        )  # fmt: skip
        self.application = j1939.ControllerApplication(its_name, 0x2A)
        self.ecu.add_ca(controller_application=self.application)
        self.application.start()

    @property
    def has_it(self):
        return self.application.state == j1939.ControllerApplication.State.NORMAL

    def close(self):
        self.application.stop()
        self.ecu.disconnect()


@pytest.mark.parametrize(("identity", "ours", "first"), [(999, False, "we"), (1001, True, "they")])
def test_another_implementation_agrees_who_has_the_address(identity, ours, first):
    channel = object()
    bus = can.Bus(interface="virtual", channel=channel)
    rival = Rival(channel, identity) if first == "they" else None
    claim, begun = AddressClaim(OURS, 0x2A), time.monotonic()
    agreed = False
    while (now := time.monotonic()) < begun + 1.5 or (not agreed and now < begun + 60.0):
        if claim._started is None and now > begun + (0.5 if first == "they" else 0.0):
            claim.start(now)
        if rival is None and now > begun + 0.5:
            rival = Rival(channel, identity)
        while (message := bus.recv(0)) is not None:
            claim.hear(message.arbitration_id, bytes(message.data), now)
        for can_id, data in claim.due(now):
            bus.send(can.Message(arbitration_id=can_id, data=data))
        agreed = rival is not None and (claim.claimed(now), rival.has_it) == (ours, not ours)
        time.sleep(0.002)
    rival.close()
    bus.shutdown()
    assert agreed
