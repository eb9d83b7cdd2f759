"""Counters, checksums and identifiers."""

from __future__ import annotations

import pytest

from truck_bridge.j1939 import Identifier, checksums


@pytest.mark.parametrize("kind", checksums.KINDS)
def test_a_signed_frame_verifies_and_a_changed_one_does_not(kind):
    data = checksums.sign(kind, 0x0C00002A, bytes(range(8)), 13)
    assert checksums.verify(kind, 0x0C00002A, data)
    if kind == checksums.NONE:
        assert data[7] == 0xFF
        return
    assert data[7] & 0xF == 13 % checksums.COUNTERS[kind]
    noticed = [
        not checksums.verify(kind, 0x0C00002A, bytes([*data[:k], data[k] ^ 1, *data[k + 1 :]]))
        for k in range(7)
    ]
    assert all(noticed)
    assert not checksums.verify(kind, 0x0C00002B, data)


@pytest.mark.parametrize(
    ("kind", "total", "wanted"),
    [
        (checksums.TSC1, 0b11_010_001, 3 + 2 + 1),
        (checksums.TSC1, 0b01_111_101, (1 + 7 + 5) % 8),
        (checksums.TSC1, 0b1_11_010_001, 3 + 2 + 1),  # of a longer sum the low byte alone
        (checksums.XBR, 0x5A, 0x5 + 0xA),
        (checksums.XBR, 0x1F3, (0xF + 0x3) % 16),
    ],
)
def test_a_checksum_folds_the_sum_of_all_bytes(kind, total, wanted):
    """J1939-71: the low byte's three octal digits are added modulo 8, for XBR its two hexadecimal ones."""
    identifier, counter = 0x0C00002A, 5
    first = min(total - 0x0C - 0x2A - counter, 0xFF)
    data = bytes([first, total - 0x0C - 0x2A - counter - first, 0, 0, 0, 0, 0, counter])
    assert checksums.checksum(kind, identifier, data) == wanted


@pytest.mark.parametrize(
    ("can_id", "priority", "pgn", "destination", "source"),
    [
        (0x0CF00400, 3, 0xF004, 0xFF, 0x00),
        (0x0C00002A, 3, 0x0000, 0x00, 0x2A),
        (0x18EAFF00, 6, 0xEA00, 0xFF, 0x00),
        (0x18EF0B2A, 6, 0xEF00, 0x0B, 0x2A),
        (0x19FEF131, 6, 0x1FEF1, 0xFF, 0x31),
    ],
)
def test_identifiers_come_apart_and_together(can_id, priority, pgn, destination, source):
    assert Identifier.of(can_id) == Identifier(priority, pgn, destination, source)
    assert Identifier.of(can_id).can_id == can_id
