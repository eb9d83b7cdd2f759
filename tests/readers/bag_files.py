"""Bags that a user may give: how small valid ones are made, and how they are read."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, Writer
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings import Recording, read, suggest, write_bag
from deeptruck_model.recordings.bag_metadata import definition

S = 1_000_000_000
TRUCK = TruckInterface("toy")
TWIST = "geometry_msgs/msg/TwistStamped"


def drive(samples: int = 40) -> Recording:
    """Four seconds with all that a deep truck is trained on."""
    names = ("acceleration", "speed", "fuel_rate", "engine_command", "brake_command", "grade")
    channels = {name: 0.05 * k + 0.001 * np.arange(samples) for k, name in enumerate(names)}
    return Recording("drive", 0.1, channels, TRUCK)


def read_bag(file: Path) -> list[Any]:
    """The recordings of a lone file, or of the folder around it."""
    bag = file.parent if (file.parent / "metadata.yaml").exists() else file
    return [
        (r.name, r.dt, r.start_s, r.interface.to_dict(), r.channels)
        for r in read(bag, interface=None if bag == file.parent else TRUCK)
    ]


def propose_map(file: Path) -> list[Any]:
    """What a bag of unknown topics is taken for."""
    found = suggest(file.parent if (file.parent / "metadata.yaml").exists() else file)
    return [found.survey.topics, found.text().partition("\n")[2]]


def our_bag(folder: Path) -> Path:
    """As `import` writes it: MCAP with checksums and our own metadata."""
    return next(write_bag(folder / "bag", [drive()], interface=TRUCK).glob("*.mcap"))


def lone(make: Callable[[Path], Path]) -> Callable[[Path], Path]:
    """The bag's file alone."""

    def made(folder: Path) -> Path:
        file = make(folder)
        return Path(shutil.copy(file, folder / f"lone{file.suffix}"))

    return made


def metadata_of(make: Callable[[Path], Path]) -> Callable[[Path], Path]:
    """The metadata.yaml beside the bag's file."""
    return lambda folder: make(folder).parent / "metadata.yaml"


def _twists(samples: int = 40) -> Iterator[tuple[int, Any]]:
    store = get_typestore(Stores.ROS2_JAZZY)
    types = store.types
    zero = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    for k in range(samples):
        ns = S + k * S // 10
        stamp = types["builtin_interfaces/msg/Time"](ns // S, ns % S)
        header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="map")
        moving = types["geometry_msgs/msg/Vector3"](10 + 0.1 * k, 0.0, 0.0)
        yield ns, types[TWIST](header, types["geometry_msgs/msg/Twist"](moving, zero))


def mcap(compression: CompressionType, *, chunked: bool = True) -> Callable[[Path], Path]:
    """A lone file by the format's own library, in several chunks."""

    def made(folder: Path) -> Path:
        store = get_typestore(Stores.ROS2_JAZZY)
        file = folder / "drive.mcap"
        with file.open("wb") as stream:
            writer = Writer(stream, chunk_size=1024, compression=compression, use_chunking=chunked)
            writer.start(profile="ros2", library="test")
            schema = writer.register_schema(TWIST, "ros2msg", definition(TWIST)[0].encode())
            channel = writer.register_channel("/truck/twist", "cdr", schema)
            for k, (ns, message) in enumerate(_twists()):
                writer.add_message(channel, ns, bytes(store.serialize_cdr(message, TWIST)), ns, k)
            writer.finish()
        return file

    return made


def rosbag2(storage: StoragePlugin, mode: CompressionMode | None = None) -> Callable[[Path], Path]:
    """A folder by rosbags, which writes no checksums."""

    def made(folder: Path) -> Path:
        store = get_typestore(Stores.ROS2_JAZZY)
        writer = Writer2(folder / "bag", version=9, storage_plugin=storage)
        if mode is not None:
            writer.set_compression(mode, CompressionFormat.ZSTD)
        with writer:
            connection = writer.add_connection("/truck/twist", TWIST, typestore=store)
            for ns, message in _twists():
                writer.write(connection, ns, store.serialize_cdr(message, TWIST))
        return next(f for f in (folder / "bag").iterdir() if f.name != "metadata.yaml")

    return made


def rosbag1(folder: Path) -> Path:
    """A ROS 1 bag."""
    store = get_typestore(Stores.ROS1_NOETIC)
    types = store.types
    with Writer1(folder / "drive.bag") as writer:
        connection = writer.add_connection("/truck/twist", TWIST, typestore=store)
        zero = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
        for k in range(40):
            ns = S + k * S // 10
            stamp = types["builtin_interfaces/msg/Time"](ns // S, ns % S)
            header = types["std_msgs/msg/Header"](seq=k, stamp=stamp, frame_id="map")
            moving = types["geometry_msgs/msg/Vector3"](10 + 0.1 * k, 0.0, 0.0)
            message = types[TWIST](header, types["geometry_msgs/msg/Twist"](moving, zero))
            writer.write(connection, ns, store.serialize_ros1(message, TWIST))
    return folder / "drive.bag"
