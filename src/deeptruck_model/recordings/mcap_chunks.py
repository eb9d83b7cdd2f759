"""Reads messages of an MCAP file a chunk at a time, located by the message indexes."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, ChunkIndex, Schema
from mcap.summary import Summary
from numpy.typing import NDArray

from deeptruck_core.reading import why
from deeptruck_model.recordings.bag_file import RECORD_HEAD, DamagedError

_MESSAGE_HEAD = 22  # channel, sequence, log time, publish time
_GROUP_BYTES = 4 * 2**20
ENTRY = np.dtype([("log_ns", "<u8"), ("offset", "<u8")])
_MESSAGE = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_ns", "<u8"),
        ("ns", "<u8"),
    ]
)
LATEST_NS = 2**62  # the year 2116: what is stamped later was not
# what the libraries raise on bytes that were not written so; sizes are checked before
UNREADABLE = (
    McapError, EOFError, struct.error, ValueError, KeyError, IndexError, OverflowError, RuntimeError,
    zstandard.ZstdError,
)  # fmt: skip


@dataclass(frozen=True)
class Batch:
    """Messages of one topic: payloads at `starts` with `sizes` in `buffer`, log times `log_ns`, each (n,)."""

    topic: str
    buffer: NDArray[np.uint8]
    starts: NDArray[np.int64]
    sizes: NDArray[np.int64]
    log_ns: NDArray[np.int64]


@dataclass(frozen=True)
class IndexedChunk:
    """A chunk of a file, with (topic, message type) of each channel of the file."""

    file: Path
    index: ChunkIndex
    channels: dict[int, tuple[str, str]]


def indexed_chunks(files: Sequence[Path]) -> list[IndexedChunk] | None:
    """All chunks of the files; None if a file has none, so that its messages must be read in order.

    Raises DamagedError if a chunk is not in its file, or its summary cannot be read.
    """
    chunks = []
    for file in files:
        summary = summary_of(file)
        if summary is None or not summary.chunk_indexes:
            return None
        types = {key: schema.name for key, schema in summary.schemas.items()}
        channels = {key: (c.topic, types.get(c.schema_id, "")) for key, c in summary.channels.items()}
        _check_places(summary, file.stat().st_size)
        chunks += [IndexedChunk(file, index, channels) for index in summary.chunk_indexes]
    return chunks or None


def summary_of(file: Path) -> Summary | None:
    """The summary of a file that bag_file.check_mcap has found intact, completed by schemas and channels that
    only its chunks contain. Raises DamagedError if it cannot be read."""
    try:
        with file.open("rb") as stream:
            summary = make_reader(stream).get_summary()
            if summary is None:
                return None
            size = file.stat().st_size
            for index in summary.chunk_indexes:
                lacking = set(index.message_index_offsets) - set(summary.channels)
                lost = {c.schema_id for c in summary.channels.values()} - {0, *summary.schemas}
                if index.chunk_start_offset + index.chunk_length <= size and (
                    lacking or lost or not summary.channels
                ):
                    stream.seek(index.chunk_start_offset + RECORD_HEAD)
                    chunk = Chunk.read(ReadDataStream(BytesIO(stream.read(index.chunk_length - RECORD_HEAD))))
                    learn(summary.schemas, summary.channels, content_of(chunk))
            return summary
    except UNREADABLE as error:
        raise DamagedError(f"its summary cannot be read ({why(error)})") from None


def learn(schemas: dict[int, Schema], channels: dict[int, Channel], content: bytes) -> None:
    """Add the schemas and channels of a chunk's content to those known by their numbers."""
    at = 0
    while at < len(content):
        opcode, length = struct.unpack_from("<BQ", content, at)
        record = ReadDataStream(BytesIO(content[at + RECORD_HEAD : at + RECORD_HEAD + length]))
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(record)
            schemas.setdefault(schema.id, schema)
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(record)
            channels.setdefault(channel.id, channel)
        at += RECORD_HEAD + length


def _check_places(summary: Summary, size: int) -> None:
    """Raises DamagedError if a chunk is not in the file, or has channels that the summary lacks."""
    for index in summary.chunk_indexes:
        length = index.chunk_length + index.message_index_length
        if (
            not RECORD_HEAD + index.compressed_size <= index.chunk_length
            or index.chunk_start_offset + length > size
        ):
            raise DamagedError(f"it has no chunk at byte {index.chunk_start_offset}")
        if not set(index.message_index_offsets) <= set(summary.channels):
            raise DamagedError(f"its chunk at byte {index.chunk_start_offset} is of an unknown channel")


def read_chunks(chunks: Sequence[IndexedChunk], types: dict[str, str]) -> Iterator[Batch]:
    """Messages of the topics that have the given types. Raises DamagedError if a chunk is corrupt."""
    wanted = [c for c in chunks if _topics(c, types)]
    with ExitStack() as stack:
        streams = {
            file: stack.enter_context(file.open("rb")) for file in dict.fromkeys(c.file for c in wanted)
        }
        group = _Group()
        for chunk in wanted:
            group.add(*_checked(chunk, streams, types))
            if group.size > _GROUP_BYTES:
                yield from group.batches()
                group = _Group()
        yield from group.batches()


def _topics(chunk: IndexedChunk, types: dict[str, str]) -> dict[int, str]:
    """The requested topics of a chunk by channel; a chunk without an index may hold any."""
    held = chunk.index.message_index_offsets or chunk.channels
    found = {key: chunk.channels[key] for key in held}
    return {key: topic for key, (topic, kind) in found.items() if types.get(topic) == kind}


def _checked(
    chunk: IndexedChunk, streams: Mapping[Path, BinaryIO], types: dict[str, str]
) -> tuple[bytes, dict[int, NDArray[np.void]], dict[int, str]]:
    """A chunk's content, the positions of its messages, and its requested topics, by channel."""
    wanted = _topics(chunk, types)
    data, entries = _read(streams[chunk.file], chunk.index)
    for key in wanted.keys() & entries.keys():
        _check_entries(data, key, entries[key], chunk.index)
    return data, entries, wanted


def _read(stream: BinaryIO, index: ChunkIndex) -> tuple[bytes, dict[int, NDArray[np.void]]]:
    """A chunk's content, and the positions of its messages, by channel."""
    stream.seek(index.chunk_start_offset)
    raw = stream.read(index.chunk_length + index.message_index_length)
    try:
        if raw[0] != Opcode.CHUNK:
            raise ValueError("it is none")
        data = content_of(Chunk.read(ReadDataStream(BytesIO(raw[RECORD_HEAD : index.chunk_length]))))
        if not index.message_index_length:
            return data, scan_messages(data)
        entries = dict(message_indexes(raw[index.chunk_length :]))
        if set(entries) != set(index.message_index_offsets):
            raise ValueError("it lacks a message index")
    except UNREADABLE as error:
        raise DamagedError(f"its chunk at byte {index.chunk_start_offset}: {why(error)}") from None
    return data, entries


def content_of(chunk: Chunk) -> bytes:
    """The decompressed content of a chunk. Buffers grow as needed: the size stated in the data is not
    trusted."""
    unpack = _UNPACK.get(chunk.compression)
    if unpack is None:
        raise ValueError(f"compression {chunk.compression!r} is unknown")
    data = unpack(chunk.data)
    if len(data) != chunk.uncompressed_size:
        raise ValueError(f"it has {len(data)} bytes, not {chunk.uncompressed_size}")
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError("its checksum is not kept")
    return data


_UNPACK: dict[str, Callable[[bytes], bytes]] = {
    "": lambda data: data,
    "zstd": lambda data: zstandard.ZstdDecompressor().decompressobj().decompress(data),
    "lz4": lambda data: lz4.frame.LZ4FrameDecompressor().decompress(data),
}


def _check_entries(data: bytes, channel: int, entries: NDArray[np.void], index: ChunkIndex) -> None:
    """Raises DamagedError if an entry of a message index does not point to a message of its channel."""
    buffer = np.frombuffer(data, np.uint8)
    offsets = entries["offset"]
    head = RECORD_HEAD + _MESSAGE_HEAD
    fine = not len(entries) or (len(data) >= head and int(offsets.max()) <= len(data) - head)
    if fine and len(entries):
        heads = np.lib.stride_tricks.sliding_window_view(buffer, head)[offsets].copy().view(_MESSAGE)[:, 0]
        ends = heads["length"] <= len(data) - RECORD_HEAD - offsets
        fine = bool(
            (ends & (heads["length"] >= _MESSAGE_HEAD)).all()
            and (heads["opcode"] == Opcode.MESSAGE).all()
            and (heads["channel"] == channel).all()
            and (heads["log_ns"] == entries["log_ns"]).all()
        )
    if not fine:
        raise DamagedError(f"the message index of its chunk at byte {index.chunk_start_offset} does not fit")


class _Group:
    """Chunks processed together, because a recorder that flushes every second writes many small ones."""

    def __init__(self) -> None:
        self.size = 0
        self._data: list[bytes] = []
        self._found: dict[str, list[tuple[NDArray[np.int64], NDArray[np.int64]]]] = {}

    def add(self, data: bytes, entries: dict[int, NDArray[np.void]], wanted: dict[int, str]) -> None:
        """Add a chunk."""
        for channel, topic in wanted.items():
            if channel in entries and len(entries[channel]):
                records = entries[channel]["offset"].astype(np.int64) + self.size
                log_ns = entries[channel]["log_ns"].astype(np.int64)
                self._found.setdefault(topic, []).append((records, log_ns))
        self._data.append(data)
        self.size += len(data)

    def batches(self) -> Iterator[Batch]:
        """The messages found, one batch for each topic."""
        buffer = np.frombuffer(b"".join(self._data), np.uint8)
        for topic, parts in self._found.items():
            records = np.concatenate([r for r, _ in parts])
            lengths = np.lib.stride_tricks.sliding_window_view(buffer, 8)[records + 1]
            sizes = np.ascontiguousarray(lengths).view("<i8")[:, 0] - _MESSAGE_HEAD
            log_ns = np.concatenate([ns for _, ns in parts])
            yield Batch(topic, buffer, records + RECORD_HEAD + _MESSAGE_HEAD, sizes, log_ns)


def message_indexes(raw: bytes) -> Iterator[tuple[int, NDArray[np.void]]]:
    """(channel, entries with log_ns and offset) of the MessageIndex records after a chunk.

    Raises ValueError if the bytes are something else.
    """
    at = 0
    while at < len(raw):
        opcode, length = struct.unpack_from("<BQ", raw, at)
        content = raw[at + RECORD_HEAD : at + RECORD_HEAD + length]
        count = int.from_bytes(content[2:6], "little")
        if opcode != Opcode.MESSAGE_INDEX or len(content) != length or length != 6 + count:
            raise ValueError("its message index does not fit")
        yield int.from_bytes(content[:2], "little"), np.frombuffer(content[6:], ENTRY)
        at += RECORD_HEAD + length


def scan_messages(data: bytes) -> dict[int, NDArray[np.void]]:
    """The result of `message_indexes` for a chunk's content, found by scanning its records."""
    found: dict[int, list[tuple[int, int]]] = {}
    at = 0
    while at < len(data):
        opcode, length = struct.unpack_from("<BQ", data, at)
        if opcode == Opcode.MESSAGE:
            channel, _, log_ns = struct.unpack_from("<HIQ", data, at + RECORD_HEAD)
            found.setdefault(channel, []).append((log_ns, at))
        at += RECORD_HEAD + length
    return {channel: np.array(entries, ENTRY) for channel, entries in found.items()}
