"""Topics of one bag whose clocks differ: said by coverage, refused by all else."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from foreign_bags import Message, S, bag_of, number, twist

from deeptruck_core.errors import InputError
from deeptruck_model.recordings import Recording, import_table, read

LOG = 1_700_000_000 * S
STEP = S // 10
COUNT = 600
MAP = {
    "speed": {"topic": "/speed", "field": "twist.linear.x"},
    "engine_command": {"topic": "/throttle", "field": "data", "unit": "percent"},
}
STAMPED_MAP = MAP | {"engine_command": {"topic": "/throttle", "field": "twist.linear.x", "unit": "percent"}}
Stamp = Callable[[int], int]  # from the time since the log's first message, ns, to a stamp, ns


def as_logged(since: int) -> int:
    return LOG + since


def shifted(seconds: float) -> Stamp:
    return lambda since: LOG + since + round(seconds * S)


def simulated(since: int) -> int:
    return 5 * S + since


def at(k: int) -> int:
    return LOG + k * STEP


def speed_of(k: int) -> float:
    return 10.0 + 5.0 * np.sin(0.05 * k)


def command_of(k: int) -> float:
    return float(k % 100)


def messages(speed: Stamp, throttle: Stamp | None, delay: int = 0) -> list[Message]:
    """Speed and throttle of one minute; each throttle stands for the step that begins with it. Without
    `throttle` that topic has no stamps."""
    out: list[Message] = []
    for k in range(COUNT):
        out.append(("/speed", twist(speed_of(k), speed(k * STEP)), at(k)))
        command = number(command_of(k)) if throttle is None else twist(command_of(k), throttle(k * STEP))
        out.append(("/throttle", command, at(k) + delay))
    return out


def beside_each_other(recordings: list[Recording]) -> None:
    """Speed and command of the same tick were logged together."""
    (one,) = recordings
    assert len(one) == COUNT
    np.testing.assert_allclose(one.channels["speed"], [speed_of(k) for k in range(COUNT)])
    np.testing.assert_allclose(one.channels["engine_command"], [command_of(k) for k in range(COUNT)])


def remark(recordings: list[Recording]) -> str:
    return next((line for line in recordings[0].account.remarks if "clocks" in line), "")


TWO_CLOCKS = {
    "TAI stamps of the speed": (shifted(37.0), None, "37.0 s", "/speed: stamps 37.0 s ahead of the log"),
    "a computer whose clock is late": (shifted(-2.5), as_logged, "2.5 s", "2.5 s behind the log"),
    "simulation time beside wall time": (simulated, None, "1.7e+09 s", "simulation time, from 5 s"),
    "simulated commands": (as_logged, simulated, "1.7e+09 s", "/throttle: stamps in simulation time"),
    "two wrong clocks": (shifted(1.0), shifted(-1.0), "2.0 s", "1.0 s ahead of the log); "),
    "an hour, by a time zone": (shifted(3600.0), as_logged, "3600.0 s", "3600.0 s ahead of the log"),
    "just above half a second": (shifted(0.7), None, "0.7 s", "0.7 s ahead of the log"),
}


@pytest.mark.parametrize("kind", TWO_CLOCKS)
def test_two_clocks_are_refused_or_said_with_their_size(tmp_path: Path, kind: str) -> None:
    speed, throttle, size, topic = TWO_CLOCKS[kind]
    topic_map = MAP if throttle is None else STAMPED_MAP
    bag = bag_of(tmp_path / "bag", messages(speed, throttle))
    with pytest.raises(InputError, match="--clock log") as refused:
        read(bag, topic_map=topic_map)
    assert ("--clock stamp" in str(refused.value)) == (throttle is not None)
    said = remark(read(bag, topic_map=topic_map, mixed_clocks=True))
    assert f"differ by {size}" in said
    assert topic.rstrip("); ") in said
    by_log = read(bag, topic_map=topic_map, clock="log")
    beside_each_other(by_log)
    assert f"differ by {size}" in remark(by_log) and "log times were taken" in remark(by_log)


def test_an_import_asks_for_the_clock_as_its_bag_could_not_say_it(tmp_path: Path) -> None:
    bag = bag_of(tmp_path / "bag", messages(shifted(37.0), None))
    with pytest.raises(InputError, match=r"differ by 37\.0 s .*--clock log"):
        import_table(bag, MAP, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    import_table(bag, MAP, tmp_path / "out", clock="log")
    beside_each_other(read(tmp_path / "out"))


ONE_CLOCK = {
    "stamps as logged": (as_logged, as_logged),
    "no stamps on one topic": (as_logged, None),
    "all in simulation time": (simulated, simulated),
    "all shifted alike": (shifted(-86400.0), shifted(-86400.0)),
    "a sensor's usual delay": (shifted(-0.1), None),
    "a simulation slower than the log": (lambda since: S + since // 3, lambda since: S + since // 3),
}


@pytest.mark.parametrize("kind", ONE_CLOCK)
def test_one_clock_is_read_without_a_word(tmp_path: Path, kind: str) -> None:
    speed, throttle = ONE_CLOCK[kind]
    bag = bag_of(tmp_path / "bag", messages(speed, throttle))
    assert remark(read(bag, topic_map=MAP if throttle is None else STAMPED_MAP)) == ""


def test_a_topic_that_begins_late_in_a_slow_simulation_has_the_same_clock(tmp_path: Path) -> None:
    slow = ONE_CLOCK["a simulation slower than the log"][0]
    late = [m for m in messages(slow, slow) if m[0] == "/speed" or m[2] > at(COUNT // 2)]
    assert remark(read(bag_of(tmp_path / "bag", late), topic_map=STAMPED_MAP)) == ""


def test_messages_that_were_all_logged_at_once_are_compared_by_nothing(tmp_path: Path) -> None:
    """As a converter that writes one topic after the other with the time of writing."""
    drive = sorted(messages(as_logged, as_logged), key=lambda m: m[0])
    moved = [(topic, message, LOG + k * 1000) for k, (topic, message, _) in enumerate(drive)]
    recordings = read(bag_of(tmp_path / "bag", moved), topic_map=STAMPED_MAP)
    beside_each_other(recordings)
    assert remark(recordings) == ""


def test_stamps_can_be_right_where_the_log_came_late(tmp_path: Path) -> None:
    """A topic that was recorded behind a buffer of 3 s: its stamps are those of the measurement."""
    bag = bag_of(tmp_path / "bag", messages(as_logged, as_logged, delay=3 * S))
    with pytest.raises(InputError, match=r"differ by 3\.0 s"):
        read(bag, topic_map=STAMPED_MAP)
    recordings = read(bag, topic_map=STAMPED_MAP, clock="stamp")
    beside_each_other(recordings)
    assert "stamps were taken" in remark(recordings)


def test_stamps_are_refused_for_topics_without_any(tmp_path: Path) -> None:
    bag = bag_of(tmp_path / "bag", messages(shifted(37.0), None))
    with pytest.raises(InputError, match="'--clock stamp' cannot time /throttle: give '--clock log'"):
        read(bag, topic_map=MAP, clock="stamp", mixed_clocks=True)


def test_topics_that_are_not_used_may_have_any_clock(tmp_path: Path) -> None:
    other: list[Message] = [("/lidar", twist(0.0, simulated(k * STEP)), at(k)) for k in range(COUNT)]
    drive = sorted([*messages(as_logged, None), *other], key=lambda m: m[2])
    assert remark(read(bag_of(tmp_path / "bag", drive), topic_map=MAP)) == ""


@pytest.fixture
def tai(tmp_path: Path) -> tuple[Path, Path]:
    """A bag whose speed has TAI stamps, and its topic map."""
    topics = tmp_path / "topics.yaml"
    topics.write_text(
        "speed: {topic: /speed, field: twist.linear.x}\n"
        "engine_command: {topic: /throttle, field: data, unit: percent}\n"
        "brake_command: {topic: /throttle, field: data, unit: percent}\n"
    )
    return bag_of(tmp_path / "tai37", messages(shifted(37.0), None)), topics


@pytest.mark.parametrize(
    ("command", "code"),
    [
        ("train {bag} --topic-map {map} --out {out} --budget 20", 2),
        ("mismatch --simulator truck:freightliner --recordings {bag} --topic-map {map} --out {out}", 2),
        ("table {bag} --topic-map {map} --out {out}.csv", 2),
        ("coverage {bag} --topic-map {map} --out {out}", 0),
        ("import {bag} --columns {map} --out {out}", 2),
        ("train {bag} --topic-map {map} --out {out} --budget 20 --clock log", 0),
        ("import {bag} --columns {map} --out {out} --clock log", 0),
    ],
)
def test_commands_say_it(
    tai: tuple[Path, Path],
    tmp_path: Path,
    script: Callable[..., tuple[int, str, str]],
    command: str,
    code: int,
) -> None:
    ended, said, error = script(*command.format(bag=tai[0], map=tai[1], out=tmp_path / "out").split())
    assert ended == code, error
    lines = [line for line in (said + error).splitlines() if "differ by 37.0 s" in line]
    assert lines
    if code:
        assert len(error.splitlines()) == 1 and "--clock log" in error


def test_a_table_has_one_clock(tmp_path: Path, script: Callable[..., tuple[int, str, str]]) -> None:
    table, columns = tmp_path / "drive.csv", tmp_path / "columns.yaml"
    table.write_text("t,v\n" + "".join(f"{k / 10},{10 + k / 100}\n" for k in range(100)))
    columns.write_text("time: {column: t, unit: s}\nchannels: {speed: {column: v, unit: m/s}}\n")
    code, _, error = script(
        "import", table, "--columns", columns, "--out", tmp_path / "bag", "--clock", "log"
    )
    assert code == 2 and "is for bags" in error
