"""One frame of a CAN log, of any class, and its conversion to and from python-can."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

import can

ERROR_FLAG, REMOTE_FLAG, EXTENDED_FLAG = 0x2000_0000, 0x4000_0000, 0x8000_0000  # SocketCAN, in an identifier
EXTENDED_MASK, STANDARD_MASK = 0x1FFF_FFFF, 0x7FF
COPY = "copy the log anew from where it was recorded"


class Kind(Enum):
    """Content of a frame; the value is its name in an account."""

    DATA = "data frames"
    REMOTE = "remote frames"
    FD = "CAN FD frames"
    ERROR = "error frames"


class Frame(NamedTuple):
    """One frame of a log; time in s as in the log.

    `channel` is the bus as the log names it: can0, or the number of an ASC, BLF or TRC channel. `extended` is
    the class of the identifier, by the log's notation and not by its value, because 29-bit identifiers below
    0x800 exist and are the most urgent. `length` is the number of bytes that a remote frame requests or,
    where the log states it beside the bytes, that a data frame has; `rate` and `passive` are the bit-rate
    switch and the error state of a CAN FD frame.
    """

    time: float
    can_id: int
    data: bytes
    channel: str = ""
    extended: bool = True
    kind: Kind = Kind.DATA
    length: int = 0
    rate: bool = False
    passive: bool = False

    @property
    def is_short(self) -> bool:
        """Whether bytes lack that the log states."""
        return self.kind is Kind.DATA and len(self.data) < self.length

    @property
    def message(self) -> can.Message:
        """The frame as a python-can message."""
        remote = self.kind is Kind.REMOTE
        return can.Message(
            timestamp=self.time,
            arbitration_id=self.can_id,
            is_extended_id=self.extended,
            is_remote_frame=remote,
            is_error_frame=self.kind is Kind.ERROR,
            is_fd=self.kind is Kind.FD,
            bitrate_switch=self.rate,
            error_state_indicator=self.passive,
            dlc=self.length if remote else len(self.data),
            data=None if remote else self.data,
            channel=self.bus,
        )

    @property
    def bus(self) -> str:
        """The channel in SocketCAN's naming: channel 1 of an ASC, BLF or TRC log is can0."""
        if self.channel.isdigit():
            return f"can{max(0, int(self.channel) - 1)}"
        return self.channel or "can0"


def of_raw(time: float, raw: int, data: bytes, channel: str, *, extended: bool = False) -> Frame:
    """The frame of a number with SocketCAN's flags in its upper bits, as captures, databases and some loggers
    write identifiers: bit 31 for an extended one, 30 for a request, 29 for an error.

    `extended` says that the log calls it so. Raises ValueError for a number of more bits.
    """
    if not 0 <= raw <= 0xFFFF_FFFF:
        raise ValueError("an identifier that cannot be")
    kind = (
        Kind.ERROR if raw & ERROR_FLAG
        else Kind.REMOTE if raw & REMOTE_FLAG
        else Kind.DATA
    )  # fmt: skip
    extended = extended or bool(raw & EXTENDED_FLAG) or (raw & EXTENDED_MASK) > STANDARD_MASK
    return Frame(time, raw & EXTENDED_MASK, b"" if kind is Kind.REMOTE else data, channel, extended, kind)


def of_message(message: can.Message, first_bus: int = 1) -> Frame:
    """The frame of a message from one of python-can's readers, which counts buses from `first_bus`; as in the
    log they are counted from 1."""
    bus = message.channel
    channel = str(bus + 1 - first_bus) if isinstance(bus, int) else bus or "1"
    kind = (
        Kind.ERROR if message.is_error_frame
        else Kind.FD if message.is_fd
        else Kind.REMOTE if message.is_remote_frame
        else Kind.DATA
    )  # fmt: skip
    return Frame(
        message.timestamp,
        message.arbitration_id,
        bytes(message.data),
        channel,
        message.is_extended_id,
        kind,
        0 if message.is_fd else message.dlc,
        message.bitrate_switch,
        message.error_state_indicator,
    )
