"""What the core accepts of what it hears."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace

import pytest

from truck_bridge.safety import Driveline, Field, Followed, Heard, Measured, Obeyed
from truck_bridge.safety.checks import checksum_ok, counter_ok
from truck_bridge.safety.hearing import Hearing

BYTE = Field(0, 8, 1.0, 0.0, 250)
WORD = Field(16, 16, 0.125, -10.0, 64255)
KEY = 0xF00400
ID = 0x0CF00400


def table(bench, heard, **changes):
    return replace(bench.table, heard=heard, **changes)


def hearing(bench, check="none", **changes):
    message = Heard("M", KEY, 0.1, 0.3, (Measured("a", BYTE, 5, 20), Measured("b", WORD, -10, 100)), check)
    refusals: Counter[str] = Counter()
    return Hearing(table(bench, (message,), **changes), refusals), refusals


def frame(a=10, b=80, last=0xFF):
    return bytes([a, 0xFF]) + b.to_bytes(2, "little") + b"\xff\xff\xff" + bytes([last])


@pytest.fixture
def vehicle():
    return "trucksim"  # tables of its own take the place of the vehicle's messages


def test_values_are_scaled_and_kept(bench):
    ears, refusals = hearing(bench)
    assert ears.take(ID, frame(), 1.0) == ""
    assert (ears.value("a"), ears.value("b")) == (10.0, 0.0)
    assert math.isnan(ears.value("c"))
    assert refusals == {}


@pytest.mark.parametrize("can_id", [ID ^ 1, ID ^ 1 << 8, ID ^ 1 << 24, ID ^ 1 << 25])
def test_another_message_or_source_is_not_heard(bench, can_id):
    ears, _ = hearing(bench)
    ears.take(can_id, frame(), 1.0)
    assert ears.stale(1.0) == ["M"]


def test_the_priority_does_not_matter(bench):
    ears, _ = hearing(bench)
    ears.take(ID ^ 7 << 26, frame(), 1.0)
    assert ears.stale(1.0) == []


@pytest.mark.parametrize(
    ("a", "good"),
    [(4, False), (5, True), (20, True), (21, False), (251, False), (0xFE, False), (0xFF, False)],
)
def test_range_is_inclusive_and_what_is_invalid_refreshes_nothing(bench, a, good):
    ears, refusals = hearing(bench)
    ears.take(ID, frame(), 1.0)
    ears.take(ID, frame(a=a), 1.2)
    assert ears.value("a") == (a if good else 10.0)
    assert refusals == ({} if good else {"a invalid": 1})
    assert ears.stale(1.31) == ([] if good else ["M"])


@pytest.mark.parametrize("raw", [64256, 0xFE00, 0xFEFF, 0xFF00, 0xFFFF])
def test_two_byte_error_and_not_available_are_no_numbers(bench, raw):
    ears, refusals = hearing(bench)
    ears.take(ID, frame(b=raw), 1.0)
    assert math.isnan(ears.value("b"))
    assert refusals == {"b invalid": 1}


@pytest.mark.parametrize(("age", "stale"), [(0.0, []), (0.3, []), (0.3001, ["M"])])
def test_a_message_is_fresh_up_to_its_time_out(bench, age, stale):
    ears, _ = hearing(bench)
    assert ears.stale(0.0) == ["M"]
    ears.take(ID, frame(), 0.0)
    assert ears.stale(age) == stale


@pytest.mark.parametrize("size", [0, 7, 9])
def test_a_frame_of_another_length_is_refused(bench, size):
    ears, refusals = hearing(bench)
    ears.take(ID, (frame() * 2)[:size], 1.0)
    assert refusals == {"M length": 1}
    assert ears.stale(1.0) == ["M"]


def sealed(count, kind="xbr"):
    payload = frame()[:7]
    total = sum(payload) + count + sum(ID.to_bytes(4, "big"))
    fold = ((total >> 4) + total) % 16 if kind == "xbr" else (((total >> 6) & 3) + (total >> 3) + total) % 8
    return payload + bytes([count | fold << 4])


def test_a_wrong_checksum_is_refused_and_the_counter_forgives_one_gap(bench):
    ears, refusals = hearing(bench, check="xbr")
    assert ears.take(ID, sealed(3), 1.0) == ""
    bad = bytearray(sealed(4))
    bad[0] ^= 1
    ears.take(ID, bytes(bad), 1.1)
    assert refusals == {"M checksum": 1}
    ears.take(ID, sealed(4), 1.2)
    ears.take(ID, sealed(4), 1.3)
    assert refusals == {"M checksum": 1, "M counter": 1}
    assert ears.stale(1.45) == []
    ears.take(ID, sealed(9), 1.4)
    ears.take(ID, sealed(10), 1.5)
    assert refusals == {"M checksum": 1, "M counter": 2}
    assert ears.stale(1.75) == []


@pytest.mark.parametrize("kind", ["tsc1", "xbr"])
def test_all_counters_roll_over(bench, kind):
    ears, refusals = hearing(bench, check=kind)
    modulo = 8 if kind == "tsc1" else 16
    for step in range(2 * modulo + 2):
        ears.take(ID, sealed(step % modulo, kind), 1.0 + step)
    assert refusals == {}


def test_a_message_at_1_75_times_its_rate_has_a_second_sender(bench):
    ears, refusals = hearing(bench)
    for k in range(17):
        assert ears.take(ID, frame(), 1.0 + 0.05 * k) == ""
    assert ears.take(ID, frame(), 1.86) == "M too often"
    assert refusals == {"M too often": 1}
    assert ears.take(ID, frame(), 1.99) == "M too often"
    assert ears.take(ID, frame(), 2.0) == ""  # a new second


@pytest.mark.parametrize(("gap", "doubted"), [(2.0, False), (-2.0, False), (2.125, True), (-2.125, True)])
def test_two_wheel_speeds(bench, gap, doubted):
    speeds = (Measured("speed", BYTE, 0, 250), Measured("second_speed", WORD, -10, 300))
    message = Heard("M", KEY, 0.1, 0.3, speeds)
    ears = Hearing(table(bench, (message,), driveline=None), Counter())
    ears.take(ID, frame(a=20, b=round((20 + gap + 10) / 0.125)), 1.0)
    assert list(ears.doubts(1.0, {})) == (["two wheel speeds"] if doubted else [])


def test_one_wheel_speed_alone_is_plausible(bench):
    message = Heard("M", KEY, 0.1, 0.3, (Measured("speed", BYTE, 0, 250),))
    ears = Hearing(table(bench, (message,)), Counter())
    ears.take(ID, frame(a=20), 1.0)
    assert ears.doubts(1.0, {}) == {}


NAMES = ("speed", "gear_ratio", "engine_speed", "driveline", "shifting", "lockup")
GOOD = {"speed": 20, "gear_ratio": 2, "engine_speed": 200, "driveline": 1, "shifting": 0, "lockup": 1}


def driving(bench, **values):
    """Ears that heard these bytes; line of 0.2 m/rad: 200 rad/s in ratio 2 is 20 m/s."""
    signals = tuple(Measured(n, Field(8 * k, 8, 1.0, 0.0, 250), 0, 250) for k, n in enumerate(NAMES))
    message = Heard("M", KEY, 0.1, 0.3, signals)
    line = Driveline(0.2, 0.125, 3.0, 0.5)
    ears = Hearing(table(bench, (message,), driveline=line, obeyed=(), followed=()), Counter())
    ears.take(ID, bytes_of(**values), 1.0)
    return ears


def bytes_of(**values):
    return bytes((GOOD | values)[name] for name in NAMES) + b"\xff\xff"


@pytest.mark.parametrize(
    ("values", "doubt"),
    [
        ({}, False),
        # the greater times 1/8, and 0.5 m/s
        ({"speed": 17, "engine_speed": 200}, False),  # 20 m/s by the engine: 3.0 exactly
        ({"speed": 16, "engine_speed": 200}, True),
        ({"speed": 20, "engine_speed": 170}, False),
        ({"speed": 20, "engine_speed": 169}, True),
        ({"gear_ratio": 1}, True),
        ({"gear_ratio": 0}, False),  # neutral
        ({"speed": 3, "engine_speed": 0}, False),  # too slow to judge
        ({"speed": 4, "engine_speed": 0}, True),
        ({"speed": 0, "engine_speed": 30}, False),
        ({"speed": 0, "engine_speed": 31}, True),  # both wheels stand, the engine drives
        ({"engine_speed": 0, "driveline": 0}, False),
        ({"engine_speed": 0, "shifting": 1}, False),
        ({"engine_speed": 0, "lockup": 0}, False),
        ({"engine_speed": 0}, True),
    ],
)
def test_wheel_and_engine_speed(bench, values, doubt):
    assert list(driving(bench, **values).doubts(1.0, {})) == (["wheel and engine speed"] if doubt else [])


def test_a_truck_without_lock_up_signal_counts_as_locked(bench):
    names = NAMES[:5]
    signals = tuple(Measured(n, Field(8 * k, 8, 1.0, 0.0, 250), 0, 250) for k, n in enumerate(names))
    ears = Hearing(
        table(bench, (Heard("M", KEY, 0.1, 0.3, signals),), driveline=Driveline(0.2, 0.2, 3.0)), Counter()
    )
    ears.take(ID, bytes([20, 2, 100, 1, 0, 0xFF, 0xFF, 0xFF]), 1.0)
    assert list(ears.doubts(1.0, {})) == ["wheel and engine speed"]


def test_a_truck_whose_driveline_says_nothing_is_not_judged(bench):
    ears = Hearing(table(bench, (), driveline=Driveline(0.2, 0.2, 3.0)), Counter())
    assert ears.doubts(1.0, {}) == {}


def test_doubt_must_last_half_a_second_and_starts_anew(bench):
    ears = driving(bench, engine_speed=100)

    def lasting(now):
        return ears.lasting(ears.doubts(now, {}), now)

    assert lasting(2.0) == []
    assert lasting(2.499) == []
    assert lasting(2.5) == ["wheel and engine speed"]
    ears.take(ID, bytes([20, 2, 200, 1, 0, 1, 0xFF, 0xFF]), 2.6)
    assert lasting(2.6) == []
    ears.take(ID, bytes([20, 2, 100, 1, 0, 1, 0xFF, 0xFF]), 2.7)
    assert lasting(3.1) == []
    assert lasting(3.6) == ["wheel and engine speed"]


@pytest.mark.parametrize(("lasted", "judged"), [(3.0, False), (3.01, True)])
def test_what_lasts_longer_than_a_gear_change_is_none(bench, lasted, judged):
    ears = driving(bench, engine_speed=100, shifting=1)
    ears.take(ID, bytes_of(engine_speed=100, shifting=1), 1.0 + lasted)
    assert list(ears.doubts(1.0 + lasted, {})) == (["wheel and engine speed"] if judged else [])


def watching(bench, now=1.0, **values):
    """Ears that know who is obeyed: 0 and 42 are explained; torque to 10 beyond our demand, braking to 5."""
    names = ("speed", "shifting", "obeys", "torque", "retarder")
    signals = tuple(Measured(n, Field(8 * k, 8, 1.0, -100.0, 250), -100, 150) for k, n in enumerate(names))
    ears = Hearing(
        table(
            bench,
            (Heard("M", KEY, 0.1, 0.3, signals),),
            driveline=None,
            address=42,
            obeyed=(Obeyed("obeys", (0.0, 42.0), "engine", 10.0), Obeyed("never", (1.0,))),
            followed=(Followed("engine", "torque", 10.0, 4.0), Followed("retarder", "retarder", -5.0)),
        ),
        Counter(),
    )
    sane = {"speed": 20, "shifting": 0, "obeys": 42, "torque": 50, "retarder": 0}
    ears.take(ID, bytes(int((sane | values)[n]) + 100 for n in names) + b"\xff\xff\xff", now)
    return ears


OURS = {"engine": 50.0, "retarder": -10.0}
TORQUE, RETARDER = "torque beyond our demand", "retarder beyond our demand"
WEAK = "torque far below our demand"


@pytest.mark.parametrize(
    ("values", "doubts"),
    [
        ({}, []),
        ({"obeys": 0}, ["obeys is 0"]),  # itself, while we demand
        ({"obeys": 0, "shifting": 1}, []),
        ({"obeys": 3}, ["obeys is 3"]),
        ({"obeys": 3, "shifting": 1}, []),
        ({"torque": 60}, []),
        ({"torque": 61}, [TORQUE]),
        ({"torque": 13}, []),  # less than we demand: limits, lag
        ({"torque": 12}, [WEAK]),
        ({"torque": -50}, [WEAK]),
        ({"torque": -50, "shifting": 1}, []),
        ({"torque": -50, "speed": 4}, []),
        ({"torque": 61, "shifting": 1}, []),
        ({"torque": 61, "speed": 4}, []),
        ({"torque": 61, "speed": 5}, [TORQUE]),
        ({"retarder": -15}, []),
        ({"retarder": -16}, [RETARDER]),
        ({"retarder": -16, "speed": 3}, []),
        ({"retarder": -16, "speed": 4}, [RETARDER]),
    ],
)
def test_who_is_obeyed_and_what_is_done_against_our_demand(bench, values, doubts):
    found = watching(bench, **values).doubts(1.0, OURS)
    assert found == {doubt: 1.5 if doubt == WEAK else 1.0 for doubt in doubts}  # s


@pytest.mark.parametrize(("demand", "doubt"), [(10.0, False), (10.5, True), (0.0, False)])
def test_a_controller_may_obey_itself_while_we_demand_little(bench, demand, doubt):
    ears = watching(bench, obeys=0, torque=5)
    assert ("obeys is 0" in ears.doubts(1.0, {"engine": demand})) is doubt
    assert ears.doubts(1.0, {"brake": 50.0}) == {}


def test_torque_far_below_a_small_demand_is_no_doubt(bench):
    assert watching(bench, torque=-50).doubts(1.0, {"engine": 10.0}) == {}
    assert watching(bench, torque=13).doubts(1.0, {"engine": 52.0}) == {}
    assert watching(bench, torque=13).doubts(1.0, {"engine": 53.0}) == {WEAK: 1.5}
    assert watching(bench, torque=-50).doubts(1.0, {"engine": 11.0}) == {WEAK: 1.5}
    assert watching(bench, retarder=0).doubts(1.0, {"engine": 50.0, "retarder": -90.0}) == {}


def test_without_a_demand_of_ours_nothing_is_held_against_it(bench):
    assert watching(bench, torque=100, retarder=-100).doubts(1.0, {}) == {}


def test_contradictions_of_speeds_may_last_half_a_second(bench):
    assert driving(bench, engine_speed=0).doubts(1.0, {}) == {"wheel and engine speed": 0.5}


def moving(bench, fastest=math.inf, still=math.inf, rises=math.inf):
    message = Heard("M", KEY, 0.1, 0.3, (Measured("a", BYTE, 0, 250, fastest, still, rises),))
    refusals: Counter[str] = Counter()
    return Hearing(table(bench, (message,)), refusals), refusals


@pytest.mark.parametrize(("after", "to", "taken"), [(0.05, 52, True), (0.05, 53, False), (0.05, 48, True),
    (0.05, 47, False), (0.25, 53, True), (0.25, 54, False), (2.0, 71, True), (2.0, 72, False)])  # fmt: skip
def test_a_value_moves_no_faster_than_a_truck_and_one_step_of_its_field(bench, after, to, taken):
    ears, refusals = moving(bench, fastest=10.0)
    ears.take(ID, frame(a=50), 1.0)
    assert ears.accepted == {"a"}
    ears.take(ID, frame(a=to), 1.0 + after)
    assert ears.value("a") == (to if taken else 50)
    assert ears.accepted == ({"a"} if taken else set())
    assert refusals == ({} if taken else {"a jumps": 1})
    assert ears.stale(1.0 + 0.301) == ([] if taken else ["M"])


@pytest.mark.parametrize(("after", "to", "taken"), [(0.05, 52, True), (0.05, 53, False), (0.05, 40, True),
    (0.25, 53, True), (0.25, 54, False), (0.25, 0, True), (2.0, 71, True), (2.0, 72, False)])  # fmt: skip
def test_a_value_rises_no_faster_than_its_own_limit_and_may_fall_faster(bench, after, to, taken):
    ears, refusals = moving(bench, rises=10.0)
    ears.take(ID, frame(a=50), 1.0)
    ears.take(ID, frame(a=to), 1.0 + after)
    assert ears.value("a") == (to if taken else 50)
    assert refusals == ({} if taken else {"a jumps up": 1})


def test_a_value_that_stands_still_for_too_long_refreshes_nothing(bench):
    ears, refusals = moving(bench, still=0.5)
    for now in (1.0, 1.25, 1.5):
        ears.take(ID, frame(a=50), now)
    assert refusals == {}
    ears.take(ID, frame(a=50), 1.51)
    assert refusals == {"a stands still": 1}
    assert ears.stale(1.79) == []
    assert ears.stale(1.81) == ["M"]
    ears.take(ID, frame(a=51), 1.9)
    ears.take(ID, frame(a=51), 2.3)
    assert ears.stale(2.3) == []


def test_what_is_not_valid_does_not_end_a_standstill(bench):
    ears, refusals = moving(bench, still=0.5)
    for now, a in ((1.0, 50), (1.3, 255), (1.6, 50)):
        ears.take(ID, frame(a=a), now)
    assert refusals == {"a invalid": 1, "a stands still": 1}


@pytest.mark.parametrize(("a", "heard"), [(10, True), (4, False), (0xFF, False)])
def test_a_second_sender_of_a_signal_is_named_and_not_accepted(bench, a, heard):
    ears, refusals = hearing(bench)
    ears.take(ID, frame(a=12, b=96), 1.0)
    what = "a from a second sender (0x03)"
    assert ears.take(ID | 3, frame(a=a, b=0xFFFF), 1.1) == (what if heard else "")
    assert refusals == ({what: 1} if heard else {})
    assert (ears.value("a"), ears.accepted) == (12.0, set())
    assert ears.seconds(2.1) == ([what] if heard else [])
    assert ears.seconds(2.11) == []


def test_every_signal_of_a_second_sender_is_named(bench):
    ears, _ = hearing(bench)
    ears.take(ID | 11, frame(), 1.0)
    assert ears.seconds(1.0) == ["a from a second sender (0x0B)", "b from a second sender (0x0B)"]


@pytest.mark.parametrize(("can_id", "size"), [(ID | 3, 7), (0x0CF00303, 8), (ID ^ 1 << 24 | 3, 8)])
def test_short_frames_and_other_groups_are_no_second_sender(bench, can_id, size):
    ears, refusals = hearing(bench)
    assert ears.take(can_id, frame()[:size], 1.0) == ""
    assert (refusals, ears.seconds(1.0)) == ({}, [])


def test_a_second_sender_that_the_table_names_is_none(bench):
    others = (Measured("c", BYTE, 0, 250),)
    heard = Heard("M", KEY, 0.1, 0.3, (Measured("a", BYTE, 0, 250),)), Heard("N", KEY | 3, 0.1, 0.3, others)
    ears = Hearing(table(bench, heard), Counter())
    ears.take(ID, frame(a=10), 1.0)
    assert ears.take(ID | 3, frame(a=20), 1.0) == ""
    assert (ears.value("a"), ears.value("c"), ears.seconds(1.0)) == (10.0, 20.0, [])


def test_forbidding_signals_count_at_their_value_only_and_unheard_ones_never(bench):
    message = Heard("M", KEY, 0.1, 0.3, (Measured("a", BYTE, 0, 250),))
    ears = Hearing(table(bench, (message,), forbidden=(("a", 2.0), ("never", 0.0))), Counter())
    assert ears.forbids() == []
    for value, found in ((1, []), (2, ["a"]), (3, [])):
        ears.take(ID, frame(a=value), 1.0)
        assert ears.forbids() == found


# the checks themselves, against frames worked out by hand


def test_tsc1_checksum_by_hand():
    """PACCAR PEC017: bytes FE 00 7D A0 FF FF FF, counter 5, identifier 0C000027 sum to 1360.

    (1360 >> 6) & 3 is 1, 1360 >> 3 is 170; 1 + 170 + 1360 = 1531, and 1531 modulo 8 is 3.
    """
    payload = bytes([0xFE, 0x00, 0x7D, 0xA0, 0xFF, 0xFF, 0xFF])
    assert sum(payload) + 5 + 0x0C + 0x27 == 1360
    for check in range(16):
        word = int.from_bytes(payload + bytes([5 | check << 4]), "little")
        assert checksum_ok("tsc1", 0x0C000027, word) == (check == 3)


def test_xbr_checksum_by_hand():
    """J1939-71 SPN 3188: all zeros, counter 0, identifier 0C040B2A sums to 0x45; 4 + 0x45 = 0x49: 9."""
    for check in range(16):
        assert checksum_ok("xbr", 0x0C040B2A, check << 60) == (check == 9)


@pytest.mark.parametrize("last", [0xFF, 0xF0, 0x0F, 0xFE, 0xEF, 0x00])
def test_without_checksum_byte_8_says_not_available(last):
    assert checksum_ok("none", ID, last << 56) == (last == 0xFF)


@pytest.mark.parametrize(("kind", "modulo"), [("tsc1", 8), ("xbr", 16)])
def test_counter_follows(kind, modulo):
    for before in (None, *range(modulo)):
        for count in range(16):
            fits = count < modulo and (before is None or count == (before + 1) % modulo)
            assert counter_ok(kind, count << 56, before) == fits


def test_without_counter_anything_goes():
    assert counter_ok("none", 0xFF << 56, 15)


REST = {"engine": 0.0, "brake": 0.0}
SLOWS = "slows without our demand"


def slowing(bench, seconds, pull, steady=1.0, most=1.5):
    """Ears that heard a steady speed, then one that falls by `pull`, m/s^2; the last at 0.0."""
    speed = Field(0, 16, 1 / 1024, 0.0, 64255)
    other = Field(16, 16, 1 / 1024, 0.0, 64255)
    message = Heard("M", KEY, 1 / 8, 0.3, (Measured("speed", speed, 0, 60), Measured("a", other, 0, 60)))
    ears = Hearing(
        table(bench, (message,), driveline=None, obeyed=(), followed=(), coasts_m_s2=most), Counter()
    )
    for step in range(round(-8 * (seconds + steady)), 1):
        raw = round(1024 * (30 - pull * max(step / 8 + seconds, 0)))
        ears.take(ID, raw.to_bytes(2, "little") + bytes(2) + b"\xff" * 4, step / 8)
    return ears


@pytest.mark.parametrize(
    ("seconds", "pull", "steady", "doubt"),
    [
        (2.0, 1.5, 1.0, False),
        (2.0, 1.625, 1.0, True),
        (2.0, -2.0, 1.0, False),  # it gains speed
        (0.875, 3.0, 0.0, False),  # heard for less than a second
        (1.0, 3.0, 0.0, True),
        (0.75, 2.0, 60.0, False),  # the mean of the last second
        (0.875, 1.875, 60.0, True),
    ],
)
def test_a_truck_that_slows_down_by_itself_is_braked_by_somebody(bench, seconds, pull, steady, doubt):
    assert (SLOWS in slowing(bench, seconds, pull, steady).doubts(0.0, REST)) is doubt


@pytest.mark.parametrize(("pull", "doubt"), [(1.5, False), (1.51, True)])
def test_where_speeds_are_missing_the_mean_is_over_what_there_is(bench, pull, doubt):
    ears = slowing(bench, 1.125, pull, steady=-1.0)  # heard at -0.125 s and 0 s
    late = 0.9375
    ears.take(ID, round(1024 * (30 - pull * (late + 1.125))).to_bytes(2, "little") + bytes(6), late)
    assert (SLOWS in ears.doubts(late, REST)) is doubt


@pytest.mark.parametrize(
    ("ours", "doubt"),
    [
        ({"engine": 50.0, "brake": 0.0}, True),
        ({"engine": 50.0, "brake": 1.0}, False),
        ({"engine": 50.0, "retarder": -1.0, "brake": 0.0}, False),
        ({"engine": -1.0, "brake": 0.0}, False),
        ({"brake": 0.0}, True),
        ({}, False),  # not in control: the driver may brake
    ],
)
def test_unless_our_own_demand_slows_it_now_or_did_of_late(bench, ours, doubt):
    ears = slowing(bench, 2.0, 2.0)
    assert (SLOWS in ears.doubts(0.0, ours)) is doubt
    assert (SLOWS in ears.doubts(1.875, REST)) is doubt
    assert ears.doubts(2.0, REST) == {SLOWS: bench.table.timing.persist}


def test_without_a_limit_or_a_speed_nobody_is_suspected(bench):
    assert slowing(bench, 2.0, 2.0, most=math.inf).doubts(0.0, REST) == {}
    assert slowing(bench, 2.0, 2.0, steady=-3.0).doubts(0.0, REST) == {}


def braked(bench, pull, share, pitch=None, begin=0.0, speed=30.0, seconds=3.0):
    """Time at which it is said that the brake does not answer to `share` of what a hazard needs, from `begin`
    on, while the truck slows by `pull` m/s^2; NaN where it never is."""
    field, angle = Field(0, 16, 1 / 1024, 0.0, 64255), Field(16, 16, 1 / 128, -200.0, 64255)
    signals = (
        Measured("speed", field, 0, 60),
        *([Measured("pitch", angle, -30, 30)] if pitch is not None else []),
    )
    ears = Hearing(
        table(bench, (Heard("M", KEY, 1 / 8, 0.3, signals),), driveline=None, obeyed=(), followed=()),
        Counter(),
    )
    for step in range(round(8 * seconds)):
        now = step / 8
        raw = round(1024 * max(speed - pull * now, 0.0)) | round(128 * ((pitch or 0.0) + 200)) << 16
        ears.take(ID, raw.to_bytes(4, "little") + b"\xff" * 4, now)
        demand = {"brake": share * bench.axis("brake").holds_beyond} if now >= begin else {}
        if "the brake does not answer" in ears.doubts(now, {"engine": 0.0, **demand}):
            assert ears.doubts(now, {"engine": 0.0, **demand})["the brake does not answer"] == 0.0
            return now
    return math.nan


def test_a_brake_that_does_not_answer_is_said_within_two_seconds(bench):
    assert braked(bench, 0.2, 2.0, pitch=0.0) == pytest.approx(1.5, abs=0.25)
    assert braked(bench, 0.2, 2.0, pitch=0.0, begin=1.0) == pytest.approx(2.5, abs=0.25)
    assert math.isnan(braked(bench, 0.2, 1.0, pitch=0.0))  # what no hazard needs
    assert math.isnan(braked(bench, 0.2, 2.0, pitch=0.0, begin=2.0))  # not yet


@pytest.mark.parametrize(
    ("pull", "pitch", "said"),
    [
        (0.70, 0.0, True),  # a quarter of 3 m/s^2 is 0.75
        (0.80, 0.0, False),
        (0.20, -3.434, False),  # 6 % down: 0.59 m/s^2
        (0.10, -3.434, True),
        (1.20, 3.434, True),
        (1.40, 3.434, False),
        (0.10, None, True),  # the truck does not say: it may be 6 % down
        (0.20, None, False),
    ],
)
def test_what_a_quarter_of_the_demand_gives_on_the_slope_decides(bench, pull, pitch, said):
    assert math.isnan(braked(bench, pull, 2.0, pitch)) is not said


def test_a_truck_that_stops_is_not_said_not_to_brake(bench):
    assert math.isnan(braked(bench, 0.1, 2.0, pitch=0.0, speed=3.0))
    assert not math.isnan(braked(bench, 0.1, 2.0, pitch=0.0, speed=3.4))


@pytest.mark.parametrize(("pitch", "pull", "said"), [
    (0.0, 0.75, True), (0.0, 0.70, False),  # 1.5 m/s^2 less the 10 % that it has in it, and 2 % of error
    (5.71, 1.65, False), (5.71, 1.75, True), (-3.0, 0.24, True), (-3.0, 0.18, False),
])  # fmt: skip
def test_a_slope_that_is_heard_leaves_less_to_be_explained(bench, pitch, pull, said):
    field, angle = Field(0, 16, 1 / 1024, 0.0, 64255), Field(16, 16, 1 / 128, -200.0, 64255)
    signals = Measured("speed", field, 0, 60), Measured("pitch", angle, -30, 30)
    ears = Hearing(
        table(bench, (Heard("M", KEY, 1 / 8, 0.3, signals),), driveline=None, obeyed=(), followed=()),
        Counter(),
    )
    for step in range(33):
        raw = round(1024 * (30 - pull * step / 8)) | round(128 * (pitch + 200)) << 16
        ears.take(ID, raw.to_bytes(4, "little") + b"\xff" * 4, step / 8)
    assert (SLOWS in ears.doubts(4.0, REST)) is said
