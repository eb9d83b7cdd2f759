"""J1939-81: claim, contention, loss, echo, requests."""

from __future__ import annotations

import pytest

from truck_bridge.j1939.address_claim import AddressClaim, name

OURS = name(1000)
CLAIM, CANNOT = 0x18EEFF2A, 0x18EEFFFE


@pytest.fixture
def claim():
    claim = AddressClaim(OURS, 0x2A)
    claim.start(10.0)
    return claim


def test_the_name_holds_its_fields():
    word = int.from_bytes(name(0x12345, function=0x20, industry_group=1, manufacturer=0x7FF), "little")
    assert word & 0x1FFFFF == 0x12345
    assert (word >> 21) & 0x7FF == 0x7FF
    assert (word >> 40) & 0xFF == 0x20
    assert (word >> 60) & 7 == 1
    assert word >> 63 == 0  # cannot take another address


@pytest.mark.parametrize(("now", "claimed"), [(10.0, False), (10.249, False), (10.2501, True), (99.0, True)])
def test_claimed_after_250_ms_unopposed(claim, now, claimed):
    assert claim.due() == [(CLAIM, OURS)]
    assert claim.due() == []
    assert claim.claimed(now) == claimed


def test_not_started_is_not_claimed_and_hears_nothing():
    claim = AddressClaim(OURS, 0x2A)
    claim.hear(CLAIM, name(1))
    assert not claim.claimed(99.0)
    assert claim.due() == []


def test_a_lower_name_wins_and_we_fall_silent(claim):
    claim.due()
    claim.hear(CLAIM, name(999))
    assert claim.lost
    assert not claim.claimed(99.0)
    assert claim.due() == [(CANNOT, OURS)]


def test_a_higher_name_is_answered_and_we_stay(claim):
    claim.due()
    claim.hear(CLAIM, name(1001))
    assert claim.claimed(11.0)
    assert claim.due() == [(CLAIM, OURS)]


def test_our_own_echo_and_other_addresses_are_no_conflict(claim):
    claim.due()
    claim.hear(CLAIM, OURS)
    claim.hear(0x18EEFF2B, name(1))
    assert claim.claimed(11.0)
    assert claim.due() == []


@pytest.mark.parametrize(
    ("can_id", "answered"), [(0x18EAFF00, True), (0x18EA2A00, True), (0x18EA2B00, False)]
)
def test_a_request_is_answered(claim, can_id, answered):
    claim.due()
    claim.hear(can_id, bytes([0x00, 0xEE, 0x00]))
    assert claim.due() == ([(CLAIM, OURS)] if answered else [])
    claim.hear(can_id, bytes([0xEB, 0xFE, 0x00]))
    assert claim.due() == []


def test_a_lost_address_stays_lost_until_a_new_start(claim):
    claim.hear(CLAIM, name(1))
    claim.due()
    claim.hear(0x18EAFF00, bytes([0x00, 0xEE, 0x00]))
    assert claim.due() == [(CANNOT, OURS)]
    claim.hear(CLAIM, name(2000))
    assert claim.lost
    claim.start(20.0)
    assert claim.claimed(20.3)


def test_stop_gives_up_without_a_word(claim):
    claim.stop()
    assert claim.due() == []
    assert not claim.claimed(99.0)
