"""Repair a truncated MCAP file: copy its whole chunks, and write their index anew."""

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

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_model.recordings.bag_facts import METADATA
from deeptruck_model.recordings.bag_file import (
    MAGIC,
    RECORD_HEAD,
    DamagedError,
    TornError,
    check_mcap,
)
from deeptruck_model.recordings.crash_safe import Topic, metadata_yaml
from deeptruck_model.recordings.mcap_chunks import ENTRY, UNREADABLE, content_of, learn, scan_messages

_END = {Opcode.DATA_END: 4, Opcode.FOOTER: 20}  # bytes of the records behind which all is made anew
_SUMMARY = {  # what may stand behind the messages
    *_END, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS, Opcode.CHUNK_INDEX, Opcode.ATTACHMENT_INDEX,
    Opcode.METADATA_INDEX, Opcode.SUMMARY_OFFSET,
}  # fmt: skip


@dataclass
class Found:
    """What was copied of a file."""

    cut: int = len(MAGIC)  # where the last record that was used ends in the file as it was found
    torn: bool = False  # whether more lies behind that than an index, which is made anew
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[ChunkIndex] = field(default_factory=list)
    counts: dict[int, int] = field(default_factory=dict)  # messages by channel
    metadata: list[tuple[MetadataIndex, Metadata]] = field(default_factory=list)
    indexes: set[int] = field(default_factory=set)  # lengths of the message indexes of the last chunk


def copied(source: BinaryIO, target: BinaryIO, file: Path) -> Found:
    """Copy the records up to the first damaged one; message indexes are written anew."""
    size = source.seek(0, os.SEEK_END)
    found = Found(cut=min(size, len(MAGIC)))
    target.write(MAGIC)
    while found.cut + RECORD_HEAD <= size:
        source.seek(found.cut)
        opcode, length = struct.unpack("<BQ", source.read(RECORD_HEAD))
        whole = found.cut + RECORD_HEAD + length <= size
        if opcode in _END or (opcode == Opcode.MESSAGE_INDEX and not whole):
            expected = {_END[Opcode(opcode)]} if opcode in _END else found.indexes
            found.torn = length not in expected or (whole and not _is_an_end(source, found.cut, size))
            return found
        if not whole or not _take(found, opcode, source.read(length), target, file):
            found.torn = True
            return found
        found.cut += RECORD_HEAD + length
    found.torn = found.cut < size
    return found


def _take(found: Found, opcode: int, content: bytes, target: BinaryIO, file: Path) -> bool:
    """Copy one record; False if it is damaged."""
    at = target.tell()
    record = struct.pack("<BQ", opcode, len(content)) + content
    if opcode == Opcode.CHUNK:
        return _take_chunk(found, content, record, target)
    if opcode == Opcode.MESSAGE_INDEX:
        return len(content) in found.indexes
    if opcode not in (Opcode.HEADER, Opcode.METADATA):
        raise InputError(f"{file} was written in a way repair does not know (record type {opcode})")
    target.write(record)
    if opcode == Opcode.METADATA:
        try:
            metadata = Metadata.read(ReadDataStream(BytesIO(content)))
        except UNREADABLE:
            return True  # it is copied as it is, and nothing leads to it
        found.metadata.append((MetadataIndex(at, len(record), metadata.name), metadata))
    return True


def _take_chunk(found: Found, content: bytes, record: bytes, target: BinaryIO) -> bool:
    """Copy a chunk with the indexes of its messages; False if it is damaged.

    Its times in the index are those of its messages, because no checksum protects those in its header.
    """
    try:
        chunk = Chunk.read(ReadDataStream(BytesIO(content)))
        records = 32 + len(chunk.compression.encode())  # behind times, size, checksum and compression
        if int.from_bytes(content[records : records + 8], "little") != len(content) - records - 8:
            return False
        messages = content_of(chunk)
        entries = scan_messages(messages)
        learn(schemas := dict(found.schemas), channels := dict(found.channels), messages)
    except UNREADABLE:
        return False
    if not all(key in channels and channels[key].schema_id in schemas for key in entries):
        return False
    found.schemas, found.channels = schemas, channels
    at, behind, builder = target.tell(), target.tell() + len(record), RecordBuilder()
    offsets = {}
    for channel, positions in entries.items():
        offsets[channel] = behind + builder.count
        MessageIndex(channel, [(int(log_ns), int(offset)) for log_ns, offset in positions]).write(builder)
        found.counts[channel] = found.counts.get(channel, 0) + len(positions)
    found.indexes = {6 + ENTRY.itemsize * len(positions) for positions in entries.values()}
    times = [int(ns) for positions in entries.values() for ns in positions["log_ns"]]
    found.chunks.append(
        ChunkIndex(
            chunk_length=len(record),
            chunk_start_offset=at,
            compression=chunk.compression,
            compressed_size=len(chunk.data),
            message_end_time=max(times, default=0),
            message_index_length=builder.count,
            message_index_offsets=offsets,
            message_start_time=min(times, default=0),
            uncompressed_size=chunk.uncompressed_size,
        )
    )
    target.write(record + builder.end())
    return True


def _is_an_end(stream: BinaryIO, at: int, size: int) -> bool:
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


def repair(path: str | Path) -> str | None:
    """Repair, in place, a bag whose writer was killed or whose end is missing.

    `path` is a rosbag2 folder with one MCAP file, or the file. Every complete chunk is kept. Returns one line
    on what was done, None if nothing was wrong. The repaired copy replaces the file only when complete, so a
    kill at any moment leaves one of the two. The part cut off is kept as FILE.mcap.cut, an existing
    metadata.yaml as metadata.yaml.before; other files are left alone. Raises InputError if there is no MCAP
    file, if it holds no whole chunk, is a link or still being written, or if the disk cannot be written.
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
    before = file.stat()
    with files.removing(lambda: draft.unlink(missing_ok=True)):
        with file.open("rb") as source, draft.open("xb") as target:
            found = copied(source, target, file)
            if not is_whole and not sum(found.counts.values()):
                raise InputError(
                    f"{file} holds no whole chunk of messages in its {before.st_size:,} bytes: no "
                    "message can be kept, it is left as it was; take another copy of it, or record anew"
                )
            _finish(target, found)
            target.flush()
            os.fsync(target.fileno())
        shutil.copymode(file, draft)
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
        else:
            draft.replace(file)
        return found, cut


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
    """Whether the records fit up to the end, by the rule of readers; a wrong checksum is not torn."""
    try:
        check_mcap(file)
    except DamagedError as error:
        return not isinstance(error, TornError)
    return True


def _finish(stream: BinaryIO, found: Found) -> None:
    """Append the end that a writer would have written."""
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
