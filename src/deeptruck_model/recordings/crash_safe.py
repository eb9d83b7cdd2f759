"""Writes a bag such that a killed process loses at most the last second, and repairs such a bag."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from mcap.writer import CompressionType, Writer

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_model.recordings.bag_metadata import Topic, definition, metadata_yaml

CHUNK_BYTES = 64 * 1024  # 10 s of a drive at 10 Hz: what a file that is cut off, not killed, loses at most


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
        self._topics: dict[str, _Channel] = {}
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
        channel = self._topics.get(topic)
        if channel is None:
            channel = self._register(topic, type_name)
        elif channel.type_name != type_name:
            raise InputError(
                f"topic {topic} carries {channel.type_name}; a {type_name} does not belong there"
            )
        channel.count += 1
        self._first_ns = min(self._first_ns, stamp_ns)
        self._last_ns = max(self._last_ns, stamp_ns)
        self._guarded(self._writer.add_message, channel.id, stamp_ns, cdr, stamp_ns, channel.count)
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

    def _register(self, topic: str, type_name: str) -> _Channel:
        text, type_hash = definition(type_name)
        if type_name not in self._schemas:
            self._schemas[type_name] = self._writer.register_schema(type_name, "ros2msg", text.encode())
        channel_id = self._writer.register_channel(
            topic, "cdr", self._schemas[type_name], {"offered_qos_profiles": "", "topic_type_hash": type_hash}
        )
        self._topics[topic] = _Channel(channel_id, type_name)
        return self._topics[topic]

    def _flush(self) -> None:
        self._writer.flush()
        self._due = time.monotonic() + self.flush_s

    def _write_metadata(self) -> None:
        topics = [Topic(name, channel.type_name, channel.count) for name, channel in self._topics.items()]
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


class _Channel:
    def __init__(self, channel_id: int, type_name: str) -> None:
        self.id, self.type_name, self.count = channel_id, type_name, 0
