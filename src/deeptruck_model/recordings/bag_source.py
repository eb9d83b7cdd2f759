"""Raw messages out of any bag: MCAP chunk by chunk without touching single messages, the rest through
rosbags.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Chunk, ChunkIndex
from mcap.stream_reader import CRCValidationError, get_chunk_data_stream
from mcap.summary import Summary
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.rosbag1 import ReaderError as Reader1Error
from rosbags.rosbag2 import ReaderError as Reader2Error
from rosbags.typesys import Stores, get_typestore

from deeptruck_model.errors import InputError

INTERFACE_KEY = "deeptruck.interface"
NOTES_KEY = "deeptruck.notes"

_BATCH = 65536  # messages read one by one are handed on in batches of this many
_RECORD_HEAD = 9  # opcode and length
_MESSAGE_HEAD = 22  # channel, sequence, log time, publish time
_DAMAGED = (McapError, CRCValidationError, AnyReaderError, Reader1Error, Reader2Error, EOFError)


@dataclass(frozen=True)
class Batch:
    """Messages of one topic: payloads at `starts` with `sizes` in `buffer`, and their log times in ns, each
    (n,).
    """

    topic: str
    buffer: NDArray[np.uint8]
    starts: NDArray[np.int64]
    sizes: NDArray[np.int64]
    log_ns: NDArray[np.int64]


class BagSource:
    """One bag, open: rosbag2 folder (MCAP or sqlite3), a lone .mcap or .db3 file, or a ROS 1 .bag.

    Use as a context manager. Raises InputError where there is no bag or it is truncated or damaged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.ros1 = path.suffix == ".bag"
        self._stack = ExitStack()

    def __enter__(self) -> BagSource:
        if not self.path.exists():
            raise InputError(f"{self.path} does not exist")
        if self.path.is_dir() and not (self.path / "metadata.yaml").exists():
            raise InputError(
                f"{self.path} is not a finished bag (it has no metadata.yaml); "
                "if its recorder was killed, mend it with 'deeptruck-model repair'"
            )
        try:
            self._reader = self._stack.enter_context(
                AnyReader([self.path], default_typestore=get_typestore(Stores.ROS2_JAZZY))
            )
        except Exception as error:  # rosbags raises whatever a damaged byte leads it to
            raise InputError(f"{self.path} cannot be read as a bag: {_one_line(error)}") from None
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    @property
    def definitions(self) -> dict[str, Any]:
        """Message definitions by type name, as the bag carries them."""
        return dict(self._reader.typestore.fielddefs)

    @property
    def topics(self) -> dict[str, str]:
        """Message type by topic; of a topic with several types, the one with most messages."""
        connections = sorted(self._reader.connections, key=lambda c: c.msgcount)
        return {c.topic: c.msgtype for c in connections}

    def custom_data(self) -> dict[str, Any]:
        """The JSON values stored with the bag under `deeptruck.*` (custom_data, else MCAP metadata records)."""
        reader = self._reader.readers[0]
        stored = (
            dict(getattr(getattr(reader, "storage", None), "metadata", None).custom or {})
            if not self.ros1
            else {}
        )
        for file in self._mcap_files():
            with file.open("rb") as stream:
                for record in make_reader(stream).iter_metadata():
                    if record.name.startswith("deeptruck."):
                        stored.setdefault(record.name, record.metadata.get("json", ""))
        return {
            key: _from_json(self.path, key, value) for key, value in stored.items() if "deeptruck." in key
        }

    def batches(self, topics: set[str]) -> Iterator[Batch]:
        """All messages of the topics, file by file, in the order they were written."""
        try:
            files = self._mcap_files()
            summaries = [self._indexed(file) for file in files]
            if files and all(summaries):
                for file, summary in zip(files, summaries, strict=True):
                    if summary is not None:
                        yield from _chunks(file, summary, topics)
            else:
                yield from self._one_by_one(topics)
        except _DAMAGED as error:
            raise InputError(f"{self.path} is damaged: {_one_line(error)}") from None

    def messages(self, topics: set[str]) -> Iterator[tuple[str, int, bytes]]:
        """(topic, log time in ns, serialised message) of the topics, in the order of their log times."""
        wanted = [c for c in self._reader.connections if c.topic in topics]
        try:
            for connection, log_ns, data in self._reader.messages(wanted) if wanted else ():
                yield connection.topic, log_ns, bytes(data)
        except _DAMAGED as error:
            raise InputError(f"{self.path} is damaged: {_one_line(error)}") from None

    def _mcap_files(self) -> list[Path]:
        if self.path.is_file():
            return [self.path] if self.path.suffix == ".mcap" else []
        if self._reader.readers[0].compression_mode:  # type: ignore[union-attr]
            return []
        return sorted(self.path.glob("*.mcap"))

    @staticmethod
    def _indexed(file: Path) -> Summary | None:
        """The summary of a file whose chunks all have message indexes, else None."""
        with file.open("rb") as stream:
            summary = make_reader(stream).get_summary()
        if summary is None or summary.statistics is None:
            return None
        whole = all(index.message_index_length for index in summary.chunk_indexes)
        return summary if whole and summary.chunk_indexes else None

    def _one_by_one(self, topics: set[str]) -> Iterator[Batch]:
        wanted = [c for c in self._reader.connections if c.topic in topics]
        held: dict[str, list[tuple[int, bytes]]] = {topic: [] for topic in topics}
        if not wanted:
            return
        for connection, log_ns, data in self._reader.messages(wanted):
            messages = held[connection.topic]
            messages.append((log_ns, bytes(data)))
            if len(messages) == _BATCH:
                yield _joined(connection.topic, messages)
                messages.clear()
        for topic, messages in held.items():
            if messages:
                yield _joined(topic, messages)


def _joined(topic: str, messages: list[tuple[int, bytes]]) -> Batch:
    sizes = np.array([len(data) for _, data in messages], dtype=np.int64)
    buffer = np.frombuffer(b"".join(data for _, data in messages), np.uint8)
    log_ns = np.array([stamp for stamp, _ in messages], dtype=np.int64)
    return Batch(topic, buffer, np.cumsum(sizes) - sizes, sizes, log_ns)


def _chunks(file: Path, summary: Summary, topics: set[str]) -> Iterator[Batch]:
    wanted = {key: channel.topic for key, channel in summary.channels.items() if channel.topic in topics}
    with file.open("rb") as stream:
        for index in sorted(summary.chunk_indexes, key=lambda i: i.chunk_start_offset):
            if wanted.keys() & index.message_index_offsets.keys():
                yield from _chunk(stream, index, wanted)


def _chunk(stream: Any, index: ChunkIndex, wanted: dict[int, str]) -> Iterator[Batch]:
    stream.seek(index.chunk_start_offset)
    raw = stream.read(index.chunk_length + index.message_index_length)
    chunk = Chunk.read(ReadDataStream(BytesIO(raw[_RECORD_HEAD : index.chunk_length])))
    content, size = get_chunk_data_stream(chunk, validate_crc=True)
    buffer = np.frombuffer(content.read(size), np.uint8)
    for channel, entries in message_indexes(raw[index.chunk_length :]):
        if channel in wanted and len(entries):
            records = entries["offset"].astype(np.int64)
            lengths = np.lib.stride_tricks.sliding_window_view(buffer, 8)[records + 1]
            sizes = np.ascontiguousarray(lengths).view("<i8")[:, 0] - _MESSAGE_HEAD
            starts = records + _RECORD_HEAD + _MESSAGE_HEAD
            yield Batch(wanted[channel], buffer, starts, sizes, entries["log_ns"].astype(np.int64))


def message_indexes(raw: bytes) -> Iterator[tuple[int, NDArray[Any]]]:
    """(channel, entries with log_ns and offset) of the MessageIndex records that follow a chunk."""
    at = 0
    while at < len(raw):
        length = int.from_bytes(raw[at + 1 : at + _RECORD_HEAD], "little")
        channel = int.from_bytes(raw[at + _RECORD_HEAD : at + 11], "little")
        yield (
            channel,
            np.frombuffer(raw[at + 15 : at + _RECORD_HEAD + length], [("log_ns", "<u8"), ("offset", "<u8")]),
        )
        at += _RECORD_HEAD + length


def _from_json(path: Path, key: str, text: str) -> Any:
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(f"{path}: its {key} is not JSON ({error})") from None


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
