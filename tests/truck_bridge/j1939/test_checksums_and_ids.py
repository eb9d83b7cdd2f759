"""Counters, checksums, identifiers and broadcasts."""

from __future__ import annotations

import pytest

from truck_bridge.j1939 import Identifier, checksums
from truck_bridge.j1939.transport import Broadcasts, reference_torque


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


def packets(data, pgn=0xFEE3, source=0):
    count = -(-len(data) // 7)
    yield (
        0x1CECFF00 | source,
        bytes([32, *len(data).to_bytes(2, "little"), count, 255, *pgn.to_bytes(3, "little")]),
    )
    padded = data + b"\xff" * 7
    for k in range(count):
        yield 0x1CEBFF00 | source, bytes([k + 1]) + padded[7 * k : 7 * k + 7]


def test_a_broadcast_is_put_together_and_holds_the_reference_torque():
    """The engine configuration of the public recording: SPN 544 in bytes 20 and 21."""
    data = bytes.fromhex("a816b13052c2e81cb96022c7c044cb8057ffff5504385e1446fa7dc780578600f702")
    heard = Broadcasts()
    found = [heard.hear(*packet) for packet in packets(data)]
    assert found[:-1] == [None] * (len(found) - 1)
    assert found[-1] == (0xFEE3, 0, data)
    assert reference_torque(0xFEE3, data) == 1109.0
    assert reference_torque(0xFEE1, data) is None
    assert reference_torque(0xFEE3, data[:20]) is None
    assert reference_torque(0xFEE3, data[:19] + b"\xff\xff") is None


def test_a_broadcast_with_a_hole_is_dropped_by_the_next():
    heard, data = Broadcasts(), bytes(range(30))
    first = list(packets(data))
    assert all(heard.hear(*packet) is None for packet in [*first[:2], *first[3:]])
    assert [heard.hear(*packet) for packet in first][-1] == (0xFEE3, 0, data)


def test_two_sources_do_not_mix():
    heard = Broadcasts()
    a, b = list(packets(b"a" * 20, source=1)), list(packets(b"b" * 20, source=2))
    found = [heard.hear(*packet) for pair in zip(a, b, strict=True) for packet in pair]
    assert [f for f in found if f] == [(0xFEE3, 1, b"a" * 20), (0xFEE3, 2, b"b" * 20)]


def test_data_without_announcement_is_nothing():
    assert Broadcasts().hear(0x1CEBFF00, bytes(8)) is None
