"""Bags of increasing numbers on two topics, and their content."""

from __future__ import annotations

from pathlib import Path

from rosbags.highlevel import AnyReader

from deeptruck_model.recordings import CrashSafeWriter

KIND = "std_msgs/msg/Float64"


def contents(bag: Path) -> dict[str, list[int]]:
    """Content of a bag by topic, read by rosbags; checks that the metadata agree."""
    found: dict[str, list[int]] = {}
    with AnyReader([bag]) as reader:
        for connection, _, raw in reader.messages():
            found.setdefault(connection.topic, []).append(int.from_bytes(bytes(raw[4:12]), "little"))
        assert reader.message_count == sum(map(len, found.values()))
    return found


def payload(number: int) -> bytes:
    return b"\0\1\0\0" + number.to_bytes(8, "little")


def fill(writer: CrashSafeWriter, numbers: range, topics: tuple[str, ...] = ("/a", "/b")) -> None:
    for number in numbers:
        for topic in topics:
            writer.write(topic, KIND, payload(number), 1 + number)
