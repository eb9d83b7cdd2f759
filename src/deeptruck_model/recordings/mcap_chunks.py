"""Messages of an MCAP file by whole chunks, found through the message indexes instead of one by one."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Chunk, ChunkIndex
from mcap.stream_reader import get_chunk_data_stream
from numpy.typing import NDArray

RECORD_HEAD = 9  # opcode and length
_MESSAGE_HEAD = 22  # channel, sequence, log time, publish time
_GROUP_BYTES = 4 * 2**20
_ENTRY = np.dtype([("log_ns", "<u8"), ("offset", "<u8")])


@dataclass(frozen=True)
class Batch:
    """Messages of one topic: payloads at `starts` with `sizes` in `buffer`, log times `log_ns`, each (n,).

    Every message of any topic logged before `safe_ns` came in an earlier batch.
    """

    topic: str
    buffer: NDArray[np.uint8]
    starts: NDArray[np.int64]
    sizes: NDArray[np.int64]
    log_ns: NDArray[np.int64]
    safe_ns: int


@dataclass(frozen=True)
class IndexedChunk:
    """A chunk of a file, with (topic, message type) of the file's channels."""

    file: Path
    index: ChunkIndex
    channels: dict[int, tuple[str, str]]


def indexed_chunks(files: Sequence[Path]) -> list[IndexedChunk] | None:
    """All chunks of the files; None where a file has none, so that its messages must be read in order."""
    chunks = []
    for file in files:
        with file.open("rb") as stream:
            summary = make_reader(stream).get_summary()
        if summary is None or not summary.chunk_indexes:
            return None
        types = {key: schema.name for key, schema in summary.schemas.items()}
        channels = {key: (c.topic, types.get(c.schema_id, "")) for key, c in summary.channels.items()}
        chunks += [IndexedChunk(file, index, channels) for index in summary.chunk_indexes]
    return chunks or None


def read_chunks(chunks: Sequence[IndexedChunk], types: dict[str, str]) -> Iterator[Batch]:
    """Messages of the topics that have the given types, in the order of the chunks' first messages."""
    group = _Group()
    with ExitStack() as stack:
        streams: dict[Path, BinaryIO] = {}
        for chunk in sorted(chunks, key=lambda c: c.index.message_start_time):
            held = chunk.index.message_index_offsets or chunk.channels  # without an index it may hold any
            found = {key: chunk.channels[key] for key in held}
            wanted = {key: topic for key, (topic, kind) in found.items() if types.get(topic) == kind}
            if not wanted:
                continue
            if chunk.file not in streams:
                streams[chunk.file] = stack.enter_context(chunk.file.open("rb"))
            group.add(*_read(streams[chunk.file], chunk.index), wanted, chunk.index.message_start_time)
            if group.size > _GROUP_BYTES:
                yield from group.batches()
                group = _Group()
    yield from group.batches()


def _read(stream: BinaryIO, index: ChunkIndex) -> tuple[bytes, dict[int, NDArray[np.void]]]:
    """A chunk's content, and where its messages are, by channel."""
    stream.seek(index.chunk_start_offset)
    raw = stream.read(index.chunk_length + index.message_index_length)
    chunk = Chunk.read(ReadDataStream(BytesIO(raw[RECORD_HEAD : index.chunk_length])))
    content, size = get_chunk_data_stream(chunk, validate_crc=True)
    data = content.read(size)
    if not index.message_index_length:
        return data, scan_messages(data)
    return data, dict(message_indexes(raw[index.chunk_length :]))


class _Group:
    """Chunks taken together, because a recorder that flushes every second leaves many small ones."""

    def __init__(self) -> None:
        self.size = 0
        self._data: list[bytes] = []
        self._found: dict[str, list[tuple[NDArray[np.int64], NDArray[np.int64]]]] = {}
        self._safe_ns: int | None = None

    def add(
        self, data: bytes, entries: dict[int, NDArray[np.void]], wanted: dict[int, str], start_ns: int
    ) -> None:
        """One more chunk, later than those before it."""
        for channel, topic in wanted.items():
            if channel in entries and len(entries[channel]):
                records = entries[channel]["offset"].astype(np.int64) + self.size
                log_ns = entries[channel]["log_ns"].astype(np.int64)
                self._found.setdefault(topic, []).append((records, log_ns))
        self._safe_ns = start_ns if self._safe_ns is None else self._safe_ns
        self._data.append(data)
        self.size += len(data)

    def batches(self) -> Iterator[Batch]:
        """What was found, one batch a topic."""
        buffer = np.frombuffer(b"".join(self._data), np.uint8)
        for topic, parts in self._found.items():
            records = np.concatenate([r for r, _ in parts])
            lengths = np.lib.stride_tricks.sliding_window_view(buffer, 8)[records + 1]
            sizes = np.ascontiguousarray(lengths).view("<i8")[:, 0] - _MESSAGE_HEAD
            log_ns = np.concatenate([ns for _, ns in parts])
            yield Batch(
                topic, buffer, records + RECORD_HEAD + _MESSAGE_HEAD, sizes, log_ns, self._safe_ns or 0
            )


def message_indexes(raw: bytes) -> Iterator[tuple[int, NDArray[np.void]]]:
    """(channel, entries with log_ns and offset) of the MessageIndex records that follow a chunk."""
    at = 0
    while at < len(raw):
        length = int.from_bytes(raw[at + 1 : at + RECORD_HEAD], "little")
        content = raw[at + RECORD_HEAD : at + RECORD_HEAD + length]
        yield int.from_bytes(content[:2], "little"), np.frombuffer(content[6:], _ENTRY)
        at += RECORD_HEAD + length


def scan_messages(data: bytes) -> dict[int, NDArray[np.void]]:
    """What `message_indexes` would give for a chunk's content, found by walking its records."""
    found: dict[int, list[tuple[int, int]]] = {}
    at = 0
    while at < len(data):
        opcode, length = struct.unpack_from("<BQ", data, at)
        if opcode == Opcode.MESSAGE:
            channel, _, log_ns = struct.unpack_from("<HIQ", data, at + RECORD_HEAD)
            found.setdefault(channel, []).append((log_ns, at))
        at += RECORD_HEAD + length
    return {channel: np.array(entries, _ENTRY) for channel, entries in found.items()}
