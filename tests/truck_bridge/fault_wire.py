"""What a bad wire does to arriving frames: lose, hold, repeat, swap or bend them; and a bus that does so."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import can
import numpy as np
from fault_lies import Lie

FAULTS = ("drop", "delay", "repeat", "reorder", "corrupt")
LONGEST_S = 0.6  # that a delayed frame is late
Inbox = deque[tuple[float, can.Message]]  # when it may be taken, and the frame


def arrive(message: can.Message, fault: str, rng: np.random.Generator, inbox: Inbox, now: float) -> None:
    """A frame arrives, with the fault on every second one."""
    late = 0.0
    if fault and rng.random() < 0.5:
        if fault == "drop":
            return
        if fault == "repeat":
            inbox.append((now, message))
        if fault == "delay":
            late = float(rng.uniform(0.0, LONGEST_S))
        if fault == "corrupt":
            message = bent(message, int(rng.integers(64)))
        if fault == "reorder" and inbox:
            inbox.insert(int(rng.integers(len(inbox))), (now, message))
            return
    inbox.append((now + late, message))


def bent(message: can.Message, bit: int) -> can.Message:
    """The frame with one bit changed, as no CAN controller would deliver it."""
    word = int.from_bytes(bytes(message.data).ljust(8, b"\0"), "little") ^ 1 << bit
    return can.Message(arbitration_id=message.arbitration_id, data=word.to_bytes(8, "little"))


def take(inbox: Inbox, now: float) -> can.Message | None:
    """The first frame whose time has come."""
    for number, (due, message) in enumerate(inbox):
        if due <= now + 1e-9:
            del inbox[number]
            return message
    return None


def told(
    lies: list[Lie], waiting: deque[can.Message], source: Callable[[], can.Message | None], now: float
) -> can.Message | None:
    """The next frame, or what lies make of it, one after the other: one frame, several or none."""
    while not waiting and (message := source()) is not None:
        frames = [message]
        for lie in lies:
            frames = [bent for one in frames for bent in lie.messages(one, now)]
        waiting.extend(frames)
    return waiting.popleft() if waiting else None


class Wire(can.BusABC):
    """An in-memory bus in simulated time."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._can_protocol = can.CanProtocol.CAN_20
        self.channel_info = "wire"
        self.rng = rng
        self.peer: Wire | None = None
        self.inbox: Inbox = deque()
        self.sent: list[tuple[float, int, bytes]] = []
        self.now = 0.0
        self.fault = ""
        self.down = False
        self.lies: list[Lie] = []  # about the frames that arrive here
        self._told: deque[can.Message] = deque()
        super().__init__(channel="wire")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.down:
            raise can.CanOperationError("unplugged")
        self.sent.append((self.now, msg.arbitration_id, bytes(msg.data)))
        assert self.peer is not None
        arrive(msg, self.peer.fault, self.rng, self.peer.inbox, self.now)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The next frame; without the filters and the waiting of `BusABC`, which take as long as the rest."""
        if self.down:
            raise can.CanOperationError("unplugged")
        if not self.inbox and not self._told:
            return None
        return told(self.lies, self._told, lambda: take(self.inbox, self.now), self.now)
