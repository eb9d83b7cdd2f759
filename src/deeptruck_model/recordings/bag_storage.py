"""Storage formats of bag files: each gives topics, message definitions and raw messages.

MCAP is read here; sqlite3 and ROS 1 go through rosbags. Definitions are kept as text and parsed only for
topics that are mapped, because others may be in any language. The user's files are never changed: files are
unpacked or recovered in a copy.
"""

from __future__ import annotations

import shutil
import sqlite3
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import zstandard
from mcap.reader import make_reader
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader
from rosbags.rosbag1 import Reader as Ros1Reader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

from deeptruck_model.recordings import bag_file
from deeptruck_model.recordings.bag_file import DamagedError
from deeptruck_model.recordings.mcap_chunks import summary_of

JOURNALS = ("-wal", "-journal")  # next to a database whose writer was killed


@dataclass(frozen=True)
class Connection:
    """A topic with one message type: the number of messages, their serialisation ('cdr', 'ros1'), and the
    definition of the type in a `language` ('msg', 'idl' or another; '' without a definition)."""

    key: int
    topic: str
    msgtype: str
    count: int
    encoding: str
    language: str
    definition: str


class McapStorage:
    """One MCAP file that bag_file.check_mcap has found intact."""

    def __init__(self, file: Path) -> None:
        self.file = file
        summary = summary_of(file)
        counts: Counter[int] = Counter()
        self.last_ns = 0
        if summary is not None and summary.statistics is not None and summary.channels:
            schemas, channels = summary.schemas, summary.channels
            counts.update(summary.statistics.channel_message_counts)
            self.last_ns = summary.statistics.message_end_time
        else:
            schemas, channels = {}, {}
            with file.open("rb") as stream:
                for record in StreamReader(stream).records:
                    if isinstance(record, Schema):
                        schemas[record.id] = record
                    elif isinstance(record, Channel):
                        channels[record.id] = record
                    elif isinstance(record, Message):
                        counts[record.channel_id] += 1
                        self.last_ns = max(self.last_ns, record.log_time)
        self.connections = [
            _mcap_connection(channel, schemas.get(channel.schema_id), counts[key])
            for key, channel in channels.items()
        ]

    def messages(self, keys: set[int], from_ns: int = 0) -> Iterator[tuple[int, int, bytes]]:
        """(key of the connection, log time in ns, message) in the order of log times."""
        topics = [c.topic for c in self.connections if c.key in keys]
        with self.file.open("rb") as stream:
            for _, channel, message in make_reader(stream).iter_messages(topics, starting_at=from_ns):
                if channel.id in keys:
                    yield channel.id, message.log_time, message.data


def _mcap_connection(channel: Channel, schema: Schema | None, count: int) -> Connection:
    name, language, text = "", "", ""
    if schema is not None:
        name = schema.name
        language = {"ros2msg": "msg", "ros1msg": "msg", "ros2idl": "idl", "omgidl": "idl"}.get(
            schema.encoding, schema.encoding
        )
        text = schema.data.decode(errors="replace")
    return Connection(channel.id, channel.topic, name, count, channel.message_encoding, language, text)


class RosbagsStorage:
    """A sqlite3 file or a ROS 1 bag, read by rosbags."""

    def __init__(self, file: Path, stack: ExitStack) -> None:
        self._reader: Any = Ros1Reader(file) if file.suffix == ".bag" else Sqlite3Reader(file)
        self._reader.open()
        stack.callback(self._reader.close)
        counted = self._reader if file.suffix == ".bag" else self._reader.metadata
        self.last_ns: int = counted.end_time - 1  # rosbags has one beyond the last message
        self.connections = [
            Connection(
                c.id,
                c.topic,
                c.msgtype,
                c.msgcount,
                getattr(c.ext, "serialization_format", "ros1"),
                c.msgdef.format.name.lower().replace("none", ""),
                c.msgdef.data,
            )
            for c in self._reader.connections
        ]

    def messages(self, keys: set[int], from_ns: int = 0) -> Iterator[tuple[int, int, bytes]]:
        """(key of the connection, log time in ns, message) in the order of log times."""
        wanted = [c for c in self._reader.connections if c.id in keys]
        for connection, log_ns, data in self._reader.messages(wanted, from_ns) if wanted else ():
            yield connection.id, log_ns, bytes(data)


Storage = McapStorage | RosbagsStorage


def open_storage(file: Path, stack: ExitStack) -> Storage:
    """Open a file until `stack` closes it. Raises the libraries' errors if it is damaged."""
    if file.suffix == ".zstd":
        unpacked = Path(stack.enter_context(TemporaryDirectory())) / file.stem
        with file.open("rb") as packed, unpacked.open("wb") as target:
            zstandard.ZstdDecompressor().copy_stream(packed, target)
        file = unpacked
        if file.suffix == ".mcap":
            bag_file.check_mcap(file)
    if file.suffix == ".mcap":
        return McapStorage(file)
    if file.suffix in (".db3", ".bag"):
        return RosbagsStorage(_recovered(file, stack), stack)
    raise DamagedError(f"{file.name} is neither MCAP nor sqlite3")


def _recovered(file: Path, stack: ExitStack) -> Path:
    """The database, or a copy of it to which sqlite has applied its journal."""
    journals = [file.with_name(file.name + end) for end in JOURNALS]
    journals = [journal for journal in journals if journal.is_file() and journal.stat().st_size]
    if not journals:
        return file
    folder = Path(stack.enter_context(TemporaryDirectory()))
    copies = [Path(shutil.copyfile(one, folder / one.name)) for one in (file, *journals)]
    with closing(sqlite3.connect(copies[0])) as database:
        database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        database.execute("SELECT count(*) FROM sqlite_master").fetchone()
    return copies[0]
