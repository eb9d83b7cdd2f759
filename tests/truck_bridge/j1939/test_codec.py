"""The codec against cantools, against frames of a real truck, and at every reserved value."""

from __future__ import annotations

import math
from importlib import resources

import cantools.database
import pytest
from hypothesis import given
from hypothesis import strategies as st

from truck_bridge import j1939
from truck_bridge.errors import InputError
from truck_bridge.j1939 import Identifier, checksums

CODEC = j1939.load()
LIBRARY = cantools.database.load_string(
    resources.files("truck_bridge.j1939").joinpath("j1939.dbc").read_text(), "dbc"
)
SIGNALS = [(layout.name, signal) for layout in CODEC.by_name.values() for signal in layout.signals.values()]


@given(st.sampled_from(sorted(CODEC.by_name)), st.binary(min_size=8, max_size=8))
def test_valid_values_are_those_of_cantools(name, data):
    mine = CODEC[name].decode(data)
    theirs = LIBRARY.get_message_by_name(name).decode(data, decode_choices=False)
    for key, value in mine.values.items():
        assert (key in mine.flags) == math.isnan(value)
        if not math.isnan(value):
            assert value == pytest.approx(theirs[key], abs=1e-9)


@given(st.sampled_from(sorted(CODEC.by_name)), st.data())
def test_encoding_and_decoding_are_inverse(name, data):
    layout = CODEC[name]
    raw = {s.name: data.draw(st.integers(0, s.last)) for s in layout.signals.values()}
    values = {key: layout.signals[key].value(number) for key, number in raw.items()}
    frame = layout.encode(values)
    assert layout.decode(frame).values == pytest.approx(values)
    assert frame == LIBRARY.get_message_by_name(name).encode(values, padding=True, strict=False)


@pytest.mark.parametrize(("message", "signal"), SIGNALS, ids=lambda x: getattr(x, "name", x))
def test_reserved_values_are_never_numbers(message, signal):
    top = signal.mask
    if signal.last == top:
        assert signal.value(top) == signal.offset + signal.scale * top  # counters and modes use all values
        return
    assert math.isnan(signal.value(top))
    assert signal.flag(top) == "not available"
    assert not math.isnan(signal.value(signal.last))
    assert math.isnan(signal.value(signal.last + 1))
    if signal.bits >= 8:
        shift = signal.bits - 8
        assert signal.flag(0xFE << shift) == "error"
        assert math.isnan(signal.value(0xFE << shift))
        assert signal.flag(0xFB << shift) == "out of range"


@pytest.mark.parametrize("value", [-0.07, 8031.94, 1e9])
def test_encoding_refuses_what_does_not_fit(value):
    with pytest.raises(ValueError, match="EngineSpeed"):
        CODEC["EEC1"].encode({"EngineSpeed": value})


def test_frames_of_a_real_truck():
    """Public recording of a research truck: 30 % torque, 1531.6 rpm; 49.5 km/h; 3rd gear of ratio 1.474."""
    engine = CODEC.decode(0x0CF00400, bytes.fromhex("219B9BDD2F000F9B"))
    assert (engine.name, engine.source) == ("EEC1", 0)
    assert engine.values["ActualPercentTorque"] == 30
    assert engine.values["EngineSpeed"] == 1531.625
    speed = CODEC.decode(0x18FEF100, bytes.fromhex("FF3417FCFF6800CF"))
    assert speed.values["WheelBasedVehicleSpeed"] == pytest.approx(23.203125)
    assert math.isnan(speed.values["ParkingBrakeSwitch"])
    assert speed.flags["ParkingBrakeSwitch"] == "not available"
    assert CODEC.decode(0x18FCF200, bytes(8)) is None


def test_the_users_dbc_replaces_a_message(tmp_path):
    dbc = tmp_path / "mine.dbc"
    dbc.write_text(
        'VERSION ""\nBU_: A\nBO_ 2364473342 PropA: 8 A\n SG_ Pressure : 8|16@1+ (0.5,0) [0|1000] "kPa" A\n'
    )
    mine = j1939.load(dbc)
    assert list(mine["PropA"].signals) == ["Pressure"]
    assert list(CODEC["PropA"].signals) != ["Pressure"]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("hello", "is not a DBC file"),
        ('VERSION ""\nBU_: A\nBO_ 2364473342 P: 8 A\n SG_ S : 7|16@0+ (1,0) [0|9] "" A\n', "little endian"),
    ],
)
def test_a_bad_dbc_is_one_line(tmp_path, text, says):
    dbc = tmp_path / "bad.dbc"
    dbc.write_text(text)
    with pytest.raises(InputError, match=says) as error:
        j1939.load(dbc)
    assert "\n" not in str(error.value)
    with pytest.raises(InputError, match="cannot read"):
        j1939.load(tmp_path / "none.dbc")
    with pytest.raises(InputError, match="no message 'EEC9'"):
        CODEC["EEC9"]


# Counters, checksums and identifiers


@pytest.mark.parametrize("kind", checksums.KINDS)
def test_a_signed_frame_verifies_and_a_changed_one_does_not(kind):
    data = checksums.sign(kind, 0x0C00002A, bytes(range(8)), 13)
    assert checksums.verify(kind, 0x0C00002A, data)
    if kind == checksums.NONE:
        assert data[7] == 0xFF
        return
    assert data[7] & 0xF == 13 % checksums.COUNTERS[kind]
    noticed = [
        not checksums.verify(kind, 0x0C00002A, bytes([*data[:k], data[k] ^ 1, *data[k + 1 :]]))
        for k in range(7)
    ]
    assert all(noticed)
    assert not checksums.verify(kind, 0x0C00002B, data)


@pytest.mark.parametrize(
    ("kind", "total", "wanted"),
    [
        (checksums.TSC1, 0b11_010_001, 3 + 2 + 1),
        (checksums.TSC1, 0b01_111_101, (1 + 7 + 5) % 8),
        (checksums.TSC1, 0b1_11_010_001, 3 + 2 + 1),  # of a longer sum the low byte alone
        (checksums.XBR, 0x5A, 0x5 + 0xA),
        (checksums.XBR, 0x1F3, (0xF + 0x3) % 16),
    ],
)
def test_a_checksum_folds_the_sum_of_all_bytes(kind, total, wanted):
    """J1939-71: the low byte's three octal digits are added modulo 8, for XBR its two hexadecimal ones."""
    identifier, counter = 0x0C00002A, 5
    first = min(total - 0x0C - 0x2A - counter, 0xFF)
    data = bytes([first, total - 0x0C - 0x2A - counter - first, 0, 0, 0, 0, 0, counter])
    assert checksums.checksum(kind, identifier, data) == wanted


@pytest.mark.parametrize(
    ("can_id", "priority", "pgn", "destination", "source"),
    [
        (0x0CF00400, 3, 0xF004, 0xFF, 0x00),
        (0x0C00002A, 3, 0x0000, 0x00, 0x2A),
        (0x18EAFF00, 6, 0xEA00, 0xFF, 0x00),
        (0x18EF0B2A, 6, 0xEF00, 0x0B, 0x2A),
        (0x19FEF131, 6, 0x1FEF1, 0xFF, 0x31),
    ],
)
def test_identifiers_come_apart_and_together(can_id, priority, pgn, destination, source):
    assert Identifier.of(can_id) == Identifier(priority, pgn, destination, source)
    assert Identifier.of(can_id).can_id == can_id
