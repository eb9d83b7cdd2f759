"""What the page is told: every sample, and how old each topic is."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from deeptruck_nodes.page.live import Ages, Link, Live

SECOND = 1_000_000_000


def live() -> Live:
    return Live(("leader",), (Link("/radar/range", ("leader",), ("controller",)),), {"engine_command": "N m"})


def batch(of: Live, now: float) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(of.batch(now))
    return found


def test_every_sample_is_in_exactly_one_batch() -> None:
    run, times, values = live(), [], []
    for k in range(100):
        run.sample(7 * SECOND + k * SECOND // 100, {"speed": 20.0 + k})
        if k % 10 == 9:
            t, v = batch(run, k / 100)["samples"]["speed"]
            times, values = times + t, values + v
    assert times == [10 * k for k in range(100)] and values == [20.0 + k for k in range(100)]
    assert batch(run, 1.0)["samples"] == {}


def test_what_is_no_number_is_null() -> None:
    run = live()
    for value in (math.nan, math.inf, -math.inf, 1.23456789):
        run.sample(SECOND, {"gap": value})
    assert batch(run, 0.0)["samples"]["gap"][1] == [None, None, None, 1.2346]


def received(rate: float, until: float = 10.0, at_once: int = 1) -> Ages:
    ages = Ages()
    for k in range(int(until * rate)):
        ages.hear(at_once, k / rate)
    return ages


@pytest.mark.parametrize(
    ("rate", "age", "state"),
    [
        (10, 0.4, "fresh"),
        (10, 0.7, "late"),
        (10, 2.5, "silent"),
        (1, 1.5, "fresh"),
        (1, 3.0, "late"),
        (1, 7.0, "silent"),
    ],
)
def test_a_topic_is_as_fresh_as_its_own_pauses_allow(rate: float, age: float, state: str) -> None:
    ages = received(rate)
    assert ages.state(ages.at + age) == state


def test_four_nodes_that_speak_in_the_same_moment_are_not_late_in_between() -> None:
    ages = received(1, at_once=4)
    assert ages.state(ages.at + 0.99) == "fresh" and 1 / ages.period == pytest.approx(4, rel=0.02)


def test_after_a_long_silence_a_topic_soon_has_its_old_pauses_again() -> None:
    ages = received(10)
    for k in range(60):
        ages.hear(1, 30 + k / 10)
    assert ages.state(ages.at + 0.6) == "late"


def test_a_topic_that_was_never_heard_has_no_age() -> None:
    assert Ages().state(5.0) == "unheard"
    assert batch(live(), 5.0)["topics"] == {}


def test_the_age_is_that_of_the_last_message() -> None:
    run = live()
    run.received("/radar/range", 3, 9.5)
    assert batch(run, 9.8)["topics"]["/radar/range"][:2] == ["fresh", 0.3]


def test_health_is_told_when_it_changes_and_to_who_comes_later() -> None:
    run = live()
    run.health(SECOND, "leader", "warn", "nobody is ahead", {"smallest_gap_m": "3"}, 1.0)
    said = {"level": "warn", "says": "nobody is ahead", "values": {"smallest_gap_m": "3"}}
    assert batch(run, 1.0)["health"] == {"leader": said}
    later = batch(run, 2.5)
    assert later["health"] == {} and later["ages"] == {"leader": 1.5}
    greeting = json.loads(run.greeting())
    assert greeting["health"] == {"leader": said} and greeting["units"] == {"engine_command": "N m"}
    assert greeting["links"] == [
        {"topic": "/radar/range", "from": ["leader"], "to": ["controller"], "expected": True}
    ]


def test_the_shield_is_a_sample_whenever_its_count_has_grown() -> None:
    run = live()
    for second, count in enumerate(("0", "0", "4", "4", "9", "2")):  # 2: another controller, which began anew
        run.health(second * SECOND, "controller", "ok", "following", {"shield_acted": count}, second)
    run.health(9 * SECOND, "leader", "ok", "driving ahead", {"shield_acted": "no number"}, 9.0)
    assert batch(run, 6.0)["samples"] == {"shield": [[0, 2000], [4.0, 5.0]]}


def test_a_topic_that_seldom_comes_is_fresh_for_its_own_pause() -> None:
    seldom = Link("/mismatch/names", ("mismatch_monitor",), ("recorder",), False, 30.0)
    run = Live(("mismatch_monitor",), (seldom,), {})
    run.received("/mismatch/names", 1, 100.0)
    run.received("/mismatch/names", 1, 130.0)
    states = [batch(run, 130.0 + age)["topics"]["/mismatch/names"][0] for age in (31.0, 70.0, 200.0)]
    assert states == ["fresh", "late", "silent"]


def test_names_and_parts_that_hold_a_share_come_once_and_to_whoever_joins() -> None:
    run = live()
    run.names({"brakes": 0.97, "brake_lag": 0.9, "brake_fade": 0.07, "unknown": 0.01, "timing": 0.02})
    run.budget({"speed_rmse": 0.5, "horizon_s": 40.0, "brakes": 0.6, "slow": 0.37, "left_over": 0.03})
    said = batch(run, 0.0)["missing"]
    assert said["names"] == [["brakes", 0.97, [["brake lag", 0.9], ["brake fade", 0.07]]]]
    assert said["budget"] == [["brakes", 0.6], ["slow drift", 0.37]]
    assert said["off"] == [0.5, 40.0]
    assert "missing" not in batch(run, 0.1) and json.loads(run.greeting())["missing"] == said
    run.names(dict.fromkeys(("brakes", "brake_lag"), math.nan))
    run.budget({"speed_rmse": math.nan})
    assert batch(run, 0.2)["missing"] == {"names": [], "budget": [], "off": [None, None]}
