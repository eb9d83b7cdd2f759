"""Logs from a bus and back onto one."""

from __future__ import annotations

import math
import time
from pathlib import Path

import can

from truck_bridge.bus import open_bus
from truck_bridge.can_logs.reader import need_asammdf, read
from truck_bridge.errors import InputError
from truck_bridge.j1939.ids import ADDRESS_CLAIMED, Identifier

COMMAND_PGNS = {0x0000, 0x0100, 0x0400, 0xEF00, ADDRESS_CLAIMED}  # TSC1, TC1, XBR, proprietary A; claims


def record(path: Path, interface: str, channel: str, duration: float | None = None) -> int:
    """Write a bus to a log until the duration or KeyboardInterrupt. Returns the number of frames."""
    if path.suffix.lower() == ".mf4":
        need_asammdf()
    bus = open_bus(interface, channel)
    count, end = 0, math.inf if duration is None else time.monotonic() + duration
    try:
        with can.Logger(str(path)) as log:
            while (left := end - time.monotonic()) > 0:
                message = bus.recv(min(left, 0.2))
                if message is not None:
                    log.on_message_received(message)
                    count += 1
    except KeyboardInterrupt:
        pass
    except (OSError, ValueError) as error:
        raise InputError(f"cannot record to {path}: {error}") from None
    finally:
        bus.shutdown()
    return count


def replay(path: Path, interface: str, channel: str, *, commands: bool = False, speed: float = 1.0) -> int:
    """Send a log's frames with their own timing; commands to a truck only where asked for. Returns how
    many.
    """
    frames = read(path)
    first = next(frames)
    bus = open_bus(interface, channel)
    count, start = 0, time.monotonic()
    try:
        for frame in (first, *frames):
            if not commands and Identifier.of(frame.can_id).pgn in COMMAND_PGNS:
                continue
            time.sleep(max(0.0, start + (frame.time - first.time) / speed - time.monotonic()))
            bus.send(can.Message(arbitration_id=frame.can_id, data=frame.data, is_extended_id=True))
            count += 1
    finally:
        bus.shutdown()
    return count
