"""Several bags: names that differ though the bags are called alike, and whether all can drive a simulator."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_bags import Message, bag_of, drive_messages

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings import Recording, read_all
from deeptruck_model.recordings.compatibility import Taken
from deeptruck_model.recordings.several import check_fit, distinct


def two_pieces() -> list[Message]:
    messages = drive_messages(count=100)
    return messages[:40] + messages[80:]


def test_bags_of_one_name_are_told_apart_by_their_folders(tmp_path: Path) -> None:
    bags = [bag_of(tmp_path / place / "drive", two_pieces()) for place in ("a/monday", "b/monday", "tuesday")]
    found = [r.name for r in read_all(bags)]
    assert found[::2] == ["a/monday/drive#0", "b/monday/drive#0", "tuesday/drive#0"]
    assert [r.name for r in read_all(bags[1:2], among=bags[:1])] == ["b/monday/drive#0", "b/monday/drive#1"]
    assert [r.name for r in read_all([bags[0], bags[0]])] == ["drive#0", "drive#1"] * 2


def test_what_is_called_otherwise_keeps_its_name(tmp_path: Path) -> None:
    one = bag_of(tmp_path / "drive#3", drive_messages())
    other = bag_of(tmp_path / "other", drive_messages())
    (tmp_path / "link").symlink_to(other)
    assert [r.name for r in read_all([one, tmp_path / "link"])] == ["drive#3", "other"]


def test_a_file_beside_a_folder_of_its_name(tmp_path: Path) -> None:
    (tmp_path / "drive").mkdir()
    (tmp_path / "drive.mcap").touch()
    names = distinct([tmp_path / "drive", tmp_path / "drive.mcap"])
    assert len(set(names.values())) == 2


def test_a_recording_that_cannot_drive_a_simulator_is_one_line() -> None:
    taken = Taken("the truck", truck := TruckInterface("trucksim"), 0.1)
    channels = {"speed": np.zeros(9), "engine_command": np.zeros(9), "brake_command": np.zeros(9)}
    drive = Recording("monday", 0.1, {**channels, "grade": np.zeros(9)}, truck)
    check_fit([drive], taken)
    percent = TruckInterface("p", engine_unit="percent", brake_unit="bar", grade=False)
    with pytest.raises(InputError) as caught:
        check_fit([drive, Recording("friday", 0.2, channels, percent)], taken)
    for words in (
        "'friday' is sampled every 0.2 s, the truck steps 0.1 s",
        "'friday' has no grade, which the truck needs",
        "'friday' has engine_command in percent, the truck takes N m",
        "'friday' has brake_command in bar, the truck takes percent",
    ):
        assert words in str(caught.value)
    assert "\n" not in str(caught.value)
