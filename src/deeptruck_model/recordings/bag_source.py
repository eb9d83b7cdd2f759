"""Raw messages out of any bag: MCAP chunk by chunk without touching single messages, the rest through
rosbags.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.records import Metadata
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from deeptruck_model import reading
from deeptruck_model.checks import INTERFACE_KEY, MANIFEST, NOTES_KEY, RECORD_AGAIN
from deeptruck_model.errors import InputError
from deeptruck_model.recordings import bag_file
from deeptruck_model.recordings.bag_file import DamagedError
from deeptruck_model.recordings.mcap_chunks import LATEST_NS, Batch, indexed_chunks, read_chunks

__all__ = ["INTERFACE_KEY", "NOTES_KEY", "BagSource"]

OURS = "deeptruck."  # begins the keys whose values are JSON
_LISTED = 8  # topics that one line names
_BATCH = 65536  # messages read one by one are handed on in batches of this many


class BagSource:
    """One bag, open: rosbag2 folder (MCAP or sqlite3), a lone .mcap or .db3 file, or a ROS 1 .bag.

    Use as a context manager. Raises InputError where there is no bag, no message in it, or it is truncated
    or damaged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.ros1 = path.suffix == ".bag"
        self._stack = ExitStack()

    def __enter__(self) -> BagSource:
        self._check_path()
        try:
            if self.ros1:
                bag_file.check_ros1(self.path)
            self._records = {
                file: bag_file.check_mcap(file) for file in self._files() if file.suffix == ".mcap"
            }
            indexed_chunks(list(self._records))  # whose places rosbags would trust
            for file in self._files():
                bag_file.check_packed(file)
            self._reader = self._stack.enter_context(
                AnyReader([self.path], default_typestore=get_typestore(Stores.ROS2_JAZZY))
            )
            _check_counts(self._reader)
        except Exception as error:  # rosbags raises whatever a damaged byte leads it to
            self._stack.close()
            raise InputError(
                f"{self.path} cannot be read as a bag ({_one_line(error)}); a table or CAN log needs "
                "'deeptruck-model import', a cut-off bag 'deeptruck-model repair'"
            ) from None
        if not self._reader.message_count:
            self._stack.close()
            raise InputError(f"{self.path} is empty, it holds no message; {RECORD_AGAIN}")
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _check_path(self) -> None:
        """Raises InputError where there is nothing that could be a bag; pipes and devices are not opened."""
        if not self.path.exists():
            raise InputError(f"{self.path} does not exist")
        if self.path.is_dir() and not any(self._listed()):
            raise InputError(f"{self.path} is empty, it holds no bag; {RECORD_AGAIN}")
        if (self.path / MANIFEST).exists():
            raise InputError(f"{self.path} is a simulator directory, not a bag; give a recording there")
        if self.path.is_dir() and not (self.path / "metadata.yaml").exists():
            raise InputError(
                f"{self.path} is not a finished bag (it has no metadata.yaml); "
                "if its recorder was killed, mend it with 'deeptruck-model repair'"
            )
        for file in self._files():
            reading.check_file(file, "give a recorded bag")

    def _files(self) -> list[Path]:
        """The files of which the bag is made."""
        if not self.path.is_dir():
            return [self.path]
        return [
            f for f in self._listed() if f.suffix in (".mcap", ".db3", ".zstd") or f.name == "metadata.yaml"
        ]

    def _listed(self) -> list[Path]:
        try:
            return sorted(self.path.iterdir())
        except OSError as error:
            raise InputError(f"{self.path} cannot be read: {error.strerror}") from None

    @property
    def definitions(self) -> dict[str, Any]:
        """Message definitions by type name, as the bag carries them."""
        return dict(self._reader.typestore.fielddefs)

    @property
    def topics(self) -> dict[str, str]:
        """Message type by topic; of a topic with several types, the one with most messages."""
        connections = sorted(self._reader.connections, key=lambda c: c.msgcount)
        return {c.topic: c.msgtype for c in connections}

    def other_types(self, topics: set[str]) -> list[tuple[str, str, int]]:
        """(topic, message type, number of messages) of those on the topics that are of another type than
        `topics` has, as the bag's index counts them."""
        types = self.topics
        return [
            (c.topic, c.msgtype, c.msgcount)
            for c in self._reader.connections
            if c.topic in topics and c.msgtype != types[c.topic] and c.msgcount
        ]

    def not_mapped(self, topics: set[str]) -> list[str]:
        """A line on the topics beside these that have messages; none where there are no others."""
        counts: dict[str, int] = {}
        for c in self._reader.connections:
            if c.topic not in topics and c.msgcount:
                counts[c.topic] = counts.get(c.topic, 0) + c.msgcount
        said = ", ".join(f"{topic} ({count})" for topic, count in sorted(counts.items())[:_LISTED])
        more = f" and {len(counts) - _LISTED} more" if len(counts) > _LISTED else ""
        return [f"topics not mapped, so not read: {reading.plain(said, 500)}{more}"] if counts else []

    def stored(self) -> dict[str, str]:
        """Texts stored with the bag by key, whoever wrote them (custom_data, else our MCAP metadata)."""
        reader: Any = self._reader.readers[0]
        custom = None if self.ros1 else reader.storage.metadata.custom
        found = {str(k): str(v) for k, v in custom.items()} if isinstance(custom, Mapping) else {}
        for file in self._mcap_files():
            for name, entries in self._metadata(file):
                if "json" in entries:
                    found.setdefault(name, entries["json"])
        return found

    def custom_data(self) -> dict[str, Any]:
        """JSON values stored with the bag under `deeptruck.*`. Raises InputError where one is not JSON."""
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
        """All messages of the topics, nearly in the order of their log times (see Batch.safe_ns)."""
        try:
            chunks = indexed_chunks(self._mcap_files())
            types = {topic: kind for topic, kind in self.topics.items() if topic in topics}
            yield from self._one_by_one(topics) if chunks is None else read_chunks(chunks, types)
        except DamagedError as error:
            raise self._damaged(error) from None

    def messages(self, topics: set[str]) -> Iterator[tuple[str, int, bytes]]:
        """(topic, log time in ns, serialised message) of the topics, in the order of their log times."""
        types = self.topics
        wanted = [c for c in self._reader.connections if c.topic in topics and c.msgtype == types[c.topic]]
        try:
            for connection, log_ns, data in self._reader.messages(wanted) if wanted else ():
                if not 0 <= log_ns < LATEST_NS:
                    raise DamagedError(f"a message on {connection.topic} has no possible time")
                yield connection.topic, log_ns, bytes(data)
        except Exception as error:  # rosbags raises whatever a damaged byte leads it to
            raise self._damaged(error) from None

    def _damaged(self, error: Exception) -> InputError:
        return InputError(
            f"{self.path} is damaged: {_one_line(error)}; copy it anew from where it was recorded, "
            "or leave it out"
        )

    def _mcap_files(self) -> list[Path]:
        if self.path.is_file():
            return [self.path] if self.path.suffix == ".mcap" else []
        if self._reader.readers[0].compression_mode:  # such messages must go through rosbags
            return []
        return sorted(self.path.glob("*.mcap"))

    def _one_by_one(self, topics: set[str]) -> Iterator[Batch]:
        held: dict[str, list[tuple[int, bytes]]] = {}
        count = safe_ns = 0
        for topic, log_ns, data in self.messages(topics):
            safe_ns = safe_ns if count else log_ns
            held.setdefault(topic, []).append((log_ns, data))
            count += 1
            if count == _BATCH:
                yield from (_joined(topic, messages, safe_ns) for topic, messages in held.items())
                held, count = {}, 0
        yield from (_joined(topic, messages, safe_ns) for topic, messages in held.items())


def _check_counts(reader: AnyReader) -> None:
    """Raises DamagedError where metadata.yaml has something else than numbers and names."""
    counts = [reader.message_count, *(c.msgcount for c in reader.connections)]
    names = [text for c in reader.connections for text in (c.topic, c.msgtype)]
    if not all(isinstance(count, int) for count in counts) or not all(isinstance(n, str) for n in names):
        raise DamagedError("its metadata has no counts or names of topics")


def _joined(topic: str, messages: list[tuple[int, bytes]], safe_ns: int) -> Batch:
    sizes = np.array([len(data) for _, data in messages], dtype=np.int64)
    buffer = np.frombuffer(b"".join(data for _, data in messages), np.uint8)
    log_ns = np.array([stamp for stamp, _ in messages], dtype=np.int64)
    return Batch(topic, buffer, np.cumsum(sizes) - sizes, sizes, log_ns, safe_ns)


def _from_json(path: Path, key: str, text: Any) -> Any:
    try:
        return json.loads(text)
    except (ValueError, TypeError, RecursionError) as error:
        raise InputError(f"{path}: its {key} is not JSON ({_one_line(error)}); copy it anew") from None


def _one_line(error: BaseException) -> str:
    """What a library says, short enough and plain enough for one line."""
    return reading.plain(str(error)) or type(error).__name__
