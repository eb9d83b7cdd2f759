"""Raw CAN frames in a rosbag: can_msgs/msg/Frame, the type of ros2_socketcan and Foxglove.

The common interfaces have no CAN frame. A bag contains the definitions of its types, so that no package is
needed to read one of ours; any bag can be read: rosbag2 folders, single .mcap and .db3 files, ROS 1 bags.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, Literal

import can
import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, Message, Schema
from mcap.stream_reader import MAGIC_SIZE, breakup_chunk, read_magic
from mcap.writer import CompressionType, Writer
from rosbags.rosbag1 import Reader as Rosbag1
from rosbags.rosbag2 import Reader as Rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from deeptruck_core import formats
from deeptruck_core.account import Account
from truck_bridge import log_files
from truck_bridge.can_logs.frames import EXTENDED_FLAG, EXTENDED_MASK, Frame, Kind
from truck_bridge.can_logs.whole import check_mcap
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


def _types(kind: Stores = Stores.ROS2_JAZZY) -> Any:
    store = get_typestore(kind)
    store.register(get_types_from_msg(DEFINITION, TYPE))
    return store


def frames(path: Path, account: Account) -> Iterator[Frame]:
    """The frames of all topics of the type, in order of time. An unfinished bag of a killed recorder gives
    the frames that were written, and a remark in `account`.

    Raises InputError if there is no such topic.
    """
    suffix = formats.BAG
    files = sorted(path.glob(f"*{suffix}")) if path.is_dir() else [path] if path.suffix == suffix else []
    if False in list(map(check_mcap, files)) and path.is_file():
        for frame in _read_unfinished(path):
            account.total.read += 1
            yield frame
        account.remarks.append(f"{path} was not finished; its last half second may lack")
        return
    ros1 = path.suffix == ".bag"
    held: set[str] = set()
    store = _types(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_JAZZY)
    parse = store.deserialize_ros1 if ros1 else store.deserialize_cdr
    for channels, topic, stamp, raw in _of_mcap(files, held) if files else _of_others(path, held):
        account.total.read += 1
        yield _frame(parse(raw, TYPE), stamp, channels[topic])
    if TYPE not in held:
        said = ", ".join(sorted(held)) or "nothing"
        raise InputError(f"{path} holds no {TYPE}, the type of raw CAN frames; it holds {said}")


_Raw = tuple[dict[str, str], str, int, bytes]  # buses by topic; topic, log time in ns and content


def _of_mcap(files: list[Path], held: set[str]) -> Iterator[_Raw]:
    """The frames of MCAP files, whatever the serialisation of other topics; `held` gets the types of all."""
    for file in files:
        with file.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True)
            summary = reader.get_summary()
            types = {k: schema.name for k, schema in (summary.schemas if summary else {}).items()}
            held |= set(types.values())
            all_channels = (summary.channels if summary else {}).values()
            chosen = {c.topic for c in all_channels if types.get(c.schema_id) == TYPE}
            channels = _channels(chosen)
            for schema, channel, message in reader.iter_messages(topics=sorted(chosen)) if chosen else ():
                if schema is not None and schema.name == TYPE:
                    yield channels, channel.topic, message.log_time, message.data


def _of_others(path: Path, held: set[str]) -> Iterator[_Raw]:
    """The frames of a database or a ROS 1 bag."""
    with Rosbag1(path) if path.suffix == ".bag" else Rosbag2(path) as reader:
        held |= {connection.msgtype for connection in reader.connections}
        chosen = [connection for connection in reader.connections if connection.msgtype == TYPE]
        channels = _channels({connection.topic for connection in chosen})
        for connection, stamp, raw in reader.messages(chosen) if chosen else ():
            yield channels, connection.topic, stamp, raw


def _read_unfinished(path: Path) -> Iterator[Frame]:
    """The complete chunks of a file without its end. Raises InputError if there is none."""
    store = _types()
    schemas: set[int] = set()
    topics: dict[int, str] = {}  # by channel id
    with path.open("rb") as stream:
        for chunk in _whole_chunks(stream, path.stat().st_size):
            for record in breakup_chunk(chunk, validate_crc=True):
                if isinstance(record, Schema) and record.name == TYPE:
                    schemas.add(record.id)
                elif isinstance(record, Channel) and record.schema_id in schemas:
                    topics[record.id] = record.topic
                elif isinstance(record, Message) and record.channel_id in topics:
                    name = _channels(set(topics.values()))[topics[record.channel_id]]
                    yield _frame(store.deserialize_cdr(record.data, TYPE), record.log_time, name)
    if not topics:
        raise InputError(
            f"{path} was not finished, and holds no whole chunk with a topic of {TYPE}; record it anew"
        )


def _channels(topics: set[str]) -> dict[str, str]:
    """The bus of each topic: /can1/from_can_bus is can1, /from_can_bus alone can0; else the topic's name."""
    named = {topic: topic.removesuffix(TOPIC).strip("/") or "can0" for topic in topics}
    return named if len(set(named.values())) == len(topics) else {topic: topic for topic in topics}


def _whole_chunks(stream: BinaryIO, size: int) -> Iterator[Chunk]:
    """The chunks of a file up to its truncated record."""
    if size < MAGIC_SIZE:
        return
    read_magic(ReadDataStream(stream))
    while len(head := stream.read(9)) == 9:
        opcode, length = struct.unpack("<BQ", head)
        if stream.tell() + length > size:
            return
        content = stream.read(length)
        if opcode == Opcode.CHUNK:
            yield Chunk.read(ReadDataStream(BytesIO(content)))


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

    def __init__(self, path: Path, mode: Literal["wb", "xb"] = "xb") -> None:
        self._store = _types()
        self._stream = path.open(mode)
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
        if time.monotonic() - self._flushed > log_files.FLUSH_S:
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
