from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_cacc.controllers.baselines import baseline
from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.controllers.scaling import ActionScale
from deeptruck_cacc.environments import hard_scenes, scenes
from deeptruck_cacc.environments.rollouts import roll_out
from deeptruck_cacc.safety import proof, truck_limits
from deeptruck_cacc.safety.assumptions import GOES_ON_S, Assumptions
from deeptruck_cacc.safety.guard import guard, load_controller
from deeptruck_cacc.safety.shield import Shield
from deeptruck_core.constants import ROUNDED_GRAVITY
from deeptruck_core.errors import InputError
from deeptruck_core.signals import SPEED, TruckInterface
from deeptruck_model import simulators

PROMISE = Assumptions()
COOLING = 3.4e-4 + 1.6e-5 * 20.0  # 1/s, at 20 m/s


def column(*values: float) -> np.ndarray:
    return np.array(values, float)


def stopping_margin(p: Assumptions, gap: float, speed: float, leader: float, wait: float) -> float:
    """The requirement in small steps: the leader brakes at its bound, the truck late and then at its own."""
    h, t, least = 0.001, 0.0, gap
    rise = float(p.acceleration_at(column(speed))[0])
    peak = speed + rise * (wait + p.response_s)
    braking = float(p.braking_when(column(p.stop_heat * 0.5 * peak**2))[0])
    while speed > 0:
        speed += h * (rise if t < wait + p.response_s else -braking)
        leader = max(leader - h * p.leader_braking, 0.0)
        gap += h * (leader - max(speed, 0.0))
        least, t = min(least, gap), t + h
    return least - p.d_safety


def test_needed_gap_is_equation_4():
    """docs/cacc_shield.md, (1) to (4), by hand: 20 m/s behind 15 m/s, cold brakes, w of 0.1 s."""
    late, rise = 0.1 + 0.6, 24.0 / 20.0
    peak = 20.0 + rise * late
    braking = 4.2  # a stop heats the brakes to 0.6 * peak^2 = 261 J/kg, below the 400 from which they fade
    travelled = 20.0 * late + rise * late**2 / 2 + peak**2 / (2 * braking)
    between_calls = peak * 0.1 / 2 + braking * 0.1**2 / 2
    gap = 2.0 + travelled + between_calls - 15.0**2 / (2 * 6.0)
    assert PROMISE.needed_gap(column(20.0), column(15.0), column(0.0), 0.1) == pytest.approx(gap)


@pytest.mark.parametrize("stop_heat", [1.0, 1.2, 1.5])
def test_the_heat_of_the_stop_itself_fades_the_brakes(stop_heat):
    """At 30 m/s a stop heats cold brakes beyond the 400 J/kg from which they lose 2.5e-4 for each J/kg."""
    late, rise = 0.1 + 0.6, 24.0 / 30.0
    peak = 30.0 + rise * late
    braking = 4.2 * (1.0 - 2.5e-4 * (stop_heat * peak**2 / 2 - 400.0))
    travelled = 30.0 * late + rise * late**2 / 2 + peak**2 / (2 * braking)
    gap = 2.0 + travelled + peak * 0.1 / 2 + braking * 0.1**2 / 2 - 10.0**2 / (2 * 6.0)
    assumed = replace(PROMISE, stop_heat=stop_heat)
    assert assumed.needed_gap(column(30.0), column(10.0), column(0.0), 0.1) == pytest.approx(gap)


@pytest.mark.parametrize(("since", "share"), [(0.0, 0.0), (0.5, 0.0), (0.6, 1.2 * 4.2)])
def test_the_worst_truck_heats_its_brakes_once_they_grip(since, share):
    """dt (stop_heat braking v - cooling heat) under the full brake; 300 J/kg is below where they fade."""
    _, after, heat = proof._worst_truck(
        PROMISE, column(20.0), column(since), column(300.0), column(0.0), column(1.0)
    )
    assert after == pytest.approx(since + 0.1)
    assert heat == pytest.approx(300.0 + 0.1 * (share * 20.0 - 300.0 * COOLING))


def test_the_worst_truck_heats_its_brakes_by_the_share_pressed():
    _, after, heat = proof._worst_truck(
        PROMISE, column(20.0), column(0.4), column(300.0), column(0.0), column(0.3)
    )
    assert after == 0.0 and heat == pytest.approx(300.0 + 0.1 * (0.3 * 7.5 * 20.0 - 300.0 * COOLING))


@pytest.mark.parametrize("speed", [3.0, 10.0, 20.0, 30.0])
@pytest.mark.parametrize("leader", [0.0, 8.0, 20.0, 31.0])
def test_needed_gap_suffices_and_is_too_large_by_the_time_between_calls_alone(speed, leader):
    gap = float(PROMISE.needed_gap(column(speed), column(leader), column(0.0), PROMISE.dt)[0])
    margin = stopping_margin(PROMISE, gap, speed, leader, PROMISE.dt)
    assert margin >= 0
    peak = speed + float(PROMISE.acceleration_at(column(speed))[0]) * (PROMISE.dt + PROMISE.response_s)
    braking = float(PROMISE.braking_when(column(PROMISE.stop_heat * 0.5 * peak**2))[0])
    between_calls = 0.5 * peak * PROMISE.dt + 0.5 * braking * PROMISE.dt**2
    if gap > PROMISE.d_safety + between_calls:  # else the truck stops before its leader, and nearest before
        assert margin == pytest.approx(between_calls, abs=0.03)


@pytest.mark.parametrize(("wish", "rate"), [(0.9, 24.0 / 16.0), (0.25, 0.0), (0.1, -0.2 * 0.5 * 4.2)])
def test_the_worst_truck_obeys_short_of_the_full_brake(wish, rate):
    """Full engine, neither, and a fifth of the brake: at 16 m/s, cold, behind a steady leader."""
    genes = np.zeros((1, proof.WIDTH))
    genes[:, :2] = 16.0 / 32.0  # own speed and the leader's
    _, pull, wishes, _, _ = np.split(genes[0], 5 + proof.KNOTS * np.arange(4))
    pull[:], wishes[:] = 6.0 / 8.0, wish  # the leader keeps its speed
    least = proof.rollouts(PROMISE, genes, steps=2, shielded=False).least
    start = PROMISE.needed_gap(column(16.1), column(15.9), column(0.0), 0.0) + PROMISE.gap_error
    lost = PROMISE.dt * max(rate, 0.0) * PROMISE.dt  # the second step begins faster than the leader
    assert least == pytest.approx(start - lost - PROMISE.d_safety, abs=1e-12)


def test_the_adversary_drives_from_some_brake_to_the_full_engine_and_to_no_number():
    """By the wish: the brake falls from 0.4 to none at 0.2, the engine from none at 0.25 to 1 at 0.75."""
    engine, brake = proof._policy(column(0.0, 0.1, 0.2, 0.25, 0.5, 0.75, 0.95, 0.96))
    assert engine == pytest.approx([0.0, 0.0, 0.0, 0.0, 0.5, 1.0, 1.0, np.nan], nan_ok=True)
    assert brake == pytest.approx([0.4, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


def test_random_policies_leaders_and_radars_find_no_violation():
    outcome = proof.random_search(PROMISE, 3000)
    assert outcome.violations == 0 and outcome.rollouts == 3000
    assert proof.random_search(PROMISE, 500, shielded=False).violations > 100


def test_a_search_finds_a_shield_that_trusts_a_lost_leader_too_long():
    class Trusting(Assumptions):
        """Its leader keeps its speed while it is not seen; the true one brakes as it was seen to."""

    trusting = Trusting(track_s=1e6)
    found = 0

    class Believing(Shield):
        def _move(self, *seen):
            kept, self.assumed = self.assumed, trusting
            super()._move(*seen)
            self.assumed = kept

    original, proof.Shield = proof.Shield, Believing
    try:
        found = proof.random_search(PROMISE, 3000).violations
    finally:
        proof.Shield = original
    assert found > 0 and proof.random_search(PROMISE, 3000).violations == 0


def test_it_brakes_no_earlier_than_the_worst_leader_consistent_with_the_track_needs():
    """Without measurement errors: within soft_m, and what a step's travel may differ by, of equation 4."""
    exact = replace(PROMISE, gap_error=0.0, speed_error=0.0)
    outcome = proof.adversarial_search(exact, population=300, generations=8)
    assert outcome.violations == 0
    assert 0.0 < outcome.earliest_m < PROMISE.soft_m + 32.0 * PROMISE.dt
    seen = proof.random_search(PROMISE, 2000).earliest_m  # what errors at their edge cost
    assert outcome.earliest_m < seen < 30.0  # an emergency by these errors alone, which is taken to go on


@pytest.mark.parametrize("name", ["trucksim", "freightliner", "volvo"])
def test_a_steady_leader_that_is_lost_for_three_seconds_causes_mild_braking_at_most(name):
    assumed = truck_limits.known(simulators.load(f"truck:{name}").interface)
    speed = np.arange(5.0, 30.0)
    assert assumed.bridged_s == 3.0 and assumed.bridged_time_gap <= 2.0
    hardest = proof.hardest_braking_when_lost(assumed, speed, assumed.bridged_time_gap, assumed.bridged_s)
    assert (hardest <= assumed.mild_braking + 1e-9).all()
    near = proof.hardest_braking_when_lost(assumed, speed, 1.2, assumed.bridged_s)
    assert near.max() > 2.0


def test_adversarial_search_finds_no_violation_and_finds_a_broken_shield():
    outcome = proof.adversarial_search(PROMISE, population=300, generations=8)
    assert outcome.violations == 0
    assert outcome.least_margin_m < 1.0  # it gets close: the search is worth something

    class Late(Assumptions):
        """A shield that believes in brakes a fifth better than they are."""

        def needed_gap(self, *state):
            return replace(PROMISE, braking=1.2 * PROMISE.braking).needed_gap(*state)

    broken = proof.adversarial_search(Late(), population=300, generations=6)
    assert broken.violations > 0


@pytest.mark.parametrize("engine", [np.nan, np.inf, 1e9, -1e9])
def test_a_policy_that_is_not_a_number_slows_down_and_never_drives(engine):
    shield = Shield(PROMISE, 0.0, 100.0)
    sent_engine, sent_brake = shield.filter(
        column(200.0), column(20.0), column(20.0), column(engine), column(np.nan)
    )
    assert sent_engine[0] == 0.0 and sent_brake[0] > 0 and shield.acted[0]


def test_it_lets_a_safe_command_pass_untouched():
    shield = Shield(PROMISE, 0.0, 100.0)
    sent = shield.filter(column(100.0), column(20.0), column(20.0), column(700.0), column(0.0))
    np.testing.assert_array_equal(np.ravel(sent), [700.0, 0.0])
    assert not shield.acted[0]


def test_before_the_limit_the_engine_is_taken_back_and_not_cut():
    """Half of soft_m before the limit half the engine command is left, and a quarter of the brake is on."""
    shield = Shield(PROMISE, 0.0, 100.0)
    needed = PROMISE.needed_gap(column(20.1), column(19.9), column(0.0), PROMISE.dt)
    gap = needed + PROMISE.gap_error + 0.5 * PROMISE.soft_m
    engine, brake = shield.filter(gap, column(20.0), column(20.0), column(800.0), column(0.0))
    assert engine == pytest.approx(400.0) and brake == pytest.approx(25.0)


def test_at_its_steady_gap_it_is_at_rest():
    for speed in (5.0, 15.0, 28.0):
        for nearer, acts in ((1.4, False), (1.6, True)):
            shield = Shield(PROMISE, 0.0, 100.0)
            gap, faster = shield.steady_gap(column(speed)), column(speed + PROMISE.closing)
            shield.filter(gap - nearer, column(speed), faster, column(800.0), column(0.0))
            assert shield.acted[0] == acts


def test_a_reading_that_is_too_near_by_noise_alone_does_not_brake():
    """2.5 m before the limit, then once 1 m nearer: within `soft_m`, its mean over `soft_s` is not."""
    needed = PROMISE.needed_gap(column(20.1), column(19.9), column(0.0), PROMISE.dt) + PROMISE.gap_error
    shield, sent = Shield(PROMISE, 0.0, 100.0), []
    for room in (2.5, 1.3, 2.5, 1.3, 1.3, 1.3, 1.3, 1.3):
        _, brake = shield.filter(needed + room, column(20.0), column(20.0), column(0.0), column(0.0))
        sent.append(float(brake[0]))
    assert sent[:4] == [0.0] * 4 and 0.0 < sent[-1] < 100.0 * (0.2 / 1.5) ** 2


STEADY = replace(PROMISE, most_short=0.0)  # of a truck that keeps its speed, whatever is asked of it


def gentle(shield: Shield, gap, leader, engine: float = 800.0, brake: float = 0.0) -> tuple[float, float]:
    """What `gentle` makes of commands at 20 m/s, and then the limit is told."""
    shield.see(gap, leader, column(20.0))
    sent = shield.gentle(column(engine), column(brake))
    shield.limit(*sent)
    return float(sent[0][0]), float(sent[1][0])


@pytest.mark.parametrize(
    ("leader", "room", "asked"), [(18.0, 4.5, 0.0), (17.0, 3.0, 0.5), (19.9, 6.0, 0.0), (15.0, 4.5, 1.5)]
)
def test_the_room_before_the_limit_shrinks_no_faster_than_in_yield_s(leader, room, asked):
    """At 20 m/s: (shrinking - (room - soft_m) / yield_s) / (dG/dv) by formula.

    Below `pressed_above` by the engine alone, which is idle while the brakes are pressed.
    """
    shield, speed = Shield(STEADY, 0.0, 100.0), column(leader)
    needed = PROMISE.needed_gap(column(20.1), column(leader - 0.1), column(0.0), PROMISE.dt)
    gap = needed + PROMISE.gap_error + room
    for _ in range(30):
        assert gentle(shield, column(500.0), speed) == (800.0, 0.0)
    for _ in range(10):  # by `jerk` up to what it asks for, while the engine is taken back
        engine, brake = gentle(shield, gap, speed)
    more = PROMISE.needed_gap(column(20.6), column(leader - 0.1), column(0.0), PROMISE.dt) - needed
    wanted = np.clip((20.0 - leader - (room - PROMISE.soft_m) / PROMISE.yield_s) * 0.5 / more, 0.0, 1.5)
    share = np.where(wanted > PROMISE.pressed_above, PROMISE.bite + wanted / PROMISE.brake_gain, 0.0)
    assert brake == pytest.approx(100.0 * share) and (brake > 0) == (asked > 0)
    left = 0.0 if asked else 1.0 - np.minimum(wanted / PROMISE.mild_braking, 1.0)
    assert engine == pytest.approx(800.0 * left)


def test_behind_a_leader_that_brakes_it_gives_way_earlier_and_unseen_as_if_that_went_on():
    def asked(braking):
        shield, nan = Shield(STEADY, 0.0, 100.0), column(np.nan)
        gap = PROMISE.needed_gap(column(20.1), column(15.9), column(0.0), PROMISE.dt) + 5.0
        for k in range(20):
            commands = gentle(shield, gap, column(16.0 + 0.1 * braking * (19 - k)))
        unseen = [gentle(shield, nan, nan)[1] for _ in range(40)]
        goes_on = round(GOES_ON_S / PROMISE.dt)
        assert min(unseen[: goes_on - 1]) >= commands[1]
        most = 100.0 * PROMISE.share_of(PROMISE.yielding)
        assert max(unseen[goes_on + 10 :]) <= most < max(unseen) + (braking == 0.0) * most
        return commands[1]

    assert asked(2.0) > asked(0.0) > 0.0


@pytest.mark.parametrize(("leader", "gap", "most"), [(20.0, 200.0, 1.5), (0.0, 75.0, 4.33)])
def test_a_policy_that_brakes_without_need_is_held_to_yielding_and_jerk(leader, gap, most):
    """Behind a standing object 75 m ahead as hard as 1.3 times what stops there; else by 1.5 m/s^2."""
    shield = Shield(STEADY, 0.0, 100.0)
    brakes = []
    for _ in range(40):
        brakes.append(gentle(shield, column(gap), column(leader), brake=100.0)[1] / 100.0)
        shield.brakes.sent(column(0.0))  # a truck that keeps its speed would have no brakes
    pulls = (np.array(brakes) - PROMISE.bite) * PROMISE.brake_gain
    assert np.diff(pulls).max() <= PROMISE.jerk * PROMISE.dt + 1e-9
    assert pulls[-1] == pytest.approx(most, abs=0.1)


def slowing(assumed: Assumptions, descent: float, reported: float = np.nan) -> float:
    """Mean deceleration (m/s^2) of 2 s behind a leader that is slower by 3 m/s."""
    shield, speeds = Shield(assumed, 0.0, 100.0), [20.0]
    for _ in range(60):
        own, leader = column(speeds[-1]), column(speeds[-1] - 3.0)
        needed = assumed.needed_gap(own + 0.1, leader - 0.1, column(0.0), assumed.dt)
        shield.see(needed + assumed.gap_error + 3.0, leader, own)
        commands = shield.gentle(column(800.0), column(0.0), reported)
        share = shield.limit(*commands)[1][0] / 100.0
        pull = max(share - assumed.bite, 0.0) * assumed.brake_gain - ROUNDED_GRAVITY * descent
        speeds.append(speeds[-1] - assumed.dt * pull)
    return (speeds[40] - speeds[60]) / 2.0


def test_on_a_descent_it_brakes_as_on_the_level_whether_or_not_the_slope_is_reported():
    level, descent = slowing(PROMISE, 0.0), 0.05
    assert slowing(PROMISE, descent) == pytest.approx(level, abs=0.2)
    assert slowing(STEADY, descent, -descent) == pytest.approx(level, abs=0.06)
    assert slowing(STEADY, descent) < level - 0.4


def test_every_object_is_stopped_behind_and_one_that_hides_another_counts_alone():
    """The leader at 20 m/s drives on; a standing car behind it is 70 m ahead."""
    shield, nan = Shield(PROMISE, 0.0, 100.0), np.nan
    gap, leader = np.array([[50.0], [60.0]]), np.array([[20.0], [0.0]])
    shield.see(gap + 20.0, leader, column(20.0))
    shield.limit(column(500.0), column(0.0))
    for counts, brake in (([[True], [False]], 0.0), ([[True], [True]], 100.0)):
        shield.see(gap, leader, column(20.0), counts=np.array(counts))
        assert shield.limit(column(500.0), column(0.0))[1][0] == brake
    # What is known of an object follows it to its new place.
    swapped = np.array([[1], [0]])
    shield.see(np.full((2, 1), nan), np.full((2, 1), nan), column(20.0), came_from=swapped)
    assert shield._ahead is not None and shield._ahead.gap[:, 0] == pytest.approx([57.7, 49.7], abs=0.2)


def test_brakes_that_keep_a_deceleration_heat_more_downhill():
    """By `descent_share` for each unit of a measured slope and its error; the steepest if unknown."""
    assumed, sent = replace(PROMISE, descent_share=1.5), {}
    for grade, brake in ((np.nan, 10.0), (-0.02, 10.0), (0.02, 10.0), (-0.02, 0.0)):
        shield = Shield(assumed, 0.0, 100.0)
        shield.filter(column(500.0), column(20.0), column(20.0), column(0.0), column(brake), column(grade))
        sent[str(grade), brake] = float(shield._truck.heat[0]) / (0.1 * 7.5 * 20.1)
    assert sent["nan", 10.0] == pytest.approx(0.1 + 1.5 * 0.03)
    assert sent["-0.02", 10.0] == pytest.approx(0.1 + 1.5 * 0.03)
    assert sent["0.02", 10.0] == pytest.approx(0.1 - 1.5 * 0.01)
    assert sent["-0.02", 0.0] == 0.0


def test_it_acts_where_it_adds_a_brake_alone_and_not_where_the_policy_brakes_as_hard():
    """The engine command is its least already, so that the brake alone says whether the shield acts."""
    shield = Shield(PROMISE, 0.0, 100.0)
    shield.filter(column(90.0), column(10.0), column(20.0), column(0.0), column(0.0))
    _, brake = shield.filter(column(20.0), column(10.0), column(20.0), column(0.0), column(0.0))
    assert brake[0] == 100.0 and shield.acted[0]
    shield.filter(column(20.0), column(10.0), column(20.0), column(0.0), column(100.0))
    assert not shield.acted[0]


@pytest.mark.parametrize(("leader", "gap"), [(20.0, 20.0), (10.0, 30.0), (5.0, 30.0), (0.0, 60.0)])
def test_what_appears_nearer_than_the_limit_is_braked_for_by_what_it_needs(leader, gap):
    """`harder` times what stops behind it if it brakes by 0.1 m/s^2, and `yielding` at least.

    What was farther once is braked for fully.
    """
    way = gap - PROMISE.gap_error - PROMISE.d_safety - 20.1 * PROMISE.response_s
    way += max(leader - 0.1, 0.0) ** 2 / (2 * 0.1)
    pull = max(PROMISE.harder * 20.1**2 / 2 / way, PROMISE.yielding)
    assert PROMISE.needed_gap(column(20.1), column(leader - 0.1), column(0.0), 0.1)[0] > gap
    shield, seen = Shield(PROMISE, 0.0, 100.0), (column(gap), column(leader), column(20.0))
    engine, brake = shield.filter(*seen, column(500.0), column(0.0))
    assert brake[0] == pytest.approx(100.0 * PROMISE.share_of(pull), rel=0.01)
    assert engine[0] == 0.0 and shield.braking[0]
    shield.filter(column(gap + 80.0), *seen[1:], column(500.0), column(0.0))
    assert shield.filter(*seen, column(500.0), column(0.0))[1][0] == 100.0


def test_it_brakes_when_nothing_was_ever_seen():
    shield, nan = Shield(PROMISE, 0.0, 100.0), column(np.nan)
    assert shield.filter(nan, nan, column(20.0), column(500.0), column(0.0))[1][0] == 100.0


def lost(leader: float, gap: float, steps: int, *, braked_s: float = 0.0, braking: float = 0.0) -> np.ndarray:
    """Brake commands (steps,) at 20 m/s once a leader is lost that was seen at a constant speed for 2 s, then
    for `braked_s` braking; the gap is the one at the loss."""
    shield, nan = Shield(PROMISE, 0.0, 100.0), column(np.nan)
    for k in range(-20, round(braked_s / 0.1) + 1):
        now = leader - 0.1 * max(k, 0) * braking
        shield.filter(column(gap), column(now), column(20.0), column(500.0), column(0.0))
    sent = [shield.filter(nan, nan, column(20.0), column(500.0), column(0.0)) for _ in range(steps)]
    return np.array([brake[0] for _, brake in sent])


def test_a_leader_that_is_lost_far_off_or_pulling_away_is_lost_without_braking():
    assert (lost(leader=20.0, gap=80.0, steps=30) == 0.0).all()
    assert (lost(leader=26.0, gap=55.0, steps=30) == 0.0).all()


def test_a_leader_that_is_lost_near_is_braked_for_mildly():
    """At 45 m it has 9 m left: less than ease_m, and more than what it loses while it is taken to brake."""
    brake = lost(leader=20.0, gap=45.0, steps=30)
    mild = 100.0 * PROMISE.mild_braking / PROMISE.strongest_braking
    assert 0.0 < brake[0] < mild and (np.diff(brake[:4]) > 0).all()
    assert brake.max() == mild


def test_a_leader_that_is_missed_once_does_not_cut_the_engine():
    """By dt / ease_s at each missing reading less engine, and as slowly back; 9 m before the limit."""
    shield, nan = Shield(PROMISE, 0.0, 100.0), column(np.nan)
    seen, sent = (column(45.0), column(20.0)), []
    for missing in (0, 0, 1, 0, 0, *[1] * 6, *[0] * 6):
        gap, speed = (nan, nan) if missing else seen
        sent.append(float(shield.filter(gap, speed, column(20.0), column(500.0), column(0.0))[0][0]))
    step = 500.0 * PROMISE.dt / PROMISE.ease_s
    assert sent[:5] == pytest.approx([500.0, 500.0, 500.0 - step, 500.0, 500.0])
    assert sent[9] == sent[10] == pytest.approx(0.0, abs=1e-9)
    assert sent[11:] == pytest.approx([step, 2 * step, 3 * step, 4 * step, 500.0, 500.0])


def test_a_leader_that_was_braking_or_standing_when_it_was_lost_is_braked_for_at_once():
    far = 70.0
    assert (lost(leader=20.0, gap=far, steps=10) == 0.0).all()
    braking = lost(leader=20.0, gap=far, steps=20, braked_s=0.5, braking=6.0)
    assert np.flatnonzero(braking == 100.0)[0] < 15
    assert (lost(leader=0.0, gap=far, steps=10)[:1] == 100.0).all()


def test_braking_seen_is_that_of_the_leader():
    """A filtered derivative: 1 - exp(-t / track_s) of a braking that began t ago, plus what errors hide."""
    shield = Shield(PROMISE, 0.0, 100.0)
    for k in range(31):
        shield.filter(column(90.0), column(20.0 - 0.2 * k), column(20.0), column(0.0), column(0.0))
    hidden = 2 * PROMISE.speed_error / PROMISE.track_s
    assert shield._ahead.braking == pytest.approx(2.0 + hidden, abs=0.01)


def test_a_leader_that_comes_back_slower_has_braked_over_the_time_it_was_not_seen():
    shield, nan = Shield(PROMISE, 0.0, 100.0), column(np.nan)
    for speed in (*[20.0] * 20, *[np.nan] * 10, 18.0):
        gap = nan if np.isnan(speed) else column(90.0)
        shield.filter(gap, column(speed), column(20.0), column(0.0), column(0.0))
    over = PROMISE.track_s + 1.0
    assert shield._ahead.braking == pytest.approx((2.0 + 2 * PROMISE.speed_error) / over)
    assert shield._ahead.unseen_s == 0.0


def test_a_silent_speedometer_lets_the_truck_accelerate_by_what_it_can():
    shield, nan = Shield(PROMISE, 0.0, 100.0), column(np.nan)
    shield.filter(column(300.0), column(20.0), column(20.0), column(0.0), column(0.0))
    shield.filter(column(300.0), column(20.0), nan, column(0.0), column(0.0))
    assert shield._truck.speed == pytest.approx(20.1 + 0.1 * 24.0 / 20.1)


@pytest.mark.parametrize(("brake", "share"), [(25.0, 0.25), (100.0, 1.0)])
def test_the_heat_of_a_step_is_by_formula(brake, share):
    """dt (share k v - cooling heat), docs/cacc_shield.md: at 20.1 m/s, 500 m behind."""
    shield, per_step = Shield(PROMISE, 0.0, 100.0), 0.1 * share * 7.5 * 20.1
    for _ in range(2):
        shield.filter(column(500.0), column(20.0), column(20.0), column(0.0), column(brake))
    assert shield._truck.heat == pytest.approx(
        per_step + per_step - 0.1 * per_step * (3.4e-4 + 1.6e-5 * 20.1)
    )


def test_brakes_stay_hot_where_the_past_is_forgotten_and_are_not_heated_by_what_nobody_obeys():
    shield = Shield(PROMISE, 0.0, 1.0)
    for _ in range(100):
        shield.filter(column(500.0), column(20.0), column(20.0), column(0.0), column(0.5))
    hot = shield._truck.heat[0]
    assert hot == pytest.approx(0.5 * 7.5 * 20.0 * 10.0, rel=0.01)
    for _ in range(100):  # without a leader it would brake fully, and nobody obeys
        shield.filter(column(np.nan), column(np.nan), column(20.0), column(0.5), column(0.0))
        shield.spare()
        shield.forget()
    assert shield.braking[0]
    released = 0.5 * 7.5 * 20.1 * 0.1 * np.exp(-np.arange(1, 101) / 3.0).sum()
    cooled = (1.0 - 0.1 * (3.4e-4 + 1.6e-5 * 20.1)) ** 100
    assert shield._truck.heat[0] == pytest.approx((hot + released) * cooled, rel=1e-3)
    shield.reset()
    shield.forget()
    shield.spare()
    shield.filter(column(100.0), column(20.0), column(20.0), column(0.0), column(0.0))
    assert shield._truck.heat[0] == 0.0


def test_below_their_bite_brakes_are_not_heated_and_they_give_at_most_what_tyres_hold():
    assumed = replace(PROMISE, bite=0.05, brake_gain=14.0)
    heat = assumed.heat_after(column(0.0, 0.0, 0.0), column(0.05, 0.15, 0.9), column(20.0, 20.0, 20.0))
    assert heat == pytest.approx([0.0, 0.1 * 14.0 * 0.1 * 20.0, 0.1 * 7.5 * 20.0])


def test_brakes_that_are_released_still_heat():
    """A brake of 40 % for one step, then none: by exp(-dt / release_s) less in each step."""
    shield, shares = Shield(PROMISE, 0.0, 1.0), 0.4 * np.exp(-np.arange(4) / 3.0)
    for k in range(4):
        shield.filter(column(500.0), column(20.0), column(20.0), column(0.0), column(0.4 * (k == 0)))
    assert shield._truck.heat[0] == pytest.approx(0.1 * 7.5 * 20.1 * shares.sum(), rel=1e-3)


def test_hot_brakes_need_more_room():
    shield = Shield(PROMISE, 0.0, 100.0)
    for _ in range(600):
        shield.filter(column(500.0), column(20.0), column(20.0), column(0.0), column(20.0))
    cold = PROMISE.needed_gap(column(20.0), column(20.0), column(0.0), 0.1)
    assert PROMISE.needed_gap(column(20.0), column(20.0), shield._truck.heat, 0.1) > cold + 5.0


@pytest.fixture(scope="module")
def truck():
    return simulators.load("truck:trucksim")


def test_measured_limits_hold_on_the_truck_and_are_plausible(truck):
    assumed = truck_limits.measure(truck)
    assert 3.5 < assumed.braking < 7.0 and 0.1 <= assumed.response_s <= 1.0
    weak = truck_limits.measure(truck.with_parameters({"brake_gain": 0.5}))
    assert weak.braking < 0.6 * assumed.braking


@pytest.mark.parametrize("name", ["trucksim", "freightliner", "volvo"])
def test_the_mild_brake_slows_the_truck_down_by_mild_braking(name):
    truck = simulators.load(f"truck:{name}")
    assumed = truck_limits.known(truck.interface)
    scale, speed = ActionScale.of(truck), np.arange(10.0, 29.0, 3.0)
    state = truck.reset(np.column_stack([0.0 * speed, speed, 0.0 * speed]))
    u = np.tile([scale.engine_low, assumed.mild_brake * scale.brake_high], (len(speed), 1))
    rates = []
    for _ in range(30):
        state, y = truck.step(state, u, np.zeros((len(speed), len(truck.interface.w))))
        rates.append(y[:, 0])
    slowing = -np.mean(rates[10:], axis=0)
    assert (slowing > 0.4).all() and (slowing < assumed.mild_braking + 0.05).all()


def test_no_crash_behind_a_full_stop_whatever_the_policy(truck):
    class Wild:
        interface, dt = truck.interface, truck.dt

        def reset(self):
            self.rng = np.random.default_rng(0)

        def act(self, observation):
            n = len(np.atleast_1d(observation["gap"]))
            engine = self.rng.uniform(0, 3000, n)
            return np.where(self.rng.random(n) < 0.1, np.nan, engine), np.zeros(n)

    driver = guard(Wild(), truck_limits.measure(truck))
    driver.fallback = Wild()  # nothing sensible behind it
    scene = hard_scenes.stop(np.random.default_rng(1), 200, 400, truck.dt)
    assert not roll_out(truck, driver, scene)["crash"].any()
    always = [np.full(200, 1500.0), np.zeros(200)]
    Wild.act = lambda self, observation: always
    assert roll_out(truck, Wild(), scene)["crash"].any()


def test_the_shield_costs_a_good_policy_nothing_in_the_papers_scenes(truck):
    driver = guard(baseline("cacc", truck.interface, PedalMap.calibrate(truck)), truck_limits.measure(truck))
    trace = roll_out(truck, driver, scenes.paper(np.random.default_rng(0), 100, 400, truck.dt))
    assert trace["acted"].mean() < 1e-3


@pytest.mark.parametrize("name", ["trucksim", "freightliner", "volvo"])
def test_the_kept_promises_are_not_better_than_the_trucks(name):
    truck = simulators.load(f"truck:{name}")
    kept, measured = truck_limits.known(truck.interface), truck_limits.measure(truck, reserve=0.0)
    v = np.arange(4.0, 30.0)
    cold = np.zeros(len(v))
    assert (kept.needed_gap(v, v, cold, 0.1) >= measured.needed_gap(v, v, cold, 0.1)).all()


@pytest.mark.parametrize("name", ["trucksim", "freightliner", "volvo"])
def test_the_heat_is_bounded_and_the_bound_ends_no_ordinary_following(name):
    """Against the truck's own brake temperature: 2 min behind sines of 0.2 and 0.5 m/s^2, a noisy radar."""
    truck = simulators.load(f"truck:{name}")
    driver = load_controller("baseline:acc", truck.interface)
    values = truck.parameters()
    per_kelvin = values["brake_heat_capacity"] / values["mass"]

    def leader(k):
        return column(18.0, 20.0) + column(2.0, 1.2) * np.sin(0.2 * np.pi * k / column(60.0, 15.0))

    rng, y = np.random.default_rng(3), np.zeros((2, len(truck.interface.y)))
    y[:, SPEED] = leader(0)
    state, gap, w = truck.reset(y), 2.0 * leader(0), np.zeros((2, len(truck.interface.w)))
    for k in range(1200):
        own, (range_noise, speed_noise) = y[:, SPEED], rng.normal(size=(2, 2))
        seen = {"gap": gap + 0.1 * range_noise, "leader_speed": leader(k) + 0.05 * speed_noise, "speed": own}
        engine, brake = driver.act({**seen, "target_time_gap": 2.0, "grade": 0.0})
        assert not driver.acted.any()
        state, y = truck.step(state, np.column_stack([engine, brake]), w)
        gap = gap + 0.05 * (leader(k) + leader(k + 1) - own - y[:, SPEED])
        warmer = truck.inside(state)["brake_temperature"] - values["ambient_temperature"]
        assert (driver.shield._truck.heat >= warmer * per_kelvin).all()
        assert (y[:, 0] > -1.0).all()


def test_a_truck_without_brakes_gets_no_promise():
    class Coaster:
        interface = TruckInterface("x", brake_unit=None)
        dt = 0.1

    with pytest.raises(InputError, match="no brake"):
        truck_limits.measure(Coaster())


def test_stored_limits_are_of_these_parameters_and_slopes_alone(truck):
    parameters = truck.parameters()
    stored = truck_limits.known(truck.interface, parameters)
    assert stored is not None and stored == truck_limits.known(truck.interface)
    assert truck_limits.known(truck.interface, {**parameters, "mass": parameters["mass"] * 1.01}) is None
    assert truck_limits.known(truck.interface, parameters, -0.03) is not None
    assert truck_limits.known(truck.interface, parameters, -0.031) is None
    assert truck_limits.digest({"b": 2.0, "a": 1.0}) == truck_limits.digest({"a": 1.0 + 1e-12, "b": 2.0})
