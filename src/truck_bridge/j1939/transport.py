"""Multi-packet broadcasts (J1939-21, 5.10: BAM), put together from a log or a bus."""

from __future__ import annotations

from truck_bridge.j1939 import ids

_BAM = 32
ENGINE_CONFIGURATION = 0xFEE3  # EC1; bytes 20-21 are SPN 544, the engine reference torque, 1 N m a bit


class Broadcasts:
    """Feed frames to `hear`; it returns (pgn, source, data) when a broadcast is complete."""

    def __init__(self) -> None:
        self._open: dict[int, tuple[int, int, int, dict[int, bytes]]] = {}

    def hear(self, can_id: int, data: bytes) -> tuple[int, int, bytes] | None:
        """Take one frame. A broadcast with a packet missing is dropped when the next one starts."""
        pgn, source = ids.pgn_of(can_id), can_id & 0xFF
        if pgn == ids.TRANSPORT_CONTROL and len(data) == 8 and data[0] == _BAM:
            carried = int.from_bytes(data[5:8], "little")
            self._open[source] = (carried, int.from_bytes(data[1:3], "little"), data[3], {})
        elif pgn == ids.TRANSPORT_DATA and len(data) == 8 and source in self._open:
            carried, size, packets, parts = self._open[source]
            parts[data[0]] = data[1:]
            if len(parts) == packets and set(parts) == set(range(1, packets + 1)):
                del self._open[source]
                return carried, source, b"".join(parts[k] for k in sorted(parts))[:size]
        return None


def reference_torque(pgn: int, data: bytes) -> float | None:
    """Engine reference torque, N m, where the broadcast is an engine configuration that says it."""
    if pgn != ENGINE_CONFIGURATION or len(data) < 21:
        return None
    raw = int.from_bytes(data[19:21], "little")
    return float(raw) if raw <= 0xFAFF else None
