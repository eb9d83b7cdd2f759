"""What a bag says of itself, by its metadata alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings import Recording, bag_facts, write_bag

TRUCK = TruckInterface("trucksim")


def bag_of(path: Path, interface: TruckInterface = TRUCK) -> Path:
    names = {"speed", "acceleration", *interface.u, *interface.w}
    channels = {name: np.zeros(30) for name in sorted(names)}
    return write_bag(path, [Recording(path.name, 0.1, channels, interface)], interface=interface)


def test_a_bag_tells_its_interface_and_topics(tmp_path: Path) -> None:
    one = bag_facts.bag(bag_of(tmp_path / "drive"))
    assert one.interface == TRUCK and one.messages is not None and one.messages["/truck/twist"] == 30
    alone = bag_facts.bag(next((tmp_path / "drive").glob("*.mcap")))
    assert alone.interface is None and alone.messages is None


def test_a_bag_that_cannot_be_used_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "drive.csv").write_text("time,speed\n0,1\n")
    (tmp_path / "false.mcap").write_text("no bag")
    (tmp_path / "empty").mkdir()
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "notes.txt").write_text("x")
    cut = bag_of(tmp_path / "cut")
    (cut / "metadata.yaml").unlink()
    torn = bag_of(tmp_path / "torn")
    (torn / "metadata.yaml").write_text("rosbag2_bagfile_information: {custom_data: [")
    (tmp_path / "several").mkdir()
    bag_of(tmp_path / "several" / "a")
    lost = bag_of(tmp_path / "lost")
    (lost / "lost_0.mcap").unlink()
    says = {
        "none": "does not exist",
        "drive.csv": "needs 'deeptruck-model import'",
        "false.mcap": "cannot be read as a bag",
        "empty": "is empty, it holds no bag",
        "other": "is no bag: it has no",
        "several": "is no bag, but a folder of 1; give these: .*several/[*]",
        "cut": "is not a finished bag",
        "torn": "metadata.yaml is damaged",
        "lost": "has lost lost_0.mcap",
    }
    for name, words in says.items():
        with pytest.raises(InputError, match=words):
            bag_facts.bag(tmp_path / name)
