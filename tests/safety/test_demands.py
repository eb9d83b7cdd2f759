"""What other controllers may demand of the truck: inside of it control stays, outside the core hands back."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from itertools import accumulate

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from truck_bridge.safety import State, Timing
from truck_bridge.safety.demands import Demands
from truck_bridge.safety.tables import Allowed

BRAKE, TRANSMISSION = 0x0C00000B, 0x0C000003  # TSC1 to the engine
LEAST, MOST, LONGEST, STALL = 1 / 64, 1 / 16, 4.0, 0.125  # s, exact in binary
ALLOWED = (
    Allowed("brake to engine", BRAKE & 0x03FF_FFFF, (3,), LONGEST, (LEAST, MOST)),
    Allowed("transmission to engine", TRANSMISSION & 0x03FF_FFFF, (1, 2), LONGEST, (LEAST, MOST)),
)
FORGED = bytes.fromhex(
    "C97070DDFFF0FFFF"
)  # a recorded forgery: engine speed 3598 rpm at the highest priority


def tsc1(mode):
    """Every bit but the control mode set: none of them may matter."""
    return bytes([0xFC | mode]) + b"\xff" * 7


@pytest.fixture
def vehicle():
    return "trucksim"  # what it allows is replaced by the tables above


@pytest.fixture
def demands(bench):
    return Demands(table_of(bench), Counter())


def table_of(bench):
    return replace(bench.table, allowed=ALLOWED, heard=(), timing=Timing(stall=STALL))


def hold(demands, until, start=0.0, mode=3, can_id=BRAKE, step=MOST):
    """One demand, repeated. Returns what was said of it, in order."""
    times = [start + k * step for k in range(int((until - start) / step) + 1)]
    return [demands.take(can_id, tsc1(mode), now) for now in times]


@pytest.mark.parametrize(("can_id", "modes"), [(BRAKE, {0, 3}), (TRANSMISSION, {0, 1, 2})])
def test_only_the_modes_of_the_file_may_be_demanded(demands, can_id, modes):
    name = "brake" if can_id == BRAKE else "transmission"
    for mode in range(4):
        said = demands.take(can_id, tsc1(mode), float(mode))
        assert said == ("" if mode in modes else f"{name} to engine: control mode {mode}")


def test_the_priority_and_the_direction_of_a_frame_decide_nothing(demands):
    assert demands.take(BRAKE ^ 7 << 26, tsc1(1), 1.0) == "brake to engine: control mode 1"
    assert (
        demands.take(0x0C000B00, tsc1(1), 1.0) == ""
    )  # what the engine demands of the brake is no axis of ours


@pytest.mark.parametrize("source", [0x77, 0x28, 0x0F])
@pytest.mark.parametrize("axis", ["engine", "retarder", "brake"])
def test_who_is_not_in_the_file_may_demand_nothing(bench, demands, axis, source):
    stranger = bench.axis(axis).can_id & ~0xFF | source
    assert demands.take(stranger, tsc1(0), 1.0) == "another node commands the truck"


def test_leave_for_one_axis_is_none_for_another(demands):
    assert demands.take(0x0C000F0B, tsc1(3), 1.0) == "another node commands the truck"


@pytest.mark.parametrize("size", [0, 7, 9])
def test_a_frame_of_another_length_is_refused(demands, size):
    assert demands.take(BRAKE, (tsc1(3) * 2)[:size], 1.0) == "brake to engine: length"


@pytest.mark.parametrize(("can_id", "mode"), [(BRAKE, 3), (TRANSMISSION, 1)])
def test_a_demand_may_last_as_long_as_the_file_says(demands, can_id, mode):
    assert set(hold(demands, LONGEST, can_id=can_id, mode=mode)) == {""}
    assert demands.take(can_id, tsc1(mode), LONGEST + LEAST).endswith("to engine: too long")
    assert demands.take(can_id, tsc1(0), LONGEST + 2 * LEAST) == ""


def test_a_short_release_does_not_end_a_demand_and_a_long_one_does(demands):
    """A forger could hand back for one message, and demand again."""
    grace = MOST + STALL
    assert set(hold(demands, LONGEST)) == {""}
    assert demands.take(BRAKE, tsc1(0), LONGEST + LEAST) == ""
    assert demands.take(BRAKE, tsc1(3), LONGEST + grace) == "brake to engine: too long"
    assert demands.take(BRAKE, tsc1(0), LONGEST + grace + LEAST) == ""
    assert demands.take(BRAKE, tsc1(3), LONGEST + 2 * grace + LEAST) == ""


def test_two_controllers_demand_each_for_itself(demands):
    assert set(hold(demands, LONGEST)) == {""}
    assert demands.take(TRANSMISSION, tsc1(1), LONGEST) == ""
    assert demands.take(TRANSMISSION, tsc1(1), LONGEST + LEAST) == ""


def test_messages_that_waited_come_at_once_and_more_are_too_often(demands):
    """The pause that the core survives, 0.125 s, holds eight messages and the one that is due."""
    said = [demands.take(BRAKE, tsc1(3), 10.0) for _ in range(11)]
    assert said == [""] * 9 + ["brake to engine: too often"] * 2
    assert demands.take(BRAKE, tsc1(3), 10.0 + LEAST) == ""  # a flood does not silence who keeps time


def test_a_second_sender_is_told_by_its_releases_too(demands):
    said = [demands.take(BRAKE, tsc1(3 * (k % 2)), 10.0 + k * LEAST / 2) for k in range(40)]
    assert said.index("brake to engine: too often") == 17
    assert said[:17] == [""] * 17


def test_the_least_period_itself_goes_on_for_ever(demands):
    assert set(hold(demands, LONGEST, step=LEAST)) == {""}


def test_a_demand_is_repeated_in_time_or_handed_back(demands):
    assert demands.broken_off(5.0) == []
    demands.take(BRAKE, tsc1(3), 5.0)
    assert demands.broken_off(5.0 + MOST + STALL) == []
    assert demands.broken_off(5.0 + MOST + STALL + LEAST) == ["brake to engine: not repeated in time"]
    assert demands.broken_off(6.0) == []  # said once
    demands.take(BRAKE, tsc1(3), 7.0)
    demands.take(BRAKE, tsc1(0), 7.0 + MOST)
    assert demands.broken_off(9.0) == []


# the core that acts on it


@pytest.fixture
def core(bench):
    """Engaged, with nothing to hear but demands."""
    return engaged(bench)


def engaged(bench):
    safety = type(bench.safety)(table_of(bench))
    safety.arm(100.0)
    safety.state = State.ENGAGED
    ask(safety, 100.0)
    return safety


def ask(safety, now):
    """A controller that coasts, and the core's turn."""
    safety.command({axis.name: 0.0 for axis in safety.table.axes}, True, now)
    safety.tick(now)


def play(safety, frames, last=0.0):
    """Frames of the brake controller at times after 100 s, the core asked at least every 50 ms."""
    clock = 100.0
    for time, mode in [*frames, (last, None)]:
        while clock + 0.05 < 100.0 + time:
            clock += 0.05
            ask(safety, clock)
        clock = max(clock, 100.0 + time)
        if mode is not None:
            safety.rx_hook(BRAKE, tsc1(mode), clock)
        ask(safety, clock)
    return safety


def test_a_forged_demand_of_a_known_address_ends_control_at_once_and_is_counted(core):
    core.rx_hook(BRAKE, FORGED, 100.0)
    assert core.state is State.FADING
    assert core.losses == {"brake to engine: control mode 1": 1}
    core.rx_hook(BRAKE, FORGED, 100.01)
    assert core.refusals == {"brake to engine: control mode 1": 2}


def test_a_demand_broken_off_ends_control_in_the_next_cycle(core):
    play(core, [(0.0, 3)], last=0.25)
    assert core.losses == {"brake to engine: not repeated in time": 1}


def test_nobody_engages_within_a_second_of_a_refused_demand(bench):
    bench.arm()
    bench.now = 100.0
    bench.safety.rx_hook(0x0C000077, FORGED, 100.0)
    for now, refused in ((100.0, True), (101.0, True), (101.001, False)):
        told = "another controller demands what it may not" in bench.safety.obstacles(now, True)
        assert told == refused


def test_a_clock_that_goes_back_forgets_demands(core):
    play(core, [(0.0, 3)])
    core.tick(50.0)
    core.rx_hook(BRAKE, tsc1(3), 50.0)
    core.tick(50.0)
    assert core.refusals == {}


# and the promise, for every demand

GAPS = st.floats(LEAST, MOST)
LATE = st.sampled_from([0.0, 0.0, 0.0, 0.09])  # s that a message waits for a late poll


@st.composite
def inside(draw):
    """(time, mode) of demands inside of the file, each handed back, some messages heard late."""
    frames, now = [], 0.0
    for _ in range(draw(st.integers(1, 3))):
        step, end = draw(GAPS), now + draw(st.floats(0.0, LONGEST - STALL))
        while now < end:
            frames.append((now, 3))
            now += step
        frames.append((now, 0))
        now += MOST + 2 * STALL + draw(st.floats(0.0, 0.5))
    late = [draw(LATE) for _ in range(4)]
    times = accumulate((time + late[k % 4] for k, (time, _) in enumerate(frames)), max)
    return [(time, mode) for time, (_, mode) in zip(times, frames, strict=True)]


def control_stays(bench, frames):
    """Whether control was still on a second after the last frame; only demands may end it here."""
    safety = play(engaged(bench), frames, frames[-1][0] + 1.0)
    assert all(reason.startswith("brake to engine") for reason in safety.losses)
    return safety.state is State.ENGAGED


PROPERTY = settings(max_examples=30, deadline=None, derandomize=True)


def test_every_demand_inside_leaves_control_on(bench):
    @PROPERTY
    @given(inside())
    def check(frames):
        assert control_stays(bench, frames)

    check()


def wrong_mode(draw, frames):
    place = draw(st.integers(0, len(frames) - 1))
    return [*frames[:place], (frames[place][0], draw(st.sampled_from([1, 2]))), *frames[place + 1 :]]


def held_on(draw, frames):
    """The last release is forged away: the demand goes on beyond its longest time."""
    start, step = frames[-1][0], draw(GAPS)
    return [*frames[:-1], *((start + k * step, 3) for k in range(int((LONGEST + 1) / step)))]


def broken(draw, frames):
    return [*frames[:-1], (frames[-1][0], 3)]


def flood(draw, frames):
    """A second sender beside the true one: twice as often as the least period, for as long as it takes."""
    mode = draw(st.sampled_from([0, 3]))
    start, step = frames[-1][0], draw(st.floats(0.001, LEAST * 0.75))
    return [*frames, *((start + k * step, mode * (k % 2)) for k in range(200))]


@pytest.mark.parametrize("forge", [wrong_mode, held_on, broken, flood])
def test_no_demand_outside_leaves_control_on(bench, forge):
    @PROPERTY
    @given(inside(), st.data())
    def check(frames, data):
        forged = forge(data.draw, frames)
        assert not control_stays(bench, forged)

    check()
