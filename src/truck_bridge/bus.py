"""A CAN bus between processes of one machine, over UDP on 127.0.0.1: a python-can interface for tests and the
demo.

A channel is a block of SLOTS ports. Every bus object holds one of them and sends each frame to all others;
there is no central process that could fail, nothing leaves the loopback device, and a killed process only
leaves a free port. Frames of one sender arrive in order; arbitration and bus load are not modelled.
"""

from __future__ import annotations

import select
import socket
import struct
import time
import zlib
from typing import Any

import can

from truck_bridge.errors import InputError

SLOTS = 12  # buses on one channel at a time; fewer where two names share a block
FIRST_PORT, BLOCKS = 20_000, 1_000  # ports 20000..31999, below the kernel's ephemeral range
_FRAME = struct.Struct("<4sIIBB8s")  # magic, channel, identifier and flags, length, padding, data
_MAGIC = b"dtCB"
_EXTENDED, _REMOTE, _ERROR = 1 << 31, 1 << 30, 1 << 29  # as SocketCAN packs them
_BUFFER_BYTES = 4 << 20


class LoopbackBus(can.BusABC):
    """`can.Bus(interface="loopback", channel=NAME)`; every name or number is a separate bus.

    Raises can.CanInitializationError when all SLOTS of the channel are taken.
    """

    def __init__(self, channel: str | int = "0", receive_own_messages: bool = False, **kwargs: Any) -> None:
        self._tag = zlib.crc32(str(channel).encode())
        self._own = receive_own_messages
        first = FIRST_PORT + SLOTS * (self._tag % BLOCKS)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
        self._socket.setblocking(False)
        port = self._take_slot(first, channel)
        self._peers = [("127.0.0.1", first + k) for k in range(SLOTS) if first + k != port]
        self._echo: list[can.Message] = []
        self._name = "_".join(str(channel).split())  # one word: text logs part their columns by spaces
        self.channel_info = f"loopback channel {channel} (127.0.0.1:{port})"
        self._can_protocol = can.CanProtocol.CAN_20
        super().__init__(channel=channel, **kwargs)

    def _take_slot(self, first: int, channel: str | int) -> int:
        for port in range(first, first + SLOTS):
            try:
                self._socket.bind(("127.0.0.1", port))
                return port
            except OSError:
                continue
        self._socket.close()
        raise can.CanInitializationError(f"loopback channel {channel} already has {SLOTS} buses")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send to every other bus of the channel; never blocks. A receiver with a full buffer loses the
        frame, as on a wire."""
        identifier = msg.arbitration_id | _EXTENDED * msg.is_extended_id
        identifier |= _REMOTE * msg.is_remote_frame | _ERROR * msg.is_error_frame
        packet = _FRAME.pack(_MAGIC, self._tag, identifier, msg.dlc, 0, bytes(msg.data))
        try:
            for peer in self._peers:
                self._socket.sendto(packet, peer)
        except BlockingIOError:
            raise can.CanOperationError("loopback send buffer is full") from None
        except OSError as error:
            raise can.CanOperationError(f"loopback bus is gone: {error}") from None
        if self._own:
            self._echo.append(msg)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if self._echo:
            return self._echo.pop(0), False
        try:
            if timeout != 0:
                select.select([self._socket], [], [], timeout)
            packet = self._socket.recv(64)
        except BlockingIOError:
            return None, False
        except (OSError, ValueError) as error:  # closed under our feet
            raise can.CanOperationError(f"loopback bus is gone: {error}") from None
        return self._parse(packet), False

    def _parse(self, packet: bytes) -> can.Message | None:
        if len(packet) != _FRAME.size:
            return None
        magic, tag, identifier, dlc, _, data = _FRAME.unpack(packet)
        if magic != _MAGIC or tag != self._tag or dlc > 8:
            return None  # another channel that shares the block, or a stranger
        return can.Message(
            timestamp=time.time(),
            arbitration_id=identifier & 0x1FFF_FFFF,
            is_extended_id=bool(identifier & _EXTENDED),
            is_remote_frame=bool(identifier & _REMOTE),
            is_error_frame=bool(identifier & _ERROR),
            dlc=dlc,
            data=None if identifier & _REMOTE else data[:dlc],
            channel=self._name,
        )

    def fileno(self) -> int:
        """File descriptor for select and can.Notifier."""
        return self._socket.fileno()

    def shutdown(self) -> None:
        """Free the slot."""
        super().shutdown()
        self._socket.close()

    @staticmethod
    def _detect_available_configs() -> list[dict[str, Any]]:
        return [{"interface": "loopback", "channel": "0"}]


def open_bus(interface: str, channel: str, **options: object) -> can.BusABC:
    """A python-can bus. Raises InputError with one line if it cannot be opened."""
    try:
        return can.Bus(interface=interface, channel=channel, **options)
    except (can.CanError, OSError, ValueError, NotImplementedError, ImportError) as error:
        text = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"cannot open CAN interface '{interface}' channel '{channel}': {text}") from None
