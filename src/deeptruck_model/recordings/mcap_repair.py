"""Repair a truncated MCAP file: cut it after the last whole chunk and rebuild its index."""

from __future__ import annotations

import os
import secrets
import shutil
import struct
from dataclasses import dataclass, field
from io import BytesIO
from itertools import chain, count
from pathlib import Path
from typing import BinaryIO

import numpy as np
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.stream_reader import get_chunk_data_stream
from numpy.typing import NDArray

from deeptruck_model import files
from deeptruck_model.checks import METADATA
from deeptruck_model.errors import InputError
from deeptruck_model.recordings.bag_file import RECORD_HEAD
from deeptruck_model.recordings.bag_metadata import Topic, metadata_yaml
from deeptruck_model.recordings.mcap_chunks import (
    ENTRY,
    UNREADABLE,
    content_of,
    message_indexes,
    scan_messages,
    why,
)

_END = {Opcode.DATA_END: 4, Opcode.FOOTER: 20}  # bytes of the records behind which all is made anew
_SUMMARY = {  # what may stand behind the messages
    *_END, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS, Opcode.CHUNK_INDEX, Opcode.ATTACHMENT_INDEX,
    Opcode.METADATA_INDEX, Opcode.SUMMARY_OFFSET,
}  # fmt: skip
MAGIC = b"\x89MCAP0\r\n"


@dataclass(frozen=True)
class _WholeChunk:
    """An undamaged chunk, and the positions of its messages by channel."""

    chunk: Chunk
    entries: dict[int, NDArray[np.void]]

    @classmethod
    def of(cls, content: bytes) -> _WholeChunk | None:
        """The chunk in a record; None if it is damaged."""
        try:
            chunk = Chunk.read(ReadDataStream(BytesIO(content)))
            records = 32 + len(chunk.compression.encode())  # behind times, size, checksum and compression
            if int.from_bytes(content[records : records + 8], "little") != len(content) - records - 8:
                return None
            return cls(chunk, scan_messages(content_of(chunk)))
        except UNREADABLE:
            return None

    def has_index(self, begin: bytes, length: int) -> bool:
        """Whether a record of this length can be the index of one of its channels, which `begin` names."""
        messages = self.entries.get(int.from_bytes(begin[:2], "little"), ())
        return len(begin) < 2 or length == 6 + ENTRY.itemsize * len(messages)


@dataclass
class Found:
    """Result of scanning the data section, and the end of its last complete record."""

    end: int
    cut: int = 0  # where the scan ended in the file as it was found
    torn: bool = False  # whether more lies behind that than an index, which is made anew
    tail: _WholeChunk | None = None  # the last chunk: not all its message indexes may be there
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[ChunkIndex] = field(default_factory=list)
    counts: dict[int, int] = field(default_factory=dict)
    metadata: list[tuple[MetadataIndex, Metadata]] = field(default_factory=list)


def scan(stream: BinaryIO, size: int, file: Path) -> Found:
    """Intact records from the beginning; message indexes that do not fit their chunk are rebuilt."""
    found = Found(end=min(size, len(MAGIC)))
    at = len(MAGIC)
    while at + RECORD_HEAD <= size:
        stream.seek(at)
        opcode, length = struct.unpack("<BQ", stream.read(RECORD_HEAD))
        if opcode in _END and at + RECORD_HEAD + length <= size:
            found.torn = _END[Opcode(opcode)] != length or not is_an_end(stream, at, size)
            break
        if opcode in _END or at + RECORD_HEAD + length > size:
            found.torn = not _is_made_anew(opcode, length, stream.read(2), found.tail)
            break
        if not _take(found, opcode, stream.read(length), at, stream, file):
            found.torn = True
            break
        at += RECORD_HEAD + length
        found.end = at
    else:
        found.torn = at < size
    found.cut = min(at, size)
    if found.tail is not None:
        _index_again(stream, found, found.tail.chunk)
    return found


def is_an_end(stream: BinaryIO, at: int, size: int) -> bool:
    """Whether the bytes from `at` on are only the closing part of a file, complete or truncated."""
    while at + RECORD_HEAD <= size:
        stream.seek(at)
        opcode, length = struct.unpack("<BQ", stream.read(RECORD_HEAD))
        if opcode not in _SUMMARY:
            return False
        at += RECORD_HEAD + length
        if opcode == Opcode.FOOTER and at <= size:
            stream.seek(at)
            return size - at <= len(MAGIC) and MAGIC.startswith(stream.read())
    return True


def _take(found: Found, opcode: int, content: bytes, at: int, stream: BinaryIO, file: Path) -> bool:
    """Note one record; False if it is damaged."""
    if opcode == Opcode.CHUNK:
        if (whole := _WholeChunk.of(content)) is None:
            return False
        found.tail = whole
        found.chunks.append(_chunk_index(whole, at, len(content) + RECORD_HEAD))
    elif opcode == Opcode.MESSAGE_INDEX:
        if found.tail is None or not found.tail.has_index(content, len(content)):
            return False
        _note_index(found, found.tail, content, at, stream)
    elif opcode in (Opcode.HEADER, Opcode.METADATA):
        _note_loose(found, opcode, content, at)
    else:
        raise InputError(f"{file} was written in a way repair does not know (record type {opcode})")
    return True


def _is_made_anew(opcode: int, length: int, begin: bytes, tail: _WholeChunk | None) -> bool:
    """Whether the truncated record is an index or the end of a file, which are rebuilt anyway."""
    if opcode == Opcode.MESSAGE_INDEX:
        return tail is not None and tail.has_index(begin, length)
    return _END.get(Opcode(opcode)) == length if opcode in _END else False


def _chunk_index(whole: _WholeChunk, at: int, length: int) -> ChunkIndex:
    """Index entry of a chunk at `at`; its times are those of its messages, because no checksum protects those
    in its header."""
    times = [int(ns) for entries in whole.entries.values() for ns in entries["log_ns"]]
    return ChunkIndex(
        chunk_length=length,
        chunk_start_offset=at,
        compression=whole.chunk.compression,
        compressed_size=len(whole.chunk.data),
        message_end_time=max(times, default=0),
        message_index_length=0,
        message_index_offsets={},
        message_start_time=min(times, default=0),
        uncompressed_size=whole.chunk.uncompressed_size,
    )


def _note_index(found: Found, whole: _WholeChunk, content: bytes, at: int, stream: BinaryIO) -> None:
    """Note a message index; one with wrong positions is rewritten."""
    channel = int.from_bytes(content[:2], "little")
    if channel not in found.channels:
        _learn_channels(found, whole.chunk)
    entries = whole.entries.get(channel, np.zeros(0, ENTRY))
    if not np.array_equal(np.sort(np.frombuffer(content[6:], ENTRY)), np.sort(entries)) or (
        int.from_bytes(content[2:6], "little") != len(content) - 6
    ):
        stream.seek(at)
        stream.write(_index_record(channel, entries))
    index = found.chunks[-1]
    index.message_index_offsets[channel] = at
    index.message_index_length += RECORD_HEAD + len(content)
    found.counts[channel] = found.counts.get(channel, 0) + len(entries)


def _index_record(channel: int, entries: NDArray[np.void]) -> bytes:
    builder = RecordBuilder()
    MessageIndex(channel, [(int(log_ns), int(offset)) for log_ns, offset in entries]).write(builder)
    return builder.end()


def _note_loose(found: Found, opcode: int, content: bytes, at: int) -> None:
    if opcode == Opcode.HEADER:
        return
    try:
        metadata = Metadata.read(ReadDataStream(BytesIO(content)))
    except UNREADABLE:
        return  # it stays where it is, and nothing leads to it
    found.metadata.append((MetadataIndex(at, RECORD_HEAD + len(content), metadata.name), metadata))


def _learn_channels(found: Found, chunk: Chunk) -> None:
    stream, size = get_chunk_data_stream(chunk)
    while stream.count < size:
        opcode, length = stream.read1(), stream.read8()
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            found.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            found.channels[channel.id] = channel
        else:
            stream.read(length)


def _index_again(stream: BinaryIO, found: Found, chunk: Chunk) -> None:
    """Rewrite the last chunk's message indexes, in case some were cut off."""
    last = found.chunks[-1]
    behind = last.chunk_start_offset + last.chunk_length
    stream.seek(behind)
    for channel, entries in message_indexes(stream.read(last.message_index_length)):
        found.counts[channel] -= len(entries)
    _learn_channels(found, chunk)
    builder = RecordBuilder()
    last.message_index_offsets.clear()
    stream_of_chunk, size = get_chunk_data_stream(chunk)
    for channel, entries in scan_messages(stream_of_chunk.read(size)).items():
        records = [(int(log_ns), int(offset)) for log_ns, offset in entries]
        last.message_index_offsets[channel] = behind + builder.count
        MessageIndex(channel, records).write(builder)
        found.counts[channel] = found.counts.get(channel, 0) + len(records)
    last.message_index_length = builder.count
    for place, (index, metadata) in enumerate(found.metadata):
        if index.offset >= behind:  # where the indexes go now
            offset = behind + builder.count
            metadata.write(builder)
            again = MetadataIndex(offset, behind + builder.count - offset, metadata.name)
            found.metadata[place] = (again, metadata)
    stream.seek(behind)
    stream.write(builder.end())
    found.end = stream.tell()


def repair(path: str | Path) -> str | None:
    """Repair, in place, a bag whose writer was killed or whose end is missing.

    `path` is a rosbag2 folder with one MCAP file, or the file. Every complete chunk is kept. Returns one line
    on what was done, None if nothing was wrong. The repaired copy replaces the file only when complete, so a
    kill at any moment leaves one of the two. The part cut off is kept as FILE.mcap.cut, an existing
    metadata.yaml as metadata.yaml.before; other files are left alone. The folder's ledger is not updated,
    because a file that the recorder left incomplete cannot be distinguished from another file of that name;
    --overwrite therefore refuses the folder or keeps it aside. Raises InputError if there is no MCAP file, if
    it holds no whole chunk, is a link or still being written, or if the disk cannot be written.
    """
    path = Path(path)
    file = _only_mcap(path)
    whole = _is_whole(file)
    if whole and (path.is_file() or (path / METADATA).exists()):
        return None
    _refuse_links(path, file)
    try:
        with files.writing(file.parent):
            found, cut = _mend(path, file, is_whole=whole)
    except OSError as error:
        cure = files.advice(error, "make room for a copy and repair it again", "repair a copy elsewhere")
        raise InputError(f"cannot repair {path}: {error.strerror}; nothing was lost, {cure}") from None
    lost = f"the torn end is in {cut.name}" if cut else "nothing was lost"
    kept = sum(found.counts.values())
    return f"{path} was not finished: kept {kept} message{'s' * (kept != 1)}, {lost}"


def _refuse_links(path: Path, file: Path) -> None:
    """Raises InputError for a link, which the repaired file would replace."""
    for one in (file, path / METADATA) if path.is_dir() else (file,):
        if one.is_symlink():
            raise InputError(
                f"{one} is a symbolic link, which a repaired file would replace; repair what it points to, "
                f"{one.resolve()}, or a copy"
            )


def _mend(path: Path, file: Path, *, is_whole: bool) -> tuple[Found, Path | None]:
    """Replace `file` by the repaired copy; returns the file that keeps the cut-off part, if there is one.
    Raises InputError for a file that is not whole and of which no message can be kept."""
    draft = file.with_name(f".{file.name}.{secrets.token_hex(4)}.tmp")
    before, is_ours = file.stat(), files.is_as_written(file)
    with files.removing(lambda: draft.unlink(missing_ok=True)):
        shutil.copyfile(file, draft)
        shutil.copymode(file, draft)
        with draft.open("r+b") as stream:
            found = _scanned(stream, file)
            if not is_whole and not sum(found.counts.values()):
                raise InputError(
                    f"{file} holds no whole chunk of messages in its {before.st_size:,} bytes: no message "
                    "can be kept, it is left as it was; take another copy of it, or record anew"
                )
            _finish(stream, found)
            stream.flush()
            os.fsync(stream.fileno())
        cut = _kept(file.with_name(f"{file.name}.cut"), _behind(file, found.cut)) if found.torn else None
        after = file.stat()
        if (after.st_size, after.st_mtime_ns) != (before.st_size, before.st_mtime_ns):
            raise InputError(f"{file} is still being written; end its recorder first")
        if path.is_dir():
            if (
                path / METADATA
            ).exists():  # away before the new file: without one a bag is known as unfinished
                _kept(path / f"{METADATA}.before", (path / METADATA).read_bytes())
                (path / METADATA).unlink()
            draft.replace(file)
            _describe(path, file, found)
            if is_ours:
                files.renew(file)
                files.renew(path / METADATA)
        else:
            draft.replace(file)
        return found, cut


def _scanned(stream: BinaryIO, file: Path) -> Found:
    try:
        return scan(stream, stream.seek(0, os.SEEK_END), file)
    except UNREADABLE as error:
        raise InputError(f"{file} is damaged ({why(error)}), beyond repair; it is left as it was") from None


def _behind(file: Path, at: int) -> bytes:
    with file.open("rb") as stream:
        stream.seek(at)
        return stream.read()


def _kept(wanted: Path, content: bytes) -> Path:
    """Write `content` under the desired name, or the next one that is free or already holds it."""
    names = chain([wanted], (wanted.with_name(f"{wanted.name}{number}") for number in count(2)))
    place = next(p for p in names if not p.exists() or (p.is_file() and p.read_bytes() == content))
    if not place.exists():
        with files.new_file(place) as draft:
            draft.write_bytes(content)
    return place


def _only_mcap(path: Path) -> Path:
    if not path.exists():
        raise InputError(f"{path} does not exist")
    files = [path] if path.is_file() else sorted(path.glob("*.mcap"))
    if path.suffix == ".db3" or (not files and any(path.glob("*.db3"))):
        raise InputError(
            f"{path} is a database (.db3), which is whole at any time: nothing to repair; it is read as it "
            "is, without metadata.yaml too"
        )
    if not files:
        raise InputError(f"{path} holds no MCAP file; give the folder that the recorder wrote")
    if len(files) > 1:
        raise InputError(f"{path} holds {len(files)} MCAP files; repair needs exactly one")
    if not files[0].is_file():
        raise InputError(f"{files[0]} is no file")
    with files[0].open("rb") as stream:
        begin = stream.read(len(MAGIC))
    if not begin:
        raise InputError(f"{files[0]} is empty, so there is nothing to repair; record anew")
    if not MAGIC.startswith(begin):
        raise InputError(f"{files[0]} is not an MCAP file")
    return files[0]


def _is_whole(file: Path) -> bool:
    with file.open("rb") as stream:
        if stream.seek(0, os.SEEK_END) < 2 * len(MAGIC):
            return False
        size = stream.seek(-len(MAGIC), os.SEEK_END) + len(MAGIC)
        return stream.read() == MAGIC and _is_one_file(stream, size)


def _is_one_file(stream: BinaryIO, size: int) -> bool:
    """Whether the first end marker is that of this file; two concatenated files have another one after it."""
    at = len(MAGIC)
    while at + RECORD_HEAD <= size:
        stream.seek(at)
        opcode, length = struct.unpack("<BQ", stream.read(RECORD_HEAD))
        if opcode in (Opcode.DATA_END, Opcode.FOOTER):
            return is_an_end(stream, at, size)
        at += RECORD_HEAD + length
    return False  # a record runs over the end


def _finish(stream: BinaryIO, found: Found) -> None:
    """Truncate after the last complete record and append the end that a writer would have written."""
    stream.truncate(found.end)
    stream.seek(found.end)
    builder = RecordBuilder()
    DataEnd(0).write(builder)
    stream.write(builder.end())
    summary_start = stream.tell()
    for record in (*found.schemas.values(), *found.channels.values(), _statistics(found), *found.chunks):
        record.write(builder)
    for index, _ in found.metadata:
        index.write(builder)
    Footer(summary_start=summary_start, summary_offset_start=0, summary_crc=0).write(builder)
    stream.write(builder.end() + MAGIC)


def _statistics(found: Found) -> Statistics:
    return Statistics(
        attachment_count=0,
        channel_count=len(found.channels),
        channel_message_counts=dict(found.counts),
        chunk_count=len(found.chunks),
        message_count=sum(found.counts.values()),
        message_end_time=max((c.message_end_time for c in found.chunks), default=0),
        message_start_time=min((c.message_start_time for c in found.chunks), default=0),
        metadata_count=len(found.metadata),
        schema_count=len(found.schemas),
    )


def _describe(path: Path, file: Path, found: Found) -> None:
    topics = [
        Topic(channel.topic, found.schemas[channel.schema_id].name, found.counts.get(channel.id, 0))
        for channel in found.channels.values()
    ]
    custom = {
        metadata.name: metadata.metadata["json"]
        for _, metadata in found.metadata
        if "json" in metadata.metadata
    }
    statistics = _statistics(found)
    content = metadata_yaml(
        file.name, topics, statistics.message_start_time, statistics.message_end_time, custom
    )
    with files.new_file(path / METADATA) as draft:  # of a name that nobody else has
        draft.write_text(content, encoding="utf-8")
