"""Making a whole bag of a truncated one: cut behind the last whole chunk, then index what is there (MCAP
1.0).
"""

from __future__ import annotations

import os
import secrets
import shutil
import struct
from itertools import chain, count
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import DataEnd, Footer, Header, Statistics

from deeptruck_model import files
from deeptruck_model.checks import METADATA
from deeptruck_model.errors import InputError
from deeptruck_model.recordings.bag_file import RECORD_HEAD
from deeptruck_model.recordings.bag_metadata import Topic, metadata_yaml
from deeptruck_model.recordings.mcap_chunks import UNREADABLE, why
from deeptruck_model.recordings.mcap_scan import MAGIC, Found, is_an_end, scan


def repair(path: str | Path) -> str | None:
    """Make a bag whose writer was killed (or whose end is missing) whole again, in place.

    `path` is a rosbag2 folder with one MCAP file, or the file itself. Everything in whole chunks is kept;
    returns one line on what was done, None where nothing was wrong. A repaired copy takes its place once
    it is complete, so a kill at any moment leaves the one or the other. What is cut off is kept as
    FILE.mcap.cut, a metadata.yaml that was there as metadata.yaml.before; other files are left alone. Nothing
    tells a torn file of the recorder from another in its place: the ledger of the folder stays as it was, so
    that --overwrite refuses the folder or keeps it aside. Raises InputError where there is no MCAP file or an
    empty one, it is a link or still being written, or the disk cannot be written.
    """
    path = Path(path)
    file = _only_mcap(path)
    whole = _is_whole(file)
    if whole and (path.is_file() or (path / METADATA).exists()):
        return None
    _refuse_links(path, file)
    try:
        with files.writing(file.parent):
            found, cut = _mend(path, file)
    except OSError as error:
        cure = files.advice(error, "make room for a copy and repair it again", "repair a copy elsewhere")
        raise InputError(f"cannot repair {path}: {error.strerror}; nothing was lost, {cure}") from None
    lost = f"the torn end is in {cut.name}" if cut else "nothing was lost"
    kept = sum(found.counts.values())
    return f"{path} was not finished: kept {kept or 'no'} messages, {lost}"


def _refuse_links(path: Path, file: Path) -> None:
    """Raises InputError for a link, whose place a repaired file would take."""
    for one in (file, path / METADATA) if path.is_dir() else (file,):
        if one.is_symlink():
            raise InputError(
                f"{one} is a symbolic link, which a repaired file would replace; repair what it points to, "
                f"{one.resolve()}, or a copy"
            )


def _mend(path: Path, file: Path) -> tuple[Found, Path | None]:
    """Put a repaired copy in the place of `file`; the file that keeps what was cut off, if there is one."""
    draft = file.with_name(f".{file.name}.{secrets.token_hex(4)}.tmp")
    before, is_ours = file.stat(), files.is_as_written(file)
    with files.removing(lambda: draft.unlink(missing_ok=True)):
        shutil.copyfile(file, draft)
        shutil.copymode(file, draft)
        with draft.open("r+b") as stream:
            found = _scanned(stream, file)
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
    """Write `content` under the wanted name, or the next one that is free or holds the same."""
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
    """Whether the first end of a file is that of this one: two that were joined have another behind it."""
    at = len(MAGIC)
    while at + RECORD_HEAD <= size:
        stream.seek(at)
        opcode, length = struct.unpack("<BQ", stream.read(RECORD_HEAD))
        if opcode in (Opcode.DATA_END, Opcode.FOOTER):
            return is_an_end(stream, at, size)
        at += RECORD_HEAD + length
    return True


def _finish(stream: BinaryIO, found: Found) -> None:
    """Cut behind the last whole record and append the end a writer would have written."""
    stream.truncate(found.end)
    stream.seek(found.end)
    builder = RecordBuilder()
    if not found.header:  # killed before anything was safe: an empty bag
        stream.seek(0)
        stream.truncate()
        stream.write(MAGIC)
        Header("ros2", "deeptruck").write(builder)
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
