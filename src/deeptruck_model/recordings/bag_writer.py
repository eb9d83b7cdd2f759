"""Writes recordings into a rosbag2 folder with the topics of docs/topics.md."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.files import Result
from deeptruck_core.signals import CHANNELS, TruckInterface
from deeptruck_model import calls
from deeptruck_model.recordings.bag_source import EXTRA_KEY, INTERFACE_KEY, NOTES_KEY
from deeptruck_model.recordings.crash_safe import CrashSafeWriter
from deeptruck_model.recordings.interpolate import GAP_PERIODS, GAP_S
from deeptruck_model.recordings.obeyed import COMMAND, ENGAGED
from deeptruck_model.recordings.recording import Recording
from deeptruck_model.recordings.topic_map import DEFAULT_TOPICS, EXTRA_TOPIC
from deeptruck_model.results import WRITTEN_BAG

EPOCH_NS = (
    1_000_000_000_000_000_000  # stamp of a recording's time 0: tables carry no date, and 0 means unstamped
)

_TYPES = {
    "/truck/twist": "geometry_msgs/msg/TwistStamped",
    "/truck/accel": "geometry_msgs/msg/AccelStamped",
    "/truck/imu": "sensor_msgs/msg/Imu",
    "/truck/status": "sensor_msgs/msg/JointState",
    "/truck/command": "sensor_msgs/msg/JointState",
    "/road": "sensor_msgs/msg/JointState",
    "/radar/range": "sensor_msgs/msg/Range",
    "/radar/twist": "geometry_msgs/msg/TwistStamped",
    EXTRA_TOPIC: "sensor_msgs/msg/JointState",
}
_LITTLE_ENDIAN = b"\0\1\0\0"


def write_bag(
    path: str | Path,
    recordings: Sequence[Recording],
    *,
    interface: TruckInterface,
    epoch_ns: int = EPOCH_NS,
    overwrite: bool = False,
    kind: Result = WRITTEN_BAG,
) -> Path:
    """Write recordings into a new rosbag2 folder (MCAP) and return its path.

    Pieces keep their distance in time, or are moved apart so far that the reader separates them again (see
    `lay_out`). Values are stored exactly, NaN included, except gap, which sensor_msgs/Range carries as
    float32. The folder appears only when complete. `kind` says what the bag is for; with `overwrite` a bag of
    the same `kind` is replaced, and nothing else. Raises InputError for an existing path, recordings of
    different dt, or a full disk.
    """
    path = calls.path(path, "the bag")
    if isinstance(recordings, Recording) or not all(isinstance(r, Recording) for r in recordings):
        raise InputError(
            "recordings must be a list of recordings: write_bag(path, [recording], interface=...)"
        )
    calls.instance(interface, TruckInterface, "interface", "recordings have one: recording.interface")
    starts = lay_out(recordings)
    custom = {INTERFACE_KEY: json.dumps(interface.to_dict())}
    notes = list(dict.fromkeys(note for recording in recordings for note in recording.notes))
    extra = dict.fromkeys(c for recording in recordings for c in recording.channels if c not in CHANNELS)
    if extra:
        custom[EXTRA_KEY] = json.dumps(list(extra))
    if notes:
        custom[NOTES_KEY] = json.dumps(notes)
    with kind.replacing(path, overwrite=overwrite) as draft:
        try:
            with CrashSafeWriter(draft, file_stem=path.name, custom_data=custom, into=True) as writer:
                for recording, start_s in zip(recordings, starts, strict=True):
                    for topic, message, stamp in _messages(recording, start_s, epoch_ns):
                        writer.write(topic, _TYPES[topic], message, stamp)
        except InputError as error:  # the writer speaks of its draft, and of a repair
            if isinstance(error.__context__, OSError):
                raise error.__context__ from None
            raise
    return path


def lay_out(recordings: Sequence[Recording]) -> list[float]:
    """Start of each recording in the bag, s: its own start, or later if the reader would join it to its
    predecessor.

    Raises InputError if there is nothing to write, if speed is missing, or if sample periods differ.
    """
    for recording in recordings:
        recording.columns(("speed",))
    if not recordings or not all(len(recording) for recording in recordings):
        raise InputError("there is no recording to write, or an empty one")
    dt = recordings[0].dt
    if any(abs(recording.dt - dt) > 1e-9 for recording in recordings):
        periods = ", ".join(sorted({f"{recording.dt:g}" for recording in recordings}))
        raise InputError(f"recordings in one bag need the same sample period; these have {periods} s")
    starts: list[float] = []
    free_from = -np.inf
    distance = dt + 2.0 * max(GAP_S, GAP_PERIODS * dt)
    for recording in recordings:
        own = recording.start_s - recordings[0].start_s
        starts.append(float(own if own >= free_from else np.ceil(free_from)))
        free_from = starts[-1] + (len(recording) - 1) * dt + distance
    return starts


@dataclass(frozen=True)
class _Rows:
    """All messages of one topic in one recording, as rows of one byte matrix (n, size)."""

    topic: str
    rows: NDArray[np.uint8]


def _messages(recording: Recording, start_s: float, epoch_ns: int) -> Iterator[tuple[str, bytes, int]]:
    """(topic, CDR, stamp) of every message in time order."""
    ticks = np.rint((start_s + recording.dt * np.arange(len(recording))) * 1e9).astype(np.int64) + epoch_ns
    topics = list(_rows(recording, ticks))
    for k, stamp in enumerate(ticks.tolist()):
        for one in topics:
            yield one.topic, one.rows[k].tobytes(), stamp


def _rows(recording: Recording, ticks: NDArray[np.int64]) -> Iterator[_Rows]:
    for topic in _TYPES:
        channels = [
            c for c, source in DEFAULT_TOPICS.items() if source.topic == topic and c in recording.channels
        ]
        if topic == EXTRA_TOPIC:
            channels = [c for c in recording.channels if c not in CHANNELS]
        if not channels:
            continue
        columns = [recording.channels[channel] for channel in channels]
        if topic == COMMAND and recording.obeyed:
            channels, columns = [*channels, ENGAGED], [*columns, np.ones(len(recording))]
        fields = {
            "geometry_msgs/msg/TwistStamped": _vector_fields,
            "geometry_msgs/msg/AccelStamped": _vector_fields,
            "sensor_msgs/msg/Imu": _imu_fields,
            "sensor_msgs/msg/Range": _range_fields,
            "sensor_msgs/msg/JointState": _joint_fields,
        }[_TYPES[topic]](channels, columns)
        yield _Rows(topic, _encoded(ticks, fields))


_Field = tuple[
    str, "Array | NDArray[np.int64] | int | float | bytes"
]  # numpy dtype (bytes as is) and the content


def _encoded(ticks: NDArray[np.int64], fields: list[_Field]) -> NDArray[np.uint8]:
    """CDR rows: header with stamp and empty frame_id, then the fields, each aligned to its own size."""
    head: list[_Field] = [
        ("<i4", ticks // 1_000_000_000),
        ("<u4", ticks % 1_000_000_000),
        ("<u4", 1),
        ("S1", b"\0"),
    ]
    names, formats, offsets, contents = (
        ["encapsulation"],
        ["V4"],
        [0],
        [np.frombuffer(_LITTLE_ENDIAN, "V4")[0]],
    )
    at = 4
    for number, (kind, content) in enumerate(head + fields):
        dtype = np.dtype(kind)
        align = 1 if dtype.kind in "SV" else dtype.itemsize
        at += (4 - at) % align
        names.append(f"f{number}")
        formats.append(kind)
        offsets.append(at)
        contents.append(content)
        at += dtype.itemsize
    layout = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": at})
    rows = np.zeros(len(ticks), layout)
    for name, content in zip(names, contents, strict=True):
        rows[name] = content
    return rows.view(np.uint8).reshape(len(ticks), at)


def _vector_fields(_: list[str], columns: list[Array]) -> list[_Field]:
    """Fields of a vector message: linear.x is the channel, the other five are zero."""
    return [("<f8", columns[0]), *[("<f8", 0.0)] * 5]


def _imu_fields(_: list[str], columns: list[Array]) -> list[_Field]:
    """Fields of an inertial sensor: linear_acceleration.x is the channel; a first covariance of -1 says that
    orientation and angular velocity are not measured."""
    absent: list[_Field] = [("<f8", -1.0), *[("<f8", 0.0)] * 8]
    orientation: list[_Field] = [*[("<f8", 0.0)] * 3, ("<f8", 1.0)]
    still: list[_Field] = [("<f8", 0.0)] * 3
    force: list[_Field] = [("<f8", columns[0]), *[("<f8", 0.0)] * 11]
    return [*orientation, *absent, *still, *absent, *force]


def _range_fields(_: list[str], columns: list[Array]) -> list[_Field]:
    """Fields of a radar message: radiation_type, field of view (rad), limits (m), range, variance (0:
    unknown)."""
    limits: list[_Field] = [("u1", 1), ("<f4", 0.35), ("<f4", 0.0), ("<f4", 250.0)]
    return [*limits, ("<f4", columns[0]), ("<f4", 0.0)]


def _joint_fields(channels: list[str], columns: list[Array]) -> list[_Field]:
    """Fields of a joint state: name[], position[], and empty velocity[] and effort[]."""
    fields: list[_Field] = [("<u4", len(channels))]
    for channel in channels:
        text = channel.encode() + b"\0"
        fields += [("<u4", len(text)), (f"V{len(text)}", np.frombuffer(text, f"V{len(text)}")[0])]
    fields.append(("<u4", len(columns)))
    fields += [("<f8", column) for column in columns]
    return [*fields, ("<u4", 0), ("<u4", 0)]
