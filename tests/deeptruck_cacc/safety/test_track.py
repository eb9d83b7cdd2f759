"""Which readings of a radar are believed, behind a leader of 20 m/s at 40 m, 0.1 s apart."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from deeptruck_cacc.safety.track import Tracker

Reading = tuple[float, float, float]  # gap m, leader's speed, own speed m/s
STEADY: Reading = (40.0, 20.0, 20.0)
LOST: Reading = (np.nan, np.nan, 20.0)


def fed(tracker: Tracker, readings: Iterable[Reading]) -> np.ndarray:
    """Gap, leader's speed (m, m/s), whether believed and the time unseen (s), after each reading: (n, 4)."""
    rows = []
    for gap, leader, speed in readings:
        seen = tracker({"gap": gap, "leader_speed": leader, "speed": speed})
        believed = np.isfinite(tracker.readings[0][0, 0])
        rows.append((seen["gap"][0], seen["leader_speed"][0], believed, tracker.unseen_s[0]))
    return np.array(rows)


def settled() -> Tracker:
    """Behind a leader that was seen for so long that another must be read for `farther_s` in its place."""
    tracker = Tracker(0.1)
    assert fed(tracker, [STEADY] * 52)[:, 2].all()
    return tracker


def test_nothing_is_made_up_before_the_first_reading() -> None:
    gap, leader, believed, unseen = fed(Tracker(0.1), [LOST])[0]
    assert np.isnan([gap, leader]).all() and not believed and unseen == np.inf


def test_a_lost_leader_keeps_its_speed() -> None:
    rows = fed(settled(), [(np.nan, np.nan, 21.0)] * 10)
    np.testing.assert_allclose(rows[:, 0], 39.95 - 0.1 * np.arange(10))  # by the mean of both own speeds
    assert (rows[:, 1] == 20.0).all() and not rows[:, 2].any() and rows[-1, 3] == pytest.approx(1.0)


def test_half_a_reading_is_none() -> None:
    assert not fed(settled(), [(np.nan, 20.0, 20.0), (40.0, np.nan, 20.0)])[:, 2].any()


@pytest.mark.parametrize("seconds", [0.1, 1.0, 3.0])
def test_what_comes_back_as_ordinary_traffic_may_have_driven_is_believed_at_once(seconds: float) -> None:
    for rate in (-2.0, 2.0):
        tracker = settled()
        fed(tracker, [LOST] * round(seconds / 0.1))
        back = (40.0 + rate * seconds**2 / 2, 20.0 + rate * seconds, 20.0)
        assert fed(tracker, [back])[0].tolist() == [back[0], back[1], 1.0, 0.0]


def test_a_ghost_of_one_or_two_readings_is_never_believed_and_a_cut_in_from_the_third_on() -> None:
    for length in (1, 2):
        rows = fed(settled(), [*[(10.0, 20.0, 20.0)] * length, *[STEADY] * 5])
        assert (rows[:, 0] == 40.0).all() and rows[length:, 2].all()
    rows = fed(settled(), [(15.0 - 0.1 * k, 19.0, 20.0) for k in range(10)])
    assert rows[:, 2].tolist() == [0, 0, *[1] * 8] and rows[2:, 0] == pytest.approx(14.8 - 0.1 * np.arange(8))


def test_a_ghost_that_comes_back_begins_anew() -> None:
    ghost = (18.0, 20.0, 20.0)
    rows = fed(settled(), ([ghost] * 2 + [STEADY] * 10) * 5)
    assert (rows[:, 0] == 40.0).all()


def test_a_range_that_contradicts_the_speeds_is_counted_and_one_that_closes_in_a_third_as_fast() -> None:
    opening, closing = settled(), settled()
    fed(opening, [(40.0, 20.0 - 0.2 * k, 20.0) for k in range(27)])  # as far as ever behind a braking leader
    assert 1.0 < opening.contradicted_s[0] < 1.3  # from 1.8 s on
    fed(opening, [LOST] * 5)
    assert 1.0 < opening.contradicted_s[0] < 1.3  # nothing new was measured
    fed(closing, [(40.0 - 0.3 * k, 20.0, 20.0) for k in range(40)])
    assert 1.0 < closing.contradicted_s[0] < 1.3  # from 0.5 s on


def test_a_vehicle_that_was_behind_a_ghost_is_followed_again_after_half_as_long_as_that_was_seen() -> None:
    tracker = settled()
    assert fed(tracker, [(15.0, 20.0, 20.0)] * 11)[-1, 0] == 15.0  # over 1 s
    rows = fed(tracker, [STEADY] * 8)
    assert rows[:, 0].tolist() == [15.0] * 5 + [40.0] * 3 and rows[:, 3].max() == 0.0


def test_a_change_of_lane_is_not_followed_and_a_cut_out_is_after_farther_s() -> None:
    away = [(70.0 + 0.15 * k, 21.5, 20.0) for k in range(40)]
    rows = fed(settled(), [*away[:20], *[STEADY] * 3])
    assert (rows[:, 0] == 40.0).all() and rows[20:, 2].all()
    rows = fed(settled(), away)
    assert not rows[:25, 2].any() and rows[25:, 2].all() and rows[-1, 0] == away[-1][0]


def test_a_second_vehicle_must_tell_one_story() -> None:
    """A range that stands still 30 m farther, with a speed that would take it away by 10 m/s."""
    assert not fed(settled(), [(70.0, 30.0, 20.0)] * 39)[:, 2].any()


@pytest.mark.parametrize("wrong", [0.0, 10.0, 60.0])
def test_a_speed_that_jumps_while_the_range_goes_on_is_never_believed(wrong: float) -> None:
    assert not fed(settled(), [(40.0, wrong, 20.0)] * 39)[:, 2].any()


def test_a_range_that_stands_still_is_noticed_when_it_should_have_changed_by_opened_m() -> None:
    """The leader brakes at 2 m/s^2: 2 m, and what the budget leaks by, are missed after 1.7 s."""
    rows = fed(settled(), [(40.0, 20.0 - 0.2 * k, 20.0) for k in range(28)])
    noticed = np.flatnonzero(rows[:, 2] == 0)[0]
    assert 14 <= noticed <= 19 and not rows[noticed:, 2].any()
    assert rows[-1, 0] < 37.0 and rows[-1, 3] > 1.0


@pytest.mark.parametrize("reported", [20.0, 22.0])
def test_a_leader_that_comes_nearer_than_its_speed_says_counts_as_slow_as_that(reported: float) -> None:
    """Its range shrinks by 2 m/s, and then as fast as it brakes at 2 m/s^2."""
    rows = fed(settled(), [(40.0 - 0.2 * k, reported, 20.0) for k in range(60)])
    assert rows[-1, 2] == 1 and 17.9 < rows[-1, 1] < 18.6
    closing = [(40.0 - 0.01 * k**2, 20.0, 20.0) for k in range(30)]
    rows = fed(settled(), closing)
    assert rows[-1, 0] == closing[-1][0] and rows[-1, 1] < 17.5  # it is at 14.2 m/s, seen `rate_s` late


def test_what_the_leader_uncovers_is_to_be_bounded_from_its_second_reading_on() -> None:
    """A standing car, 80 m ahead; the leader that left goes on counting until `farther_s` are over."""
    tracker = settled()
    for k in range(30):
        tracker({"gap": 80.0 - 2.0 * k, "leader_speed": 0.0, "speed": 20.0})
        bounded = np.isfinite(tracker.readings[0][:, 0]) & tracker.counts[:, 0]
        assert bounded.any() == (k > 0)
        assert tracker.counts[:, 0].sum() == (1 if k == 0 or k > 21 else 2)


def test_an_object_keeps_its_place_or_says_where_it_was() -> None:
    """A cut-in becomes the first of the list, and what it hides is where it was."""
    tracker = settled()
    for k in range(5):
        tracker({"gap": 15.0, "leader_speed": 20.0, "speed": 20.0})
        assert tracker.came_from[:, 0].tolist() == [[0, -1, 2], [0, 1, 2], [1, 0, 2], [0, 1, 2], [0, 1, 2]][k]
    assert tracker.objects.gap[:2, 0] == pytest.approx([15.0, 40.0])
    assert tracker.counts[:, 0].tolist() == [True, False, False]  # nothing is hit behind what is seen


def test_wheels_that_are_worn_are_learned_and_no_reason_to_doubt_the_radar() -> None:
    rng, tracker = np.random.default_rng(3), Tracker(0.1)
    factor = np.repeat([-0.03, -0.02, 0.02, 0.03], 100)
    for gap, leader, speed in behind_a_leader(tracker, 120.0, len(factor)):
        seen, its_speed = SOUND["usual noise"](rng, gap, leader)
        tracker({"gap": seen, "leader_speed": its_speed, "speed": (1.0 + factor) * speed})
        assert (tracker.contradicted_s == 0.0).all()
    np.testing.assert_allclose(tracker.own_speed_factor, factor, atol=0.005)


def test_a_leader_that_is_replaced_by_another_at_its_speed_is_never_lost() -> None:
    rng, tracker = np.random.default_rng(5), Tracker(0.1)
    rows = np.array([(away, sd) for away in (-10.0, -7.0, -5.5, 6.0, 10.0, 30.0) for sd in (0.05, 0.3)])
    away, sd = np.repeat(rows, 100, axis=0).T
    for k, (gap, leader, speed) in enumerate(behind_a_leader(tracker, 60.0, len(away))):
        of_gap, of_speed = (sd * np.tile(rng.normal(size=100), len(rows)) for _ in range(2))
        seen = gap + away * (k > 300) + of_gap
        tracker({"gap": seen, "leader_speed": leader + of_speed / 3, "speed": speed})
        assert (tracker.unseen_s <= 1.0).all() or k == 0
        assert (tracker.contradicted_s < 0.5).all()  # control is handed back at 1 s
    assert (np.abs(tracker.objects.gap[0] - gap - away) < 1.0).all()


def test_a_point_of_reflection_that_jumps_is_the_nearest_one() -> None:
    """By 4 m each second: a trailer and its cab."""
    rng, tracker = np.random.default_rng(4), Tracker(0.1)
    for k, (gap, leader, speed) in enumerate(behind_a_leader(tracker, 60.0)):
        seen, its_speed = SOUND["usual noise"](rng, gap + 4.0 * (k // 10 % 2), leader)
        used = tracker({"gap": seen, "leader_speed": its_speed, "speed": speed})["gap"]
        assert (tracker.contradicted_s == 0.0).all()
        assert (np.abs(used - gap) < 1.5).all()


def behind_a_leader(tracker: Tracker, seconds: float, batch: int = 100) -> Iterable[tuple[np.ndarray, ...]]:
    """True gap, leader's and own speed of trucks that follow leaders of 17 to 23 m/s, 40 m behind."""
    gap, speed = np.full(batch, 40.0), np.full(batch, 20.0)
    for k in range(round(seconds / tracker.dt)):
        leader = 20.0 + 3.0 * np.sin(0.02 * k + np.arange(batch) % 100)
        gap = gap + tracker.dt * (leader - speed)
        yield gap, leader, speed
        wanted = 0.1 * (gap - 40.0) + 0.3 * (leader - speed)
        speed = speed + tracker.dt * np.clip(wanted, -1.0, 1.0)


Radar = Callable[[np.random.Generator, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
SOUND: dict[str, Radar] = {
    "usual noise": lambda r, g, v: (g + 0.1 * r.normal(size=len(g)), v + 0.05 * r.normal(size=len(g))),
    "twice the noise": lambda r, g, v: (g + 0.2 * r.normal(size=len(g)), v + 0.1 * r.normal(size=len(g))),
    "scale of 1.02 and a speed off by 0.15 m/s": lambda r, g, v: (
        1.02 * g + 0.1 * r.normal(size=len(g)),
        v - 0.15 + 0.05 * r.normal(size=len(g)),
    ),
    "a grid of 0.1 m and 0.1 m/s": lambda r, g, v: (
        np.round(g + 0.1 * r.normal(size=len(g)), 1),
        np.round(v + 0.05 * r.normal(size=len(g)), 1),
    ),
    "no noise": lambda r, g, v: (g, v),
}


def test_a_sound_radar_is_never_doubted() -> None:
    """5 min of 100 trucks by each radar, every 20 s without a reading for 0.3 s."""
    rng, tracker = np.random.default_rng(0), Tracker(0.1)
    for k, (gap, leader, speed) in enumerate(behind_a_leader(tracker, 300.0, 100 * len(SOUND))):
        lost = (k + 7 * np.arange(len(gap))) % 200 < 3
        parts = zip(SOUND.values(), np.split(gap, len(SOUND)), np.split(leader, len(SOUND)), strict=True)
        seen, its_speed = (
            np.concatenate(x) for x in zip(*(see(rng, g, v) for see, g, v in parts), strict=True)
        )
        tracker({"gap": np.where(lost, np.nan, seen), "leader_speed": its_speed, "speed": speed})
        doubted = (tracker.contradicted_s != 0.0).reshape(len(SOUND), -1).any(axis=1)
        assert not doubted.any(), [kind for kind, yes in zip(SOUND, doubted, strict=True) if yes]


def test_a_range_that_drifts_away_is_handed_back_before_it_is_off_by_6_m() -> None:
    """A second after it contradicts the speeds, with the usual noise, from the 20th second on, and with each
    so manieth reading missed."""
    rng, tracker = np.random.default_rng(1), Tracker(0.1)
    rows = np.array([(0.2, 0), (0.3, 0), (0.7, 0), (0.2, 2), (0.5, 2), (0.7, 4)])
    drift, every = np.repeat(rows, 100, axis=0).T
    lost_m = np.full(len(drift), np.nan)
    for k, (gap, leader, speed) in enumerate(behind_a_leader(tracker, 80.0, len(drift))):
        off = drift * max(0.1 * k - 20.0, 0.0)
        of_gap, of_speed = (sd * np.tile(rng.normal(size=100), len(rows)) for sd in (0.1, 0.05))
        seen, its_speed = gap + off + of_gap, leader + of_speed
        miss = (every > 0) & (k > 50) & (k % np.maximum(every, 1.0) == 0)
        tracker({"gap": np.where(miss, np.nan, seen), "leader_speed": its_speed, "speed": speed})
        ended = np.isnan(lost_m) & (tracker.contradicted_s > 1.0)
        lost_m[ended] = off[ended]
    late = ~(lost_m < 6.0).reshape(len(rows), -1).all(axis=1)
    assert not late.any(), rows[late]


@pytest.mark.parametrize("held", ["both", "range", "speed"])
def test_a_noisy_radar_that_repeats_itself_is_frozen_while_the_truck_moves(held: str) -> None:
    rng, tracker = np.random.default_rng(2), Tracker(0.1)
    for gap, leader, speed in behind_a_leader(tracker, 15.0):
        kept = SOUND["usual noise"](rng, gap, leader)
        tracker({"gap": kept[0], "leader_speed": kept[1], "speed": speed})
    for moving, frozen in ((speed, True), (np.zeros(100), False)):
        for _ in range(9):
            now = SOUND["usual noise"](rng, gap, leader)
            seen = {"gap": now[0] if held == "speed" else kept[0]}
            seen["leader_speed"] = now[1] if held == "range" else kept[1]
            tracker({**seen, "speed": moving})
        assert (tracker.frozen == frozen).all()


def test_after_forget_s_the_next_reading_begins_anew() -> None:
    tracker = settled()
    fed(tracker, [LOST] * 41)
    assert fed(tracker, [(120.0, 25.0, 20.0)])[0].tolist() == [120.0, 25.0, 1.0, 0.0]


def test_each_truck_of_a_batch_has_its_own_track() -> None:
    tracker = Tracker(0.1)
    for _ in range(3):
        tracker({"gap": np.array([40.0, 60.0]), "leader_speed": 20.0, "speed": 20.0})
    seen = tracker({"gap": np.array([np.nan, 59.9]), "leader_speed": 20.0, "speed": 20.0})
    assert seen["gap"].tolist() == [40.0, 59.9] and tracker.unseen_s.tolist() == [0.1, 0.0]


def test_what_the_objects_need_goes_on_as_they_were_seen_to() -> None:
    tracker = settled()
    assert tracker.needed_braking(2.0)[0] == 0.0
    fed(tracker, [(40.0 - 0.5 * k, 20.0, 25.0) for k in range(10)])
    assert tracker.needed_braking(2.0)[0] == pytest.approx(25.0 / 2 / 33.5, rel=0.05)
    braking = settled()
    fed(braking, [(40.0 - 0.01 * k**2, 20.0 - 0.2 * k, 20.0) for k in range(30)])
    rate = float(braking.objects.rate[0, 0])
    assert rate == pytest.approx(-2.0, abs=0.2)
    needs = 400.0 / 2 / (29.6 + 14.2**2 / 2 / -rate)
    assert braking.needed_braking(2.0)[0] == pytest.approx(needs, rel=0.05)
    fed(braking, [LOST] * 10)  # it slows down by 2 m/s more, and is 7 m nearer
    needs = 400.0 / 2 / (22.8 + 12.2**2 / 2 / -rate)
    assert braking.needed_braking(2.0)[0] == pytest.approx(needs, rel=0.05)


def test_a_leader_that_slows_gently_is_stopped_behind_too() -> None:
    """By 0.8 m/s^2, and as fast as the truck: one that keeps its speed would need no braking."""
    tracker = settled()
    fed(tracker, [(40.0 - 0.004 * k**2, 20.0 - 0.08 * k, 20.0 - 0.08 * k) for k in range(20)])
    rate, own, gap = float(tracker.objects.rate[0, 0]), 20.0 - 0.08 * 19, float(tracker.objects.gap[0, 0])
    assert rate == pytest.approx(-0.8, abs=0.05)
    needs = own**2 / 2 / (gap - 2.0 + own**2 / 2 / -rate)
    assert tracker.needed_braking(2.0)[0] == pytest.approx(needs, rel=0.05)


def test_the_page_states_each_time_of_the_tracker() -> None:
    page = (Path(__file__).parents[3] / "docs" / "cacc_shield.md").read_text()
    stated = {name: float(value) for name, value in re.findall(r"`(\w+_s)` ([\d.]+)(?=[, |])", page)}
    times = {
        f.name: f.default for f in fields(Tracker) if f.name.endswith("_s") and isinstance(f.default, float)
    }
    assert times == {name: stated.get(name) for name in times}
