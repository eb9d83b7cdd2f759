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
