"""Names and a constant of the newest driving: the same answers as from a bag, from another process."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from small_drives import TRUCK, LazyBrake, drives

from deeptruck_model import recordings
from deeptruck_model.mismatch.live.adaptation import adapt
from deeptruck_model.mismatch.live.answer import NOT_DETECTED, answer
from deeptruck_model.mismatch.live.companion import Companion
from deeptruck_model.mismatch.live.monitor import Window
from deeptruck_model.mismatch.live.questions import NamesReply, Question
from deeptruck_model.recordings import Recording
from deeptruck_model.recordings.extract import of_messages
from deeptruck_model.recordings.resample import Received
from deeptruck_model.recordings.topic_map import DEFAULT_TOPICS

BEGIN_NS = 1_700_000_000_000_000_000
LAZY = TRUCK.with_forces([], [LazyBrake()])


def heard(drive: Recording) -> dict[str, Received]:
    """The messages of a drive as a node hears them."""
    window = Window(1e4, 1e3)
    by_topic: dict[str, dict[str, np.ndarray]] = {}
    for channel, values in drive.channels.items():
        source = DEFAULT_TOPICS[channel]
        by_topic.setdefault(source.topic, {})[source.field] = values
    for topic, columns in by_topic.items():
        for k, t in enumerate(drive.time):
            window.hear(topic, BEGIN_NS + round(t * 1e9), {f: float(x[k]) for f, x in columns.items()})
    return window.heard()


def test_messages_at_hand_are_read_as_a_bag_of_them(tmp_path: Path) -> None:
    (drive,) = drives(TRUCK, 1, 60.0)
    recordings.write_bag(tmp_path / "bag", [drive], interface=drive.interface)
    (from_bag,) = recordings.read(tmp_path / "bag")
    (live,) = of_messages("bag", heard(drive), drive.interface, rate_hz=10.0)
    assert live.channels.keys() == from_bag.channels.keys() and len(live) == len(from_bag)
    for name, values in from_bag.channels.items():
        np.testing.assert_allclose(live.channels[name], values, atol=1e-6)


def test_a_window_keeps_the_newest_and_no_more() -> None:
    window = Window(10.0, 10.0)
    for k in range(5000):
        window.hear("/t", k * 10_000_000, {"x": float(k)})
    window.hear("/t", 4990 * 10_000_000, {"x": -1.0})
    (kept,) = window.heard().values()
    assert len(kept.stamps) == 100 and kept.columns["x"][-1] == -1.0
    window.hear("/t", 0, {"x": 0.0})  # a clock that was set back
    then = window.copy()
    window.hear("/t", 10**9, {"x": 1.0})
    assert [w.heard()["/t"].stamps.tolist() for w in (then, window)] == [[0], [0, 10**9]]


@pytest.fixture(scope="module")
def lazy_brake() -> Question:
    (drive,) = drives(LAZY, 1, 240.0)
    return Question("truck:trucksim", heard(drive))


@pytest.fixture(scope="module")
def right_truck() -> Question:
    (drive,) = drives(TRUCK, 1, 240.0)
    return Question("truck:trucksim", heard(drive))


def test_brakes_that_are_slow_are_named(lazy_brake: Question) -> None:
    found = answer(lazy_brake).found
    assert isinstance(found, NamesReply)
    probable = max((n for n in found.nodes if n.parent == "mismatch"), key=lambda n: n.probability)
    assert probable.node in ("brakes", "timing")
    assert sum(found.shares.values()) == pytest.approx(1.0)


def test_with_the_right_truck_nothing_is_named_and_a_companion_answers_as_the_function(
    right_truck: Question,
) -> None:
    companion = Companion(share=8.0)
    try:
        companion.ask(lambda: right_truck)
        assert companion.busy
        other = companion.taken(waits=True)
        assert other is not None and companion.busy and companion.taken() is None
        time.sleep(other.cpu_s / 8.0)
        assert not companion.busy  # it has rested
    finally:
        companion.close()
    found = answer(right_truck).found
    assert isinstance(found, NamesReply) and found.says == NOT_DETECTED and found.nodes[0].node == "nothing"
    assert other.found == found and other.cpu_s > 0.0


def test_what_a_drive_has_of_its_own_is_that_of_adapt() -> None:
    (drive,) = drives(TRUCK, 1, 180.0)
    found = answer(Question("truck:trucksim", heard(drive), adapts=120.0)).found
    offline = adapt(TRUCK, of_messages("a", heard(drive), drive.interface, rate_hz=10.0), 120.0)
    assert found == offline.own


def test_what_cannot_be_answered_is_said(lazy_brake: Question) -> None:
    few = {topic: Received(h.stamps[:100], {f: x[:100] for f, x in h.columns.items()})
           for topic, h in lazy_brake.heard.items()}  # fmt: skip
    short = answer(Question("truck:trucksim", few)).found
    assert isinstance(short, NamesReply) and "usable driving" in short.says and not short.nodes
    without = {t: h for t, h in lazy_brake.heard.items() if t != "/truck/command"}
    refused = answer(Question("truck:trucksim", without))
    assert refused.found is None and "no valid engine_command" in refused.refused


def test_a_companion_that_is_killed_is_noticed_and_holds_nobody_up(lazy_brake: Question) -> None:
    companion = Companion()
    companion.ask(lambda: lazy_brake)
    companion.close()
    with pytest.raises(RuntimeError, match="has ended with -9"):
        companion.taken(waits=True)
