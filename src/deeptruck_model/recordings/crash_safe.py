"""Writes a bag such that a killed process loses at most the last second, and its metadata.yaml (version 9, as
ROS 2 Jazzy writes it).
"""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import yaml
from mcap.writer import CompressionType, Writer

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_model.recordings.message_definitions import definition

VERSION = 9
CHUNK_BYTES = 64 * 1024  # 10 s of a drive at 10 Hz: what a file that is cut off, not killed, loses at most


@dataclass
class Topic:
    """One topic of a bag: its message type, the number of messages, and that of its channel in the file."""

    name: str
    type_name: str  # as in 'geometry_msgs/msg/TwistStamped'
    count: int = 0
    channel: int = 0


def metadata_yaml(
    file_name: str, topics: list[Topic], start_ns: int, end_ns: int, custom: dict[str, str]
) -> str:
    """The text of metadata.yaml for a folder with one MCAP file."""
    count = sum(topic.count for topic in topics)
    span = {
        "starting_time": {"nanoseconds_since_epoch": start_ns},
        "duration": {"nanoseconds": max(0, end_ns - start_ns)},
        "message_count": count,
    }
    information = {
        "version": VERSION,
        "storage_identifier": "mcap",
        "relative_file_paths": [file_name],
        **span,
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type_name,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": [],
                    "type_description_hash": definition(topic.type_name)[1],
                },
                "message_count": topic.count,
            }
            for topic in topics
        ],
        "compression_format": "",
        "compression_mode": "",
        "files": [{"path": file_name, **span}],
        "custom_data": custom or None,
        "ros_distro": "jazzy",
    }
    return yaml.safe_dump({"rosbag2_bagfile_information": information}, sort_keys=False)


class CrashSafeWriter:
    """Writes serialised messages into a new rosbag2 folder; data older than `flush_s` survive a kill -9.

    Every flush ends a chunk, so that `repair` can index it. The folder has no metadata.yaml until `close`; an
    unfinished bag is recognised by that. Use as a context manager. `into` writes into an existing folder.
    Raises InputError if the folder exists or cannot be written, if the disk is full, and for unknown message
    types.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        file_stem: str | None = None,
        custom_data: dict[str, str] | None = None,
        flush_s: float = 0.5,
        into: bool = False,
    ) -> None:
        self.path = Path(path)
        self.flush_s = flush_s
        self.custom_data = dict(custom_data or {})
        self.file = self.path / f"{file_stem or self.path.name}_0.mcap"
        self._topics: dict[str, Topic] = {}
        self._schemas: dict[str, int] = {}
        self._first_ns, self._last_ns = 2**63 - 1, 0
        self._broken = False
        try:
            self.path.mkdir(parents=True, exist_ok=into)
            self._stream = self.file.open("xb")
        except FileExistsError:
            raise InputError(f"{self.path} exists already; choose another name or remove it") from None
        except OSError as error:
            raise InputError(f"cannot write {self.path}: {error.strerror}") from None
        self._writer = Writer(
            self._stream, chunk_size=CHUNK_BYTES, compression=CompressionType.NONE, enable_data_crcs=True
        )
        self._guarded(self._begin)

    def _begin(self) -> None:
        self._writer.start(profile="ros2", library="deeptruck")
        for key, value in self.custom_data.items():
            self._writer.add_metadata(key, {"json": value})
        self._flush()

    def write(self, topic: str, type_name: str, cdr: bytes, stamp_ns: int) -> None:
        """Add one message (CDR with its encapsulation header), logged at `stamp_ns`; flush if the interval
        has passed."""
        one = self._topics.get(topic) or self._register(topic, type_name)
        if one.type_name != type_name:
            raise InputError(f"topic {topic} carries {one.type_name}; a {type_name} does not belong there")
        one.count += 1
        self._first_ns = min(self._first_ns, stamp_ns)
        self._last_ns = max(self._last_ns, stamp_ns)
        self._guarded(self._writer.add_message, one.channel, stamp_ns, cdr, stamp_ns, one.count)
        self.flush_if_due()

    def flush_if_due(self) -> None:
        """Store everything written so far if the interval has passed. Call it often if messages may stop."""
        if time.monotonic() >= self._due:
            self.flush()

    def flush(self) -> None:
        """Store everything written so far as one chunk."""
        self._guarded(self._flush)

    def close(self) -> None:
        """Finish the file and write metadata.yaml; further calls do nothing."""
        if self._stream.closed:
            return
        if self._broken:
            with suppress(OSError):
                self._stream.close()
            return
        self._guarded(self._writer.finish)
        self._guarded(self._stream.close)
        self._guarded(self._write_metadata)

    def __enter__(self) -> CrashSafeWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _register(self, topic: str, type_name: str) -> Topic:
        text, type_hash = definition(type_name)
        if type_name not in self._schemas:
            self._schemas[type_name] = self._writer.register_schema(type_name, "ros2msg", text.encode())
        channel_id = self._writer.register_channel(
            topic, "cdr", self._schemas[type_name], {"offered_qos_profiles": "", "topic_type_hash": type_hash}
        )
        self._topics[topic] = Topic(topic, type_name, channel=channel_id)
        return self._topics[topic]

    def _flush(self) -> None:
        self._writer.flush()
        self._due = time.monotonic() + self.flush_s

    def _write_metadata(self) -> None:
        topics = [*self._topics.values()]
        start = min(self._first_ns, self._last_ns)
        content = metadata_yaml(self.file.name, topics, start, self._last_ns, self.custom_data)
        unfinished = self.path / ".metadata.yaml.tmp"
        unfinished.write_text(content, encoding="utf-8")
        unfinished.replace(self.path / "metadata.yaml")

    def _guarded(self, action: Any, *arguments: Any) -> None:
        try:
            action(*arguments)
        except OSError as error:
            self._broken = True
            cure = files.advice(error, "make room", "record elsewhere")
            raise InputError(
                f"cannot write {self.path}: {error.strerror}; {cure}; what was written before is kept, "
                "'deeptruck-model repair' makes a bag of it"
            ) from None
