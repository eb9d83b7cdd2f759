"""What the own brakes give is learned, and a policy presses them no faster than it may."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_cacc.safety.assumptions import Assumptions
from deeptruck_cacc.safety.brakes import Brakes
from deeptruck_cacc.safety.shield import Shield
from deeptruck_core.constants import ROUNDED_GRAVITY

ASSUMED = Assumptions()


def column(*values: float) -> np.ndarray:
    return np.array(values, float)


def test_brakes_that_give_half_are_learned_within_a_second_and_need_more_room() -> None:
    """At 3 m/s^2 asked for by a policy the truck slows down by 1.5 m/s^2; once it gives all again, slowly."""
    shield, speed, share = Shield(ASSUMED, 0.0, 100.0), 25.0, 0.6
    promised = float(ASSUMED.least_braking(column(share), column(0.0))[0])
    gains, rooms, failed = [], [], []
    for k in range(40):
        shield.see(column(150.0), column(25.0), column(speed), column(0.0))
        shield.limit(column(0.0), column(100.0 * share), column(0.0))
        gains.append(float(shield.brakes.gain[0]))
        rooms.append(float(shield.room_m[0]))
        failed.append(bool(shield.brakes.failed[0]))
        speed -= 0.1 * promised * (0.5 if k < 25 else 1.0)
    assert gains[:10] == [1.0] * 10 and gains[20] == pytest.approx(0.5 + 9.81 * 0.01 / promised, abs=0.03)
    assert rooms[20] < rooms[5] - 20.0 and failed.index(True) <= 18
    assert gains[30] < 0.8 and gains[-1] > gains[30]


def judged(share: float, gain: float, grade: float = 0.0, known: bool = True, speed: float = 25.0) -> float:
    """The gain that is learned in 3 s of a constant share, from brakes that give `gain` on a slope."""
    brakes = Brakes(ASSUMED)
    promised = float(ASSUMED.least_braking(column(share), column(0.0))[0])
    for _ in range(30):
        brakes.see(column(speed), column(grade if known else np.nan), column(0.0))
        brakes.sent(column(share))
        speed -= ASSUMED.dt * (promised * gain + ROUNDED_GRAVITY * grade)
    return float(brakes.gain[0])


def test_slope_counts_by_what_is_known_of_it_and_weak_commands_say_nothing() -> None:
    for grade in (-0.05, 0.0, 0.05):
        assert judged(0.6, 0.5, grade) == pytest.approx(0.5, abs=0.05)
    assert judged(0.6, 0.9, known=False) == 1.0  # the truck may be on the steepest descent
    assert judged(0.6, 0.5, known=False) < 0.65
    assert judged(0.1, 0.0) == 1.0
    assert judged(0.6, 1.3) == 1.0


def test_brakes_that_keep_a_deceleration_are_not_judged_by_the_slope() -> None:
    """Uphill they press less for the same deceleration."""
    assumed, speed = replace(ASSUMED, descent_share=1.5), 25.0
    brakes = Brakes(assumed)
    promised = float(assumed.least_braking(column(0.4), column(0.0))[0])
    for _ in range(30):
        brakes.see(column(speed), column(0.06), column(0.0))
        brakes.sent(column(0.4))
        speed -= assumed.dt * promised
    assert brakes.gain[0] == 1.0


def test_a_policy_presses_by_the_jerk_and_releases_below_the_bite_at_once() -> None:
    brakes = Brakes(replace(ASSUMED, bite=0.05))
    brakes.see(column(20.0), column(0.0), column(0.0))
    step, free = 3.0 * 0.1 / 7.5, column(1.0)
    sent = [float(brakes.slewed(column(share), free)[0]) for share in (1.0, 1.0, 0.0, 0.0, 0.04, 0.0)]
    assert sent == pytest.approx([0.05 + step, 0.05 + 2 * step, 0.05 + step, 0.0, 0.04, 0.0])
    assert np.isnan(brakes.slewed(column(np.nan), free)).all()


def test_a_speed_that_repeats_itself_says_nothing_and_one_slow_rise_is_no_failure() -> None:
    brakes, speed = Brakes(ASSUMED), 25.0
    for k in range(60):
        brakes.see(column(speed), column(0.0), column(0.0))
        brakes.sent(column(0.8))
        speed -= 0.0 if k < 30 else ASSUMED.dt * min(0.5 * (k - 30), 5.0)  # frozen, then a second of rise
        assert k >= 30 or brakes.gain[0] == 1.0
    assert brakes.gain[0] < 1.0 and not brakes.failed[0]
