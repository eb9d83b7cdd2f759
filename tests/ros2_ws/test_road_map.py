from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from deeptruck_cacc.controllers.road_ahead import AHEAD, AHEAD_M
from deeptruck_nodes import roads
from deeptruck_nodes.messages import nanoseconds
from deeptruck_nodes.topics import ROAD, ROAD_AHEAD, TWIST

HILLS = "sine:grade=0.03,length=400"


def decoded(bag: Path) -> dict[str, list[Any]]:
    """Messages of a bag by topic, in the order of their stamps."""
    found: dict[str, list[Any]] = {}
    with (bag / f"{bag.name}_0.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages(log_time_order=True):
            found.setdefault(channel.topic, []).append(message)
    return found


def test_in_lockstep_every_step_has_the_road_ahead_and_the_economy_drives_by_it(
    start: Callable[..., Any], tmp_path: Path
) -> None:
    """On a flat road with a map of hills, where a truck that trusts its map changes its speed."""
    words = ("--simulator", "truck:trucksim", "--policy", "planner:truck:trucksim?economy", "--lockstep")
    words += ("--radar", "clean", "--known-road", HILLS, "--duration", 15, "--record", tmp_path / "bag")
    code, _, errors = start("start_simulation.py", *words).finish()
    assert (code, errors) == (0, "")
    bag, hills = decoded(tmp_path / "bag"), roads.parse(HILLS)
    ahead, twists = bag[ROAD_AHEAD.name], bag[TWIST.name]
    assert [nanoseconds(m.header.stamp) for m in ahead] == [nanoseconds(m.header.stamp) for m in twists]
    assert ahead[0].name[:2] == ["grade_0", "grade_25"] and len(ahead[0].name) == AHEAD
    speed = np.array([m.twist.linear.x for m in twists])
    way = 0.1 * np.concatenate([[0.0], np.cumsum(speed[1:])])  # m, where the truck is at each step
    here = [m.position[0] for m in ahead]
    np.testing.assert_allclose(here, [hills.at(x)[0] for x in way], atol=1e-3)
    expected = [hills.at(AHEAD_M * k)[0] for k in range(AHEAD)]
    np.testing.assert_allclose(ahead[0].position, expected, atol=1e-9)
    felt = [m.position[list(m.name).index("grade")] for m in bag[ROAD.name]]
    assert not np.any(felt) and np.ptp(speed) > 0.1  # 0.32 m/s; without a map it is 0.006 m/s
