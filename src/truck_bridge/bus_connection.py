"""The bridge's connection: the bus and its address on it. A lost connection is restored automatically."""

from __future__ import annotations

import time
from collections.abc import Callable

import can

from truck_bridge.j1939.address_claim import AddressClaim

RETRY_S = 0.1  # between attempts to bring a lost bus back
BURST = 2000  # frames taken at one time, so that a flood cannot starve the sender
MOST_BURSTS = 100  # dropped at the start: half a minute of a full bus of 1 Mbit/s
_BUS_OFF = 0x40  # SocketCAN error class
_GONE = (can.CanError, OSError, ValueError)  # as python-can's back ends say that their bus is


class BusConnection:
    """Receives and sends frames. `reopen` makes a new bus if the old one does not recover."""

    def __init__(
        self, bus: can.BusABC, claim: AddressClaim, reopen: Callable[[], can.BusABC] | None = None
    ) -> None:
        self.reopen = reopen
        self.sent = self.received = 0
        self._bus: can.BusABC | None = bus
        self._claim = claim
        self._inbox: list[can.Message] = []
        self._retry_at: float | None = None  # when to try a lost bus again
        self._off = False  # lost by an error frame: a controller that hears again is on the bus again

    def start(self, now: float) -> None:
        """Claim the address. Frames that waited in the bus are discarded: their values are old but would
        count as fresh, and their simultaneous arrival would look like a message sent too often."""
        for _ in range(MOST_BURSTS):  # a flooded bus never runs empty
            if len(self._taken(now)) < BURST:
                break
        if not self.lost:  # else the next try claims it
            self._claim.start(now)

    def stop(self) -> None:
        """Give the address up without sending a message."""
        self._claim.stop()

    @property
    def lost(self) -> bool:
        """Whether the bus is lost and will be tried again."""
        return self._retry_at is not None

    def up(self, now: float) -> bool:
        """Whether the bus is connected and the address is claimed."""
        return not self.lost and self._claim.claimed(now)

    def rewind(self, back: float) -> None:
        """Correct for a clock that was set back by `back`, s."""
        self._retry_at = None if self._retry_at is None else self._retry_at - back

    def wait(self, timeout: float) -> None:
        """Wait for a frame or the timeout, s; the frame is returned by the next `hear`."""
        timeout = max(timeout, 0.0)
        try:
            message = None if self._bus is None else self._bus.recv(timeout)
        except _GONE:
            message = None
            time.sleep(timeout)
        if message is not None:
            self._inbox.append(message)
        elif self._bus is None:
            time.sleep(timeout)

    def hear(self, now: float) -> list[tuple[int, bytes]]:
        """Identifier and data of the extended data frames received."""
        frames = [
            (message.arbitration_id, bytes(message.data))
            for message in self._taken(now)
            if message.is_extended_id and not (message.is_error_frame or message.is_remote_frame)
        ]
        self.received += len(frames)
        for can_id, data in frames:
            self._claim.hear(can_id, data, now)
        return frames

    def _taken(self, now: float) -> list[can.Message]:
        messages, self._inbox = self._inbox, []
        try:
            while self._bus is not None and (self._off or not self.lost) and len(messages) < BURST:
                message = self._bus.recv(0)
                if message is None:
                    break
                messages.append(message)
        except _GONE:
            self._drop(now)
        if any(message.is_error_frame and message.arbitration_id & _BUS_OFF for message in messages):
            self._drop(now)
            self._off = True
        elif self._off and messages:
            self._recover(now)
        return messages

    def claims(self, now: float) -> list[tuple[int, bytes]]:
        """Retry a lost bus when due. Returns frames of the address claim to send now."""
        if self._retry_at is not None and now >= self._retry_at:
            self._retry(now)
        return self._claim.due(now)

    def _retry(self, now: float) -> None:
        self._retry_at = now + RETRY_S
        if self.reopen is not None:
            try:
                if self._bus is not None:
                    self._bus.shutdown()
                self._bus = self.reopen()
            except _GONE:
                self._bus = None
                return
        self._recover(now)

    def _recover(self, now: float) -> None:
        self._retry_at, self._off = None, False
        self._claim.start(now)

    def send(self, can_id: int, data: bytes, now: float) -> bool:
        """Send a frame; False if the bus is lost."""
        if self._bus is None:
            return False
        try:
            self._bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=True))
        except _GONE:
            self._drop(now)
            return False
        self.sent += 1
        return True

    def _drop(self, now: float) -> None:
        """Neither receive nor send until the next attempt."""
        self._claim.stop()
        self._retry_at = now + RETRY_S
