"""DM1 and VIN from bytes: of a real truck, of another implementation, damaged, in old layouts."""

from __future__ import annotations

import j1939
import pytest
from hypothesis import given
from hypothesis import strategies as st

from truck_bridge.j1939.diagnostics import LAMPS, Code, report, single, vehicle_number

NOTHING = bytes.fromhex("00FF00000000FFFF")  # as the truck's transmission says every second


def test_no_fault_is_lamps_off_and_no_code():
    found = report(NOTHING)
    assert (found.lamps, found.counts, found.active) == (dict.fromkeys(LAMPS, False), {}, [])
    assert report(bytes.fromhex("00FFFFFFFFFFFFFF")).counts == {}  # the older way to say so


def test_the_codes_of_a_real_truck():
    """A research truck's engine: wheel and shaft speed come too seldom, and a code of its maker's."""
    found = report(bytes.fromhex("43FFBF00090854000908ED141F01"))
    assert found.counts == {Code(191, 9): 8, Code(84, 9): 8, Code(5357, 31): 1}
    assert found.lamps == {"amber_warning_lamp": False, "red_stop_lamp": False, "malfunction_lamp": True}
    assert found.active == [Code(191, 9), Code(84, 9), Code(5357, 31), "malfunction_lamp"]
    assert report(bytes.fromhex("00FF6E00107FFFFF")).counts == {Code(110, 16): -1}, "an unknown count"


CODE = st.tuples(
    st.integers(1, 0x7FFFE), st.integers(0, 31), st.integers(0, 126)
)  # SPN 0 and the highest stand for no code
LAMP = {"pl": "protect_lamp", "awl": "amber_warning_lamp", "rsl": "red_stop_lamp", "mil": "malfunction_lamp"}
LIT = j1939.DtcLamp
STATE = {LIT.OFF: False, LIT.ON: True, LIT.ON_SLOW_FLASH: True, LIT.ON_FAST_FLASH: True, LIT.NA: None}


@given(
    st.lists(CODE, max_size=20, unique_by=lambda code: code[:2]),
    st.fixed_dictionaries({key: st.sampled_from(sorted(STATE)) for key in LAMP}),
)
def test_what_another_implementation_writes_is_read(codes, lamps):
    data = bytes(j1939.DtcLamp().get_data(dict(lamps)))
    for spn, fmi, count in codes:
        data += j1939.DTC(spn=spn, fmi=fmi, oc=count).dtc.to_bytes(4, "little")
    found = report(data if codes else data + bytes(4) + b"\xff\xff")
    assert found.counts == {Code(spn, fmi): count for spn, fmi, count in codes}
    states = {LAMP[key]: STATE[state] for key, state in lamps.items()}
    assert found.lamps == {lamp: state for lamp, state in states.items() if state is not None}


def test_an_old_layout_gives_every_reading():
    """SPN 1569 in the three layouts of conversion method 1: each is among what the code may mean."""
    spn, fmi = 1569, 31
    high, low = spn >> 3, (spn & 7) << 5
    layouts = [
        bytes([high >> 8, high & 0xFF, low | fmi, 0x81]),
        bytes([high & 0xFF, high >> 8, low | fmi, 0x81]),
        bytes([spn & 0xFF, spn >> 8 & 0xFF, spn >> 16 << 5 | fmi, 0x81]),
    ]
    for four in layouts:
        (code,) = report(b"\x00\xff" + four + b"\xff\xff").counts
        assert spn in code.readings and code.fmi == fmi and len(set(code.readings)) == 3


@pytest.mark.parametrize(
    "data",
    [b"", b"\x00", b"\x00\xff", b"\x00\xff\x6e\x00\x10", bytes(11), bytes(13)],
    ids=["empty", "one", "lamps", "half a code", "eleven", "thirteen"],
)
def test_what_is_not_lamps_and_whole_codes_is_no_dm1(data):
    assert report(data) is None


@given(st.binary(max_size=40))
def test_any_bytes_are_read_or_are_none(data):
    found = report(data)
    assert found is None or all(0 < code.spn < 0x7FFFF and 0 <= code.fmi < 32 for code in found.counts)
    number = vehicle_number(data)
    assert number is None or number.isalnum()


@pytest.mark.parametrize(
    ("data", "number"),
    [
        (b"1M8GDM9AXKP042788*", "1M8GDM9AXKP042788"),
        (b"1M8GDM9AXKP042788", "1M8GDM9AXKP042788"),  # some controllers forget the star
        (b"1M8GDM9AXKP042788*\xff\xff", "1M8GDM9AXKP042788"),
        (b"SHORT12*", "SHORT12"),
        (b"1M8GDM9AXKP0427", None),
        (b"*", None),
        (b"\xff" * 18, None),
        (b"1M8GDM9\x00XKP042788*", None),
        (b"", None),
    ],
)
def test_the_number_of_the_truck(data, number):
    assert vehicle_number(data) == number


def test_only_dm1_and_vin_are_taken_from_single_frames():
    assert single(0x18FECA03, NOTHING) == (0xFECA, 0x03, 0xFF, NOTHING)
    assert single(0x18FEEC00, b"SHORT12*").pgn == 0xFEEC
    assert single(0x0CF00400, NOTHING) is None
