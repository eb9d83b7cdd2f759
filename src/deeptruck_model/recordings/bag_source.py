"""Reads raw messages from any bag: MCAP a chunk at a time, other storages through rosbags."""

from __future__ import annotations

import json
import struct
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.records import Metadata

from deeptruck_core import reading
from deeptruck_core.errors import InputError
from deeptruck_model.recordings import bag_file
from deeptruck_model.recordings.bag_facts import (
    EXTRA_KEY,
    INTERFACE_KEY,
    METADATA,
    NOTES_KEY,
    RECORD_AGAIN,
    check_folder,
    data_file,
    information_of,
    parts,
)
from deeptruck_model.recordings.bag_file import DamagedError, TornError
from deeptruck_model.recordings.bag_storage import open_storage
from deeptruck_model.recordings.mcap_chunks import LATEST_NS, Batch, indexed_chunks, read_chunks
from deeptruck_model.recordings.message_definitions import Definitions

__all__ = ["EXTRA_KEY", "INTERFACE_KEY", "NOTES_KEY", "BagSource"]

OURS = "deeptruck."  # begins the keys whose values are JSON
_LISTED = 8  # topics that one line names
_BATCH = 65536  # messages read one by one are handed on in batches of this many


class BagSource:
    """An open bag: a rosbag2 folder (MCAP or sqlite3), a single .mcap or .db3 file, or a ROS 1 .bag.

    `messages` are .msg files for types whose definition the bag lacks. Use as a context manager. Raises
    InputError if there is no bag, if it has no message, or if it is truncated or damaged.
    """

    def __init__(self, path: Path, messages: Sequence[Path] = ()) -> None:
        self.path = path
        self.ros1 = path.suffix == ".bag" and path.is_file()
        self._message_files = messages
        self._stack = ExitStack()
        self._custom: Mapping[str, Any] = {}
        self.untimed = Counter[str]()  # messages by topic that were logged at an impossible time
        self._packs_messages = False  # whether each message is compressed by itself

    def __enter__(self) -> BagSource:
        self._check_path()
        try:
            files = self._files()
            if self.ros1:
                bag_file.check_ros1(self.path)
            self._mcap_files = [file for file in files if file.suffix == ".mcap"]
            self._records = {file: bag_file.check_mcap(file) for file in self._mcap_files}
            indexed_chunks(self._mcap_files)  # whose places are trusted from here on
            self._storages = [open_storage(file, self._stack) for file in files]
            self.connections = [c for storage in self._storages for c in storage.connections]
        except InputError:
            self._stack.close()
            raise
        except Exception as error:  # the libraries raise whatever a damaged byte leads them to
            self._stack.close()
            raise self._unopened(error) from None
        if not any(c.count for c in self.connections):
            self._stack.close()
            raise InputError(f"{self.path} is empty, it holds no message; {RECORD_AGAIN}")
        self.types = Definitions(self.connections, self._message_files, ros1=self.ros1)
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _unopened(self, error: Exception) -> InputError:
        """Why the bag could not be opened, with a cure."""
        cure = "copy it anew from where it was recorded, or leave it out"
        if isinstance(error, TornError):
            cure = (
                f"what comes before the damage is kept by 'deeptruck-model repair {reading.typed(self.path)}'"
            )
        elif self.ros1:
            cure = f"one whose end is missing is repaired by 'rosbag reindex {self.path.name}' of ROS 1"
        elif self.path.is_file():
            cure = "a table or CAN log needs 'deeptruck-model import'"
        return InputError(f"{self.path} cannot be read as a bag ({reading.why(error)}); {cure}")

    def _check_path(self) -> None:
        """Raises InputError if the path cannot be a bag; pipes and devices are not opened."""
        if not self.path.exists():
            raise InputError(f"{self.path} does not exist")
        if self.path.is_dir():
            check_folder(self.path)
        for file in self._listed() if self.path.is_dir() else [self.path]:
            if file.suffix in (".mcap", ".db3", ".zstd", ".bag") or file.name == METADATA:
                reading.check_file(file, "give a recorded bag")

    def _files(self) -> list[Path]:
        """The files of the bag in order; for a database without metadata all of them."""
        if not self.path.is_dir():
            return [self.path]
        if not (self.path / METADATA).exists():
            return sorted(self.path.glob("*.db3")) or parts(self.path)
        information = information_of(self.path / METADATA)
        self._packs_messages = str(information.get("compression_mode") or "").lower() == "message"
        custom = information.get("custom_data")
        self._custom = custom if isinstance(custom, Mapping) else {}
        files = [data_file(self.path, str(name)) for name in information["relative_file_paths"]]
        for file in files:
            if not file.is_file():
                raise DamagedError(f"it has lost {file.name}")
        return files

    def _listed(self) -> list[Path]:
        try:
            return sorted(self.path.iterdir())
        except OSError as error:
            raise InputError(f"{self.path} cannot be read: {error.strerror}") from None

    @property
    def definitions(self) -> dict[str, Any]:
        """The fields of the message types by name."""
        return self.types.types

    @property
    def topics(self) -> dict[str, str]:
        """Message type by topic; of a topic with several types, the one with most messages."""
        return {topic: kind for (topic, kind), _ in sorted(self._counts().items(), key=lambda item: item[1])}

    def _counts(self) -> dict[tuple[str, str], int]:
        """Number of messages by topic and type, from the indexes of the files."""
        counts: dict[tuple[str, str], int] = {}
        for c in self.connections:
            counts[c.topic, c.msgtype] = counts.get((c.topic, c.msgtype), 0) + c.count
        return counts

    def why_unreadable(self, topic: str) -> str:
        """The reason why messages on a topic cannot be read, with the cure; '' if they can."""
        kind = self.topics[topic]
        encodings = {c.encoding for c in self.connections if c.topic == topic and c.msgtype == kind}
        if not encodings <= {"cdr", "ros1"}:
            return f"its messages are written in {', '.join(sorted(encodings))}, not in ROS's CDR"
        if kind in self.types.types:
            return ""
        return f"{self.types.unreadable.get(kind, 'the bag does not carry the definition of this type')}"

    def other_types(self, topics: set[str]) -> list[tuple[str, str, int]]:
        """(topic, message type, number of messages) of messages on `topics` whose type differs from the
        topic's in `self.topics`, from the bag's index."""
        types = self.topics
        return [
            (topic, kind, count)
            for (topic, kind), count in self._counts().items()
            if topic in topics and kind != types[topic] and count
        ]

    def not_mapped(self, topics: set[str]) -> list[str]:
        """One line on the topics outside `topics` that have messages, and one on those that cannot be
        read."""
        counts: dict[str, int] = {}
        for (topic, _), count in self._counts().items():
            if topic not in topics and count:
                counts[topic] = counts.get(topic, 0) + count
        said = ", ".join(f"{topic} ({count})" for topic, count in sorted(counts.items())[:_LISTED])
        more = f" and {len(counts) - _LISTED} more" if len(counts) > _LISTED else ""
        lines = [f"topics not mapped, so not read: {reading.plain(said, 500)}{more}"] if counts else []
        why = {topic: self.why_unreadable(topic) for topic in sorted(counts)}
        unreadable = [f"{topic}: {reading.plain(reason)}" for topic, reason in why.items() if reason]
        return [*lines, *(f"messages that cannot be read on {line}" for line in unreadable[:_LISTED])]

    def stored(self) -> dict[str, str]:
        """Texts stored in the bag by key: its custom_data, or else our MCAP metadata."""
        found = {str(k): str(v) for k, v in self._custom.items()}
        for file in self._mcap_files:
            for name, entries in self._metadata(file):
                if "json" in entries:
                    found.setdefault(name, entries["json"])
        return found

    def custom_data(self) -> dict[str, Any]:
        """JSON values stored in the bag under `deeptruck.*`. Raises InputError if one is not JSON."""
        return {key: _from_json(self.path, key, text) for key, text in self.stored().items() if OURS in key}

    def _metadata(self, file: Path) -> Iterator[tuple[str, dict[str, str]]]:
        with file.open("rb") as stream:
            for start, length in self._records[file].metadata:
                stream.seek(start)
                try:
                    record = Metadata.read(ReadDataStream(BytesIO(stream.read(length))))
                except (McapError, struct.error, UnicodeDecodeError) as error:
                    raise self._damaged(error) from None
                yield record.name, record.metadata

    def batches(self, topics: set[str]) -> Iterator[Batch]:
        """All messages of the topics, in any order."""
        try:
            chunks = None
            if self._mcap_files and not self._packs_messages:
                chunks = indexed_chunks(self._mcap_files)
            types = {topic: kind for topic, kind in self.topics.items() if topic in topics}
            all_of = self._one_by_one(topics) if chunks is None else read_chunks(chunks, types)
            yield from filter(None, map(self._timed, all_of))
        except DamagedError as error:
            raise self._damaged(error) from None

    def _timed(self, batch: Batch) -> Batch | None:
        """The messages that were logged at a possible time; the others are counted."""
        good = (batch.log_ns >= 0) & (batch.log_ns < LATEST_NS)
        if good.all():
            return batch
        self.untimed[batch.topic] += int((~good).sum())
        kept = replace(batch, starts=batch.starts[good], sizes=batch.sizes[good], log_ns=batch.log_ns[good])
        return kept if good.any() else None

    @property
    def last_ns(self) -> int:
        """Log time of the last message, ns."""
        return max(storage.last_ns for storage in self._storages)

    def messages(self, topics: set[str], from_ns: int = 0) -> Iterator[tuple[str, int, bytes]]:
        """(topic, log time in ns, serialised message) of the topics, in the order of their log times, from
        `from_ns` on."""
        types = self.topics
        try:
            for storage in self._storages:
                wanted = {
                    c.key: c.topic
                    for c in storage.connections
                    if c.topic in topics and c.msgtype == types[c.topic]
                }
                unpack = zstandard.ZstdDecompressor().decompressobj
                for key, log_ns, data in storage.messages(set(wanted), from_ns):
                    yield wanted[key], log_ns, unpack().decompress(data) if self._packs_messages else data
        except Exception as error:  # the libraries raise whatever a damaged byte leads them to
            raise self._damaged(error) from None

    def _damaged(self, error: Exception) -> InputError:
        return InputError(
            f"{self.path} is damaged: {reading.why(error)}; copy it anew from where it was recorded, "
            "or leave it out"
        )

    def _one_by_one(self, topics: set[str]) -> Iterator[Batch]:
        held: dict[str, list[tuple[int, bytes]]] = {}
        for count, (topic, log_ns, data) in enumerate(self.messages(topics), 1):
            held.setdefault(topic, []).append((log_ns, data))
            if count % _BATCH == 0:
                yield from (_joined(topic, messages) for topic, messages in held.items())
                held = {}
        yield from (_joined(topic, messages) for topic, messages in held.items())


def _joined(topic: str, messages: list[tuple[int, bytes]]) -> Batch:
    sizes = np.array([len(data) for _, data in messages], dtype=np.int64)
    buffer = np.frombuffer(b"".join(data for _, data in messages), np.uint8)
    log_ns = np.array([stamp for stamp, _ in messages], dtype=np.int64)
    return Batch(topic, buffer, np.cumsum(sizes) - sizes, sizes, log_ns)


def _from_json(path: Path, key: str, text: Any) -> Any:
    try:
        return json.loads(text)
    except (ValueError, TypeError, RecursionError) as error:
        raise InputError(f"{path}: its {key} is not JSON ({reading.why(error)}); copy it anew") from None
