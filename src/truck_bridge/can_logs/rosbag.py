"""Raw CAN frames in a rosbag: can_msgs/msg/Frame, the type of ros2_socketcan and Foxglove.

The common interfaces have no CAN frame. A bag contains the definitions of its types, so that no package is
needed to read one of ours; any bag can be read: rosbag2 folders, single .mcap and .db3 files, ROS 1 bags.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import can
import numpy as np
from mcap.exceptions import EndOfFile
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer
from rosbags.rosbag1 import Reader as Rosbag1
from rosbags.rosbag2 import Reader as Rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from deeptruck_core import formats
from deeptruck_core.account import Account
from truck_bridge.can_logs.frames import EXTENDED_FLAG, EXTENDED_MASK, Frame, Kind
from truck_bridge.errors import InputError

TYPE = "can_msgs/msg/Frame"
TOPIC = "/from_can_bus"  # where ros2_socketcan publishes what it hears
DEFINITION = """\
std_msgs/Header header
uint32 id
bool is_rtr
bool is_extended
bool is_error
uint8 dlc
uint8[8] data
"""
SECOND = 1_000_000_000  # ns
MOST_BYTES = 1 << 30  # of one record, above which the file is damaged
FLUSH_S = 0.5  # what a recorder took before survives a kill -9


def _types(kind: Stores = Stores.ROS2_JAZZY) -> Any:
    store = get_typestore(kind)
    store.register(get_types_from_msg(DEFINITION, TYPE))
    return store


def frames(path: Path, account: Account) -> Iterator[Frame]:
    """The frames of all topics of the type, in the order of the file. The bag of a killed recorder gives what
    was written, and a remark in `account`.

    Raises InputError if there is no bag, or no such topic in it.
    """
    if path.is_dir() and formats.kind_of(path) is not formats.Kind.BAG:
        raise InputError(f"{path} is a folder without a rosbag; give a CAN log or a bag")
    files = sorted(path.glob(f"*{formats.BAG}")) if path.is_dir() else [path]
    types: set[str] = set()
    messages: Iterator[_Raw]
    if files and files[0].suffix == formats.BAG:
        messages = (message for file in files for message in _of_mcap(file, types, account))
        parse = _types().deserialize_cdr
    else:
        messages = _of_others(path, types)
        ros1 = path.suffix == ".bag"
        store = _types(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_JAZZY)
        parse = store.deserialize_ros1 if ros1 else store.deserialize_cdr
    for topic, stamp, raw in messages:
        account.total.read += 1
        yield _frame(parse(raw, TYPE), stamp, topic.removesuffix(TOPIC).strip("/") or "can0")
    if TYPE not in types:
        held = ", ".join(sorted(types)) or "nothing"
        raise InputError(f"{path} holds no {TYPE}, the type of raw CAN frames; it holds {held}")


_Raw = tuple[str, int, bytes]  # topic, log time in ns and content


def _of_mcap(file: Path, types: set[str], account: Account) -> Iterator[_Raw]:
    """The frames of an MCAP file, whatever its other topics hold; `types` gets those of all."""
    schemas: dict[int, str] = {}
    topics: dict[int, str] = {}  # of frames, by channel
    with file.open("rb") as stream:
        end = max(file.stat().st_size - len(MCAP0_MAGIC), 1)
        stream.seek(end)
        finished = stream.read() == MCAP0_MAGIC
        stream.seek(0)
        try:
            for record in StreamReader(stream, validate_crcs=True, record_size_limit=MOST_BYTES).records:
                if isinstance(record, Schema):
                    schemas[record.id] = record.name
                    types.add(record.name)
                elif isinstance(record, Channel) and schemas.get(record.schema_id) == TYPE:
                    topics[record.id] = record.topic
                elif isinstance(record, Message) and record.channel_id in topics:
                    yield topics[record.channel_id], record.log_time, record.data
        except (EndOfFile, struct.error):
            if finished:
                raise
            if not topics:
                raise InputError(
                    f"{file} was not finished, and holds no topic of {TYPE}; record it anew"
                ) from None
            account.remarks.append(f"{file} was not finished; its last half second may lack")


def _of_others(path: Path, types: set[str]) -> Iterator[_Raw]:
    """The frames of a database or a ROS 1 bag."""
    with Rosbag1(path) if path.suffix == ".bag" else Rosbag2(path) as reader:
        types |= {connection.msgtype for connection in reader.connections}
        chosen = [connection for connection in reader.connections if connection.msgtype == TYPE]
        for connection, stamp, raw in reader.messages(chosen) if chosen else ():
            yield connection.topic, stamp, raw


def _frame(message: Any, stamp: int, channel: str) -> Frame:
    own = message.header.stamp.sec * SECOND + message.header.stamp.nanosec
    kind = Kind.ERROR if message.is_error else Kind.REMOTE if message.is_rtr else Kind.DATA
    length = min(message.dlc, 8)
    return Frame(
        (own or stamp) / SECOND,
        message.id & EXTENDED_MASK,
        b"" if message.is_rtr else bytes(message.data[:length]),
        channel,
        bool(message.is_extended) or bool(message.id & EXTENDED_FLAG),
        kind,
        length if kind is Kind.REMOTE else 0,
    )


def _topic(bus: int | str | None) -> str:
    """The topic of a bus, as ros2_socketcan names it for several."""
    name = str(bus or "can0")
    return name if name.startswith("/") else TOPIC if name == "can0" else f"/{name}{TOPIC}"


class RosbagWriter:
    """A python-can listener that writes one .mcap file, as `ros2 bag play` and Foxglove open it."""

    def __init__(self, path: Path) -> None:
        self._store = _types()
        self._stream = path.open("wb")
        self._writer = Writer(self._stream, compression=CompressionType.NONE)
        self._writer.start(profile="ros2", library="truck_bridge")
        text, _ = self._store.generate_msgdef(TYPE, ros_version=2)
        self._schema = self._writer.register_schema(TYPE, "ros2msg", text.encode())
        self._channels: dict[str, int] = {}  # by topic
        self._count, self._flushed = 0, time.monotonic()
        self._channel(TOPIC)  # a recording in which nothing was received has its topic too

    def _channel(self, topic: str) -> int:
        if topic not in self._channels:
            self._channels[topic] = self._writer.register_channel(
                topic, "cdr", self._schema, {"offered_qos_profiles": ""}
            )
        return self._channels[topic]

    def on_message_received(self, message: can.Message) -> None:
        """Add one frame, at its own time stamp."""
        stamp = round(message.timestamp * SECOND)
        cdr = self._store.serialize_cdr(self._frame(message, stamp), TYPE)
        self._count += 1
        self._writer.add_message(self._channel(_topic(message.channel)), stamp, cdr, stamp, self._count)
        if time.monotonic() - self._flushed > FLUSH_S:
            self._writer.flush()
            self._stream.flush()
            self._flushed = time.monotonic()

    def _frame(self, message: can.Message, stamp: int) -> Any:
        types = self._store.types
        time_, header = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
        return types[TYPE](
            header=header(stamp=time_(sec=stamp // SECOND, nanosec=stamp % SECOND), frame_id="can"),
            id=message.arbitration_id,
            is_rtr=message.is_remote_frame,
            is_extended=message.is_extended_id,
            is_error=message.is_error_frame,
            dlc=message.dlc,
            data=np.frombuffer(bytes(message.data).ljust(8, b"\0"), dtype=np.uint8),
        )

    def stop(self) -> None:
        """Finish the file."""
        try:
            self._writer.finish()
        finally:
            self._stream.close()
