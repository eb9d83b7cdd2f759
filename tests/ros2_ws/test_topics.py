"""One list of topics: layouts, bags and the running nodes keep to it."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from deeptruck_core.signals import CHANNELS, FAULTS
from deeptruck_model.recordings.topic_map import DEFAULT_TOPICS
from deeptruck_nodes.topics import RECORDED, TOPICS, Topic, expected_subscribers

ROOT = Path(__file__).parents[2]


def test_a_node_starts_without_the_library_of_mechanisms() -> None:
    """The library took three quarters of the processor time in which a node starts."""
    script = "import sys, deeptruck_nodes.leader, deeptruck_nodes.live_page; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert not {"numba", "scipy.signal"} & set(done.stdout.split())


def test_extraction_reads_what_the_nodes_publish() -> None:
    for channel, source in DEFAULT_TOPICS.items():
        topic = TOPICS[source.topic]
        assert topic.name in RECORDED and channel in CHANNELS
        optional = (
            "ambient_temperature",
            "latitude",
            "longitude",
            "brake_switch",
            *FAULTS,
        )  # from the bus, where it has them
        if topic.fields and channel not in optional:
            assert source.field == f"position[name={channel}]" and channel in topic.fields


def test_expected_subscribers_count_the_nodes_of_the_run_only() -> None:
    twist = TOPICS["/truck/twist"]
    assert expected_subscribers(twist, ("leader", "controller", "recorder", "truck_sim")) == 3
    assert expected_subscribers(twist, ("controller",)) == 1


def topic_of(path: str) -> Topic:
    """The topic a path begins with."""
    found = [topic for name, topic in TOPICS.items() if re.match(rf"{re.escape(name)}(?:[./\[{{]|$)", path)]
    assert len(found) == 1, f"{path} belongs to no topic"
    return found[0]


def resolves(topic: Topic, field: str) -> bool:
    """Whether a dotted path, with [index] where it is a list, exists in the topic's message."""
    value: object = topic.message()
    for name, index in re.findall(r"(\w+)(?:\[(\d+)\])?", field):
        if not hasattr(value, name):
            return False
        value = getattr(value, name)
        if index:
            return topic.fields != () and int(index) < len(topic.fields)
    return isinstance(value, int | float)


@pytest.mark.parametrize("layout", ["foxglove.json", "plotjuggler.xml"])
def test_a_layout_shows_fields_that_exist(layout: str) -> None:
    text = (ROOT / "layouts" / layout).read_text()
    paths = set(re.findall(r'"(?:value|topicToRender)":\s*"(/[^"]+)"', text))
    paths |= set(re.findall(r'<(?:curve|topic)\b[^>]* name="([^"]+)"', text))
    assert {"/truck/twist", "/radar/range", "/truck/command"} <= {topic_of(path).name for path in paths}
    for path in paths:
        topic = topic_of(path)
        rest = path.removeprefix(topic.name).strip("./")
        by_joint = layout.endswith("xml") and topic.fields and rest  # so PlotJuggler names a JointState
        assert not rest or (
            rest.partition("/")[0] in topic.fields if by_joint else resolves(topic, rest.replace("/", "."))
        ), path
