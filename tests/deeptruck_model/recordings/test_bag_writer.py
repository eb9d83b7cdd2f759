from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from deeptruck_core.errors import InputError
from deeptruck_core.signals import FAULTS, TruckInterface
from deeptruck_model.recordings import Recording, read, write_bag


def same(one: Recording, other: Recording) -> None:
    assert set(one.channels) == set(other.channels)
    for name, values in one.channels.items():
        np.testing.assert_array_equal(other.channels[name], values, err_msg=name)


def test_everything_comes_back(tmp_path: Path, drive: Recording, interface: TruckInterface) -> None:
    (again,) = read(write_bag(tmp_path / "bag", [replace(drive, notes=("a note",))], interface=interface))
    same(drive, again)
    assert (again.name, again.dt, again.interface, again.notes) == ("bag", 0.1, interface, ("a note",))


def test_pieces_stay_pieces(tmp_path: Path, drive: Recording, interface: TruckInterface) -> None:
    """Neighbouring and overlapping pieces are moved apart; a true distance in time is kept."""
    pieces = [drive.piece(0, 200), drive.piece(200, 400), drive, replace(drive, start_s=5000.0)]
    again = read(write_bag(tmp_path / "bag", pieces, interface=interface))
    assert len(again) == 4
    for one, other in zip(pieces, again, strict=True):
        same(one, other)
    assert [r.name for r in again] == ["bag#0", "bag#1", "bag#2", "bag#3"]
    assert again[3].start_s == pytest.approx(5000.0)


@pytest.mark.parametrize("dt", [0.25, 1.0, 1 / 3])
def test_other_rates(tmp_path: Path, drive: Recording, interface: TruckInterface, dt: float) -> None:
    slow = replace(drive, dt=dt)
    first, second = read(write_bag(tmp_path / "bag", [slow, slow.piece(0, 50)], interface=interface))
    same(slow, first)
    same(slow.piece(0, 50), second)
    assert first.dt == pytest.approx(dt, rel=1e-9)


def test_a_channel_one_piece_lacks(tmp_path: Path, drive: Recording, interface: TruckInterface) -> None:
    """What the interface needs stays, as NaN; the rest is absent."""
    bare = {name: v for name, v in drive.channels.items() if name not in ("grade", "gap", "latitude")}
    pieces = [drive, replace(drive, channels=bare)]
    _, again = read(write_bag(tmp_path / "bag", pieces, interface=interface))
    assert "gap" not in again.channels and "latitude" not in again.channels
    assert np.isnan(again.channels["grade"]).all()
    assert again.w.shape == (600, 1)


def test_other_readers_open_it(tmp_path: Path, drive: Recording, interface: TruckInterface) -> None:
    bag = write_bag(tmp_path / "bag", [drive], interface=interface)
    speed = drive.channels["speed"]
    with AnyReader([bag]) as reader:
        twist = [c for c in reader.connections if c.topic == "/truck/twist"]
        found = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages(twist)]
        assert reader.message_count == 8 * 600
    np.testing.assert_array_equal([m.twist.linear.x for m in found], speed)
    assert [m.header.stamp.nanosec for m in found[:3]] == [0, 100_000_000, 200_000_000]
    (file,) = bag.glob("*.mcap")
    status = ros2_messages(file, "/truck/status")
    expected = ["fuel_rate", "gear", "engine_speed", "engine_torque", "brake_switch", *FAULTS]
    assert list(status[0].name) == expected
    np.testing.assert_array_equal([m.position[1] for m in status], drive.channels["gear"])
    ranges = [m.range for m in ros2_messages(file, "/radar/range")]
    np.testing.assert_array_equal(ranges, drive.channels["gap"])


def ros2_messages(file: Path, topic: str) -> list[Any]:
    """Messages as Foxglove's reader decodes them."""
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return [found.decoded_message for found in reader.iter_decoded_messages(topics=[topic])]


def test_the_description_is_rosbag2s(tmp_path: Path, drive: Recording, interface: TruckInterface) -> None:
    bag = write_bag(tmp_path / "bag", [drive], interface=interface)
    described = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert described["storage_identifier"] == "mcap"
    assert described["version"] == 9
    assert described["relative_file_paths"] == ["bag_0.mcap"] == [p.name for p in bag.glob("*.mcap")]
    assert described["message_count"] == 8 * 600
    assert described["duration"]["nanoseconds"] == 59_900_000_000
    assert "deeptruck.interface" in described["custom_data"]


def test_a_lone_file_still_knows_its_truck(
    tmp_path: Path, drive: Recording, interface: TruckInterface
) -> None:
    bag = write_bag(tmp_path / "bag", [drive], interface=interface)
    (again,) = read(bag / "bag_0.mcap")
    assert again.interface == interface
    same(drive, again)


def test_nothing_is_overwritten_or_left_behind(
    tmp_path: Path, drive: Recording, interface: TruckInterface
) -> None:
    bag = write_bag(tmp_path / "bag", [drive], interface=interface)
    before = (bag / "metadata.yaml").read_bytes()
    with pytest.raises(InputError, match="already; choose another --out, or add --overwrite"):
        write_bag(bag, [drive], interface=interface)
    assert (bag / "metadata.yaml").read_bytes() == before
    assert len(read(write_bag(bag, [drive.piece(0, 100)], interface=interface, overwrite=True))[0]) == 100
    (bag / ".deeptruck.json").unlink()  # now it may be a bag that the user recorded
    with pytest.raises(InputError, match=r"holds bag_0\.mcap but no \.deeptruck\.json"):
        write_bag(bag, [drive], interface=interface, overwrite=True)
    with pytest.raises(InputError, match="same sample period"):
        write_bag(tmp_path / "two", [drive, replace(drive, dt=0.2)], interface=interface)
    with pytest.raises(InputError, match="no recording"):
        write_bag(tmp_path / "two", [], interface=interface)
    silent = replace(drive, channels={c: x for c, x in drive.channels.items() if c != "speed"})
    with pytest.raises(InputError, match="has no channel speed"):
        write_bag(tmp_path / "two", [silent], interface=interface)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"cannot write .* is no folder; choose another --out$"):
        write_bag(tmp_path / "file" / "bag", [drive], interface=interface)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bag", "file"]
