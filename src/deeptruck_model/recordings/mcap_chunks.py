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
    """A chunk of a file, with the topics of the file's channels."""

    file: Path
    index: ChunkIndex
    topics: dict[int, str]


def indexed_chunks(files: Sequence[Path]) -> list[IndexedChunk] | None:
    """All chunks of the files; None where a file has none, so that its messages must be read in order."""
    chunks = []
    for file in files:
        with file.open("rb") as stream:
            summary = make_reader(stream).get_summary()
        if summary is None or not summary.chunk_indexes:
            return None
        topics = {key: channel.topic for key, channel in summary.channels.items()}
        chunks += [IndexedChunk(file, index, topics) for index in summary.chunk_indexes]
    return chunks or None


def read_chunks(chunks: Sequence[IndexedChunk], topics: set[str]) -> Iterator[Batch]:
    """The messages of the topics, chunk by chunk in the order of the chunks' first messages."""
    with ExitStack() as stack:
        streams: dict[Path, BinaryIO] = {}
        for chunk in sorted(chunks, key=lambda c: c.index.message_start_time):
            held = (
                chunk.index.message_index_offsets or chunk.topics
            )  # without message indexes it may hold any
            wanted = {key: chunk.topics[key] for key in held}
            wanted = {key: topic for key, topic in wanted.items() if topic in topics}
            if wanted and chunk.file not in streams:
                streams[chunk.file] = stack.enter_context(chunk.file.open("rb"))
            if wanted:
                yield from _read(streams[chunk.file], chunk.index, wanted)


def _read(stream: BinaryIO, index: ChunkIndex, wanted: dict[int, str]) -> Iterator[Batch]:
    stream.seek(index.chunk_start_offset)
    raw = stream.read(index.chunk_length + index.message_index_length)
    chunk = Chunk.read(ReadDataStream(BytesIO(raw[RECORD_HEAD : index.chunk_length])))
    content, size = get_chunk_data_stream(chunk, validate_crc=True)
    data = content.read(size)
    buffer = np.frombuffer(data, np.uint8)
    indexed = (
        message_indexes(raw[index.chunk_length :])
        if index.message_index_length
        else scan_messages(data).items()
    )
    for channel, entries in indexed:
        if channel in wanted and len(entries):
            records = entries["offset"].astype(np.int64)
            lengths = np.lib.stride_tricks.sliding_window_view(buffer, 8)[records + 1]
            sizes = np.ascontiguousarray(lengths).view("<i8")[:, 0] - _MESSAGE_HEAD
            starts = records + RECORD_HEAD + _MESSAGE_HEAD
            log_ns = entries["log_ns"].astype(np.int64)
            yield Batch(wanted[channel], buffer, starts, sizes, log_ns, index.message_start_time)


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
