"""Which readings of a radar are believed, behind a leader of 20 m/s at 40 m, 0.1 s apart."""

from __future__ import annotations

from collections.abc import Iterable

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
        believed = np.isfinite(tracker.radar[0][0])
        rows.append((seen["gap"][0], seen["leader_speed"][0], believed, tracker.unseen_s[0]))
    return np.array(rows)


def settled() -> Tracker:
    tracker = Tracker(0.1)
    assert fed(tracker, [STEADY] * 30)[:, 2].all()
    return tracker


def test_nothing_is_made_up_before_the_first_reading() -> None:
    gap, leader, believed, unseen = fed(Tracker(0.1), [LOST])[0]
    assert np.isnan([gap, leader]).all() and not believed and unseen == np.inf


def test_a_lost_leader_keeps_its_speed() -> None:
    rows = fed(settled(), [(np.nan, np.nan, 21.0)] * 10)
    np.testing.assert_allclose(rows[:, 0], 40.0 - 0.1 * np.arange(1, 11))
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


def test_a_range_that_contradicts_the_speeds_is_counted_unless_it_closes_in() -> None:
    opening, closing = settled(), settled()
    fed(opening, [(40.0, 20.0 - 0.2 * k, 20.0) for k in range(30)])  # as far as ever behind a braking leader
    assert 1.0 < opening.contradicted_s[0] < 1.5
    fed(opening, [LOST] * 5)
    assert opening.contradicted_s[0] == pytest.approx(1.4, abs=0.2)  # nothing new was seen
    fed(opening, [(opening._tracks[0].gap[0], opening._tracks[0].speed[0], 20.0)])  # type: ignore[index]
    assert opening.contradicted_s[0] == 0.0
    fed(closing, [(40.0 - 0.01 * k**2, 20.0, 20.0) for k in range(30)])
    assert closing.contradicted_s[0] == 0.0


def test_a_vehicle_that_was_behind_a_ghost_is_believed_again_at_once() -> None:
    tracker = settled()
    assert fed(tracker, [(15.0, 20.0, 20.0)] * 10)[-1, 0] == 15.0
    assert fed(tracker, [STEADY])[0].tolist() == [40.0, 20.0, 1.0, 0.0]


def test_a_change_of_lane_is_not_followed_and_a_cut_out_is_after_farther_s() -> None:
    away = [(70.0 + 0.15 * k, 21.5, 20.0) for k in range(40)]
    rows = fed(settled(), [*away[:20], *[STEADY] * 3])
    assert (rows[:, 0] == 40.0).all() and rows[20:, 2].all()
    rows = fed(settled(), away)
    assert not rows[:25, 2].any() and rows[25:, 2].all() and rows[-1, 0] == away[-1][0]


def test_a_second_vehicle_must_tell_one_story() -> None:
    """A range that stands still 30 m farther, with a speed that would take it away by 5 m/s."""
    assert not fed(settled(), [(70.0, 25.0, 20.0)] * 39)[:, 2].any()


@pytest.mark.parametrize("wrong", [0.0, 10.0, 26.0, 60.0])
def test_a_speed_that_jumps_while_the_range_goes_on_is_never_believed(wrong: float) -> None:
    assert not fed(settled(), [(40.0, wrong, 20.0)] * 39)[:, 2].any()


def test_a_range_that_is_frozen_is_noticed_when_it_should_have_changed_by_drift_m() -> None:
    """The leader brakes at 2 m/s^2: 2 m are missed after 1.4 s, a little later as the range corrects."""
    rows = fed(settled(), [(40.0, 20.0 - 0.2 * k, 20.0) for k in range(30)])
    noticed = np.flatnonzero(rows[:, 2] == 0)[0]
    assert 14 <= noticed <= 18 and not rows[noticed:, 2].any()
    assert rows[-1, 0] < 36.0 and rows[-1, 3] > 1.0


def test_a_speed_that_is_frozen_while_the_range_closes_in_counts_as_slow_as_that() -> None:
    closing = [(40.0 - 0.01 * k**2, 20.0, 20.0) for k in range(30)]  # 2 m/s^2
    tracker = settled()
    rows = fed(tracker, closing)
    noticed = np.flatnonzero(rows[:, 1] < 20.0)[0]
    assert 14 <= noticed <= 18 and rows[-1, 0] == closing[-1][0] and rows[-1, 1] < 18.5 and rows[-1, 3] > 1.0


@pytest.mark.parametrize("closing", [-2.0, 2.0])
def test_a_speed_of_the_wrong_sign_is_noticed(closing: float) -> None:
    wrong = [(40.0 - 0.1 * closing * k, 20.0 + closing, 20.0) for k in range(30)]
    tracker = settled()
    unseen = fed(tracker, wrong)[:, 3]
    assert 3 <= np.flatnonzero(unseen > 0)[0] <= 12


def test_noise_of_the_usual_radar_is_never_doubted() -> None:
    rng = np.random.default_rng(0)
    batch, tracker = 200, Tracker(0.1)
    gap, speed = np.full(batch, 40.0), np.full(batch, 20.0)
    for k in range(600):
        leader = 20.0 + 3.0 * np.sin(0.02 * k + np.arange(batch))
        gap = gap + 0.1 * (leader - speed)
        noisy = gap + 0.1 * rng.normal(size=batch), leader + 0.05 * rng.normal(size=batch)
        tracker({"gap": noisy[0], "leader_speed": noisy[1], "speed": speed})
        assert (tracker.unseen_s == 0.0).all()
        speed = speed + 0.1 * np.clip(0.1 * (gap - 40.0), -1.0, 1.0)


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
