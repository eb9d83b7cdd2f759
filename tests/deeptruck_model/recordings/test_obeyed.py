"""Commands given while control was not engaged drove nothing: the driver's demand stands in their place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_bags import TYPES, Message, S, bag_of, stamped, twist

from deeptruck_core.account import Tally
from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings import Recording, read, write_bag
from deeptruck_model.recordings.not_recorded import not_recorded

COUNT = 600  # of 10 Hz, a minute
INTERFACE = TruckInterface("truck", engine_unit="percent", brake_unit="percent", grade=False, fuel=False)
MAP = {
    "speed": {"topic": "/truck/twist", "field": "twist.linear.x"},
    "engine_command": {
        "topic": "/truck/command",
        "field": "position[name=engine_command]",
        "unit": "percent",
    },
    "brake_command": {"topic": "/truck/command", "field": "position[name=brake_command]", "unit": "percent"},
}
BOTH = ("driver_engine_demand", "driver_brake_demand")


def joints(ns: int, values: dict[str, float]) -> Any:
    make = TYPES.types["sensor_msgs/msg/JointState"]
    nothing = np.zeros(0)
    return make(stamped(ns), list(values), np.array(list(values.values())), nothing, nothing)


def diagnostics(ns: int, no_load: bool) -> Any:
    pair = TYPES.types["diagnostic_msgs/msg/KeyValue"]
    pairs = [pair("state", "engaged"), pair("no_load", str(no_load))]
    status = TYPES.types["diagnostic_msgs/msg/DiagnosticStatus"](
        0, "can_bridge", "engaged", "can_bridge", pairs
    )
    return TYPES.types["diagnostic_msgs/msg/DiagnosticArray"](stamped(ns), [status])


def drive(
    engaged: Sequence[int | None],
    *,
    with_command: bool = True,
    by_bridge: bool = True,
    driver: tuple[str, ...] = BOTH,
    no_load: bool | None = None,
) -> list[Message]:
    """Commands 50 and 5, driver's demands 20 and 2, in percent; `engaged` of each tenth of a second."""
    out: list[Message] = []
    for k, bit in enumerate(engaged):
        ns = S + k * S // 10
        command = {"engine_command": 50.0, "brake_command": 5.0}
        if bit is not None and with_command:
            command["engaged"] = float(bit)
        if no_load is not None and k % 10 == 0:
            out.append(("/diagnostics", diagnostics(ns, no_load), ns))
        out.append(("/truck/twist", twist(10.0 + 0.001 * k, ns), ns))
        if bit is not None and by_bridge:
            out.append(("/truck/engaged", joints(ns, {"engaged": float(bit)}), ns))
        out.append(("/truck/command", joints(ns, command), ns))
        demands = {"driver_engine_demand": 20.0, "driver_brake_demand": 2.0}
        if driver:
            out.append(("/truck/status", joints(ns, {"gear": 5.0} | {d: demands[d] for d in driver}), ns))
    return out


def of(tmp_path: Path, messages: list[Message]) -> Recording:
    (recording,) = read(bag_of(tmp_path / "bag", messages), topic_map=MAP)
    return recording


def tally(recording: Recording, channel: str = "engine_command") -> Tally:
    assert recording.account is not None and recording.account.balanced
    return recording.account.channels[channel]


ENGAGED = np.ones(COUNT, dtype=int)
LATE = np.r_[np.zeros(200, dtype=int), np.ones(400, dtype=int)]  # engaged after 20 s
LOST = np.r_[np.ones(200, dtype=int), np.zeros(400, dtype=int)]
BETWEEN = np.r_[np.zeros(100, dtype=int), np.ones(200, dtype=int), np.zeros(300, dtype=int)]
FLICKERS = (np.arange(COUNT) // 50) % 2
NEVER = np.zeros(COUNT, dtype=int)
PATTERNS = {
    "engaged": ENGAGED,
    "late": LATE,
    "lost": LOST,
    "between": BETWEEN,
    "flickers": FLICKERS,
    "never": NEVER,
}


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("said", ["by both", "by the bridge", "by the command"])
def test_the_driver_stands_where_commands_drove_nothing(tmp_path: Path, pattern: str, said: str) -> None:
    engaged = PATTERNS[pattern]
    how = {"with_command": said != "by the bridge", "by_bridge": said != "by the command"}
    one = of(tmp_path, drive(engaged, **how))
    np.testing.assert_allclose(one.channels["engine_command"], np.where(engaged, 50.0, 20.0))
    np.testing.assert_allclose(one.channels["brake_command"], np.where(engaged, 5.0, 2.0))
    idle = int((engaged == 0).sum())
    for channel in ("engine_command", "brake_command"):
        found = tally(one, channel)
        assert found.left_out == idle and found.used == COUNT
        assert all("not engaged" in reason for reason in found.aside)
    assert one.account is not None
    assert (f"engine_command: the driver's demand while control was not engaged, {idle} samples" in
            one.account.remarks) == bool(idle)  # fmt: skip


@pytest.mark.parametrize("driver", [BOTH, ()])
def test_while_the_bridge_acts_alone_no_command_is_known(tmp_path: Path, driver: tuple[str, ...]) -> None:
    alone = np.r_[np.ones(200, dtype=int), np.full(200, -1), np.ones(200, dtype=int)]
    one = of(tmp_path, drive(alone, driver=driver))
    np.testing.assert_array_equal(one.channels["brake_command"], np.where(alone == 1, 5.0, np.nan))


@pytest.mark.parametrize("pattern", PATTERNS)
def test_without_a_driver_they_are_set_aside(tmp_path: Path, pattern: str) -> None:
    engaged = PATTERNS[pattern]
    recordings = read(bag_of(tmp_path / "bag", drive(engaged, driver=())), topic_map=MAP)
    engine = recordings[0].channels.get("engine_command", np.full(COUNT, np.nan))
    np.testing.assert_array_equal(engine, np.where(engaged, 50.0, np.nan))
    idle = int((engaged == 0).sum())
    found = tally(recordings[0])
    assert found.left_out == idle and found.used == COUNT - idle
    assert any("no driver's demand is recorded" in r for r in recordings[0].account.remarks) == bool(idle)


def test_one_pedal_alone(tmp_path: Path) -> None:
    one = of(tmp_path, drive(LATE, driver=BOTH[:1]))
    np.testing.assert_allclose(one.channels["engine_command"], np.where(LATE, 50.0, 20.0))
    np.testing.assert_array_equal(one.channels["brake_command"], np.where(LATE, 5.0, np.nan))


def test_the_bridge_is_believed_before_the_command(tmp_path: Path) -> None:
    """The controller hears late that control was lost."""
    messages = []
    for topic, message, ns in drive(LOST):
        if topic == "/truck/command":
            message = joints(ns, {"engine_command": 50.0, "brake_command": 5.0, "engaged": 1.0})
        messages.append((topic, message, ns))
    np.testing.assert_allclose(of(tmp_path, messages).channels["engine_command"], np.where(LOST, 50.0, 20.0))


@pytest.mark.parametrize("said", [True, False, None])
def test_a_run_that_sends_nothing(tmp_path: Path, said: bool | None) -> None:
    one = of(tmp_path, drive(ENGAGED, no_load=said))
    np.testing.assert_allclose(one.channels["engine_command"], 20.0 if said else 50.0)
    assert tally(one).left_out == (COUNT if said else 0)
    assert any("--no-load" in remark for remark in one.account.remarks) == bool(said)


def test_a_bit_that_stops_is_not_known(tmp_path: Path) -> None:
    bits = [1 if k < 300 else None for k in range(COUNT)]
    one = of(tmp_path, drive(bits, driver=()))
    engine = one.channels["engine_command"]
    assert (engine[:310] == 50.0).all() and np.isnan(engine[330:]).all()
    assert any("not recorded whether control was engaged" in reason for reason in tally(one).aside)


def test_bags_without_the_bit_are_read_as_they_are(tmp_path: Path) -> None:
    one = of(tmp_path, drive([None] * COUNT))
    np.testing.assert_array_equal(one.channels["engine_command"], 50.0)
    assert not one.obeyed and tally(one).left_out == 0


def test_other_topics_have_nothing_to_do_with_it(tmp_path: Path) -> None:
    """A measured torque as the engine command was obeyed whoever asked for it."""
    messages = [(t.replace("/truck/command", "/throttle"), m, ns) for t, m, ns in drive(NEVER)]
    by_throttle = {name: entry | {"topic": entry["topic"].replace("/truck/command", "/throttle")}
                   for name, entry in MAP.items()}  # fmt: skip
    (one,) = read(bag_of(tmp_path / "bag", messages), topic_map=by_throttle)
    np.testing.assert_array_equal(one.channels["engine_command"], 50.0)


def test_units_of_a_topic_map_hold_for_the_driver_too(tmp_path: Path) -> None:
    halved = {name: entry | ({"scale": 0.5} if "command" in name else {}) for name, entry in MAP.items()}
    (one,) = read(bag_of(tmp_path / "bag", drive(LATE)), topic_map=halved)
    np.testing.assert_allclose(one.channels["engine_command"], np.where(LATE, 25.0, 10.0))


def test_that_commands_were_obeyed_is_recorded_and_stays_so(tmp_path: Path) -> None:
    one = replace(of(tmp_path, drive(BETWEEN)), interface=INTERFACE)
    assert one.obeyed
    assert "commands obeyed" not in [m.input.name for m in not_recorded([one])]
    (again,) = read(write_bag(tmp_path / "again", [one], interface=INTERFACE))
    assert again.obeyed and tally(again).left_out == 0
    np.testing.assert_array_equal(again.channels["engine_command"], one.channels["engine_command"])
    bare = replace(one, obeyed=False)
    assert "commands obeyed" in [m.input.name for m in not_recorded([bare])]
    (bare_again,) = read(write_bag(tmp_path / "bare", [bare], interface=INTERFACE))
    assert not bare_again.obeyed


def test_our_own_topics_need_no_map(tmp_path: Path) -> None:
    (one,) = read(bag_of(tmp_path / "bag", drive(LATE)), interface=INTERFACE)
    np.testing.assert_allclose(one.channels["engine_command"], np.where(LATE, 50.0, 20.0))
