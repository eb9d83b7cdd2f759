"""Bags that a user may give: how small valid ones are made, and how they are read."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from foreign_bags import ROS1, bag_of, drive_messages, mcap_of, ros1_of, twist
from mcap.writer import CompressionType
from rosbags.rosbag2 import CompressionMode, StoragePlugin

from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings import Recording, read, suggest, write_bag

TRUCK = TruckInterface("toy")


def drive(samples: int = 40) -> Recording:
    """Four seconds with all that a deep truck is trained on."""
    names = ("acceleration", "speed", "fuel_rate", "engine_command", "brake_command", "grade")
    channels = {name: 0.05 * k + 0.001 * np.arange(samples) for k, name in enumerate(names)}
    return Recording("drive", 0.1, channels, TRUCK)


def read_bag(file: Path) -> list[Any]:
    """The recordings of a lone file, or of the folder around it, whose account adds up."""
    bag = file.parent if (file.parent / "metadata.yaml").exists() else file
    found = read(bag, interface=None if bag == file.parent else TRUCK)
    assert all(r.account is not None and r.account.balanced for r in found)
    return [(r.name, r.dt, r.start_s, r.interface.to_dict(), r.channels) for r in found]


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


MESSAGES = [(t, twist(10.0 + 0.1 * k, ns), ns) for k, (t, _, ns) in enumerate(drive_messages(count=40))]


def mcap(compression: CompressionType, *, chunked: bool = True) -> Callable[[Path], Path]:
    """A lone file by the format's own library, in several chunks."""
    options = {"chunk_size": 1024, "compression": compression, "use_chunking": chunked}
    return lambda folder: mcap_of(folder / "drive.mcap", MESSAGES, **options)


def rosbag2(storage: StoragePlugin, mode: CompressionMode | None = None) -> Callable[[Path], Path]:
    """A folder by rosbags, which writes no checksums."""

    def made(folder: Path) -> Path:
        bag = bag_of(folder / "bag", MESSAGES, storage=storage, compression=mode)
        return next(f for f in bag.iterdir() if f.name != "metadata.yaml")

    return made


def rosbag1(folder: Path) -> Path:
    """A ROS 1 bag."""
    of = [(t, twist(10.0 + 0.1 * k, ns, ROS1, seq=k), ns) for k, (t, _, ns) in enumerate(MESSAGES)]
    return ros1_of(folder / "drive.bag", of)
