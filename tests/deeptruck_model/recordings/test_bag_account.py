"""The account of a bag: every message on a mapped topic is used, or set aside for a reason."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from foreign_bags import TYPES, Message, S, bag_of, number, stamped, twist
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.rosbag2 import StoragePlugin

from deeptruck_core.account import Account
from deeptruck_model.recordings import read

TOPICS = {
    "speed": {"topic": "/twist", "field": "twist.linear.x"},
    "grade": {"topic": "/grade", "field": "data"},
}
STORAGES = (StoragePlugin.MCAP, StoragePlugin.SQLITE3)


@contextmanager
def folder() -> Iterator[Path]:
    with TemporaryDirectory() as scratch:
        yield Path(scratch)


def account_of(bag: Path) -> Account:
    (account,) = {id(r.account): r.account for r in read(bag, topic_map=TOPICS)}.values()
    assert account.balanced
    return account


def a_twist(k: int, speed: float = 10.0) -> Message:
    return ("/twist", twist(speed, S + k * S // 10), S + k * S // 10)


def text(topic: str, k: int) -> Message:
    return (topic, TYPES.types["std_msgs/msg/String"]("x"), S + k * S // 10)


@settings(max_examples=15)
@given(
    storage=st.sampled_from(STORAGES),
    speeds=st.lists(st.sampled_from([10.0, 20.0, np.nan, -3.0, 500.0]), min_size=30, max_size=80),
    again=st.sets(st.integers(0, 29), max_size=9),
    grades=st.lists(st.sampled_from([0.01, np.nan, 99.0]), min_size=1, max_size=40),
    unmapped=st.integers(0, 5),
)
def test_read_is_used_and_set_aside(
    storage: StoragePlugin, speeds: list[float], again: set[int], grades: list[float], unmapped: int
) -> None:
    speeds = [*speeds, *[10.0] * (3 * len(speeds))]  # a bag of which most is right
    messages = [a_twist(k, speed) for k, speed in enumerate(speeds)]
    messages += [a_twist(k, speeds[k]) for k in again]
    messages += [("/grade", number(grade), S + k * S // 10) for k, grade in enumerate(grades)]
    messages += [text("/chat", k) for k in range(unmapped)]
    with folder() as scratch:
        account = account_of(bag_of(scratch / "bag", sorted(messages, key=lambda m: m[2]), storage=storage))
    blank = sum(map(np.isnan, speeds)) + sum(map(np.isnan, grades))
    assert account.total.read == len(speeds) + len(again) + len(grades)
    assert account.total.used == len(speeds) + len(grades) - blank
    assert sum(account.sources.values()) == account.total.read
    assert (
        sum(account.channels[name].read for name in TOPICS if name in account.channels) == account.total.used
    )
    derived = account.channels["acceleration"]
    assert derived.read == sum(round(10 * (end - start)) + 1 for start, end in account.spans)
    assert any("/chat" in remark for remark in account.remarks) == bool(unmapped)


@pytest.mark.parametrize("storage", STORAGES)
def test_every_reason_has_its_count_and_first_place(tmp_path: Path, storage: StoragePlugin) -> None:
    messages = [a_twist(k, np.nan if k in (7, 9) else 10.0) for k in range(50)]
    messages += [a_twist(3), a_twist(4), text("/grade", 5), text("/chat", 6)]
    messages += [("/grade", number(0.01), S + k * S // 10) for k in range(20)]
    messages += [("/brake", stamped(S), S)]
    bag = bag_of(tmp_path / "bag", sorted(messages, key=lambda m: m[2]), storage=storage)
    assert list(account_of(bag).lines()) == [
        f"{bag}: 73 messages read, 68 used, 5 set aside",
        "  2 on /twist without a number in twist.linear.x, first at 0.7 s",
        "  2 on /twist with a repeated stamp, first at 0.3 s",
        "  1 on /grade of type std_msgs/msg/String, as most there are std_msgs/msg/Float64",
        "  of /twist (52), /grade (21)",
        "  acceleration: 4 of 50 samples derived where there is no speed, first at 0.7 s",
        "  topics not mapped, so not read: /brake (1), /chat (1)",
    ]
