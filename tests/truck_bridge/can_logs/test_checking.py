"""A recorded drive through the core's checks: nothing refused in a sound one, damage noticed."""

from __future__ import annotations

import os
from collections import deque
from pathlib import Path

import can
import pytest

from truck_bridge import can_logs, vehicles
from truck_bridge.can_logs.checking import lines
from truck_bridge.emulator.ecus import EcuEmulator

HERE = Path(__file__).parent
RESEARCH = HERE.parent / "research_truck.yaml"
REAL = Path(os.environ.get("DEEPTRUCK_REAL_DATA", "../shared/data")) / "j1939_csu" / "normal.log"
FORGED = REAL.with_name("tsc1.log")
EEC1, EBC2 = 0x0CF00400, 0x18FEBF0B


class Tape(can.BusABC):
    """A bus that only notes what is sent."""

    def __init__(self):
        self.messages, self.channel_info, self._can_protocol = deque(), "tape", can.CanProtocol.CAN_20
        super().__init__(channel="tape")

    def send(self, msg, timeout=None):
        self.messages.append(msg)

    def _recv_internal(self, timeout):
        return None, False


def driven(name, seconds=6.0, brake=0.0):
    """(time, identifier, data) of what an emulated truck says at 15 m/s; from 1 s on its driver brakes."""
    tape, frames = Tape(), []
    truck = EcuEmulator(vehicles.load(name), tape, speed=15.0)
    for k in range(round(seconds / 0.005)):
        truck.driver.brake_pedal = brake if k > 200 else 0.0
        truck.step(0.005 * k)
        frames += [(0.005 * k, m.arbitration_id, bytes(m.data)) for m in tape.messages]
        tape.messages.clear()
    tape.shutdown()
    return frames


def checked(tmp_path, name, frames):
    path = tmp_path / "drive.log"
    path.write_text("".join(f"({t:.6f}) can0 {i:08X}#{d.hex()}\n" for t, i, d in frames))
    return can_logs.check(path, vehicles.load(name))


@pytest.mark.parametrize("name", [*vehicles.NAMES, str(RESEARCH)])
def test_a_sound_drive_is_not_refused(tmp_path, name):
    found = checked(tmp_path, name, driven(name))
    assert found.clean, list(lines(found))
    assert found.engaged_s > 5.0
    assert found.seconds == pytest.approx(6.0, abs=0.05)


def test_damage_is_counted(tmp_path):
    def bent(frame):
        time, can_id, data = frame
        return (time, can_id, data[:2] if can_id == EBC2 and 3.0 < time < 3.2 else data)

    found = checked(tmp_path, "trucksim", map(bent, driven("trucksim")))
    assert found.refusals == {"EBC2 length": 2}
    assert not found.clean


def test_a_message_that_falls_silent_loses_control(tmp_path):
    frames = [f for f in driven("trucksim") if not (f[1] == EEC1 and 3.0 < f[0] < 3.5)]
    found = checked(tmp_path, "trucksim", frames)
    assert found.losses == {"EEC1 stale": 1}
    assert 5.0 < found.engaged_s < 5.8  # and was given back by the same untiring person


def test_a_second_sender_loses_control(tmp_path):
    frames = [copy for f in driven("trucksim") for copy in ([f, f] if f[1] == EEC1 and f[0] > 3.0 else [f])]
    found = checked(tmp_path, "trucksim", frames)
    assert found.losses["EEC1 too often"] >= 1


def test_another_node_that_commands_is_noticed_and_the_bridge_itself_is_not(tmp_path):
    frames = driven("trucksim")
    ours, stranger = (3.0, 0x0C00002A, bytes(8)), (4.0, 0x0C000077, bytes(8))
    assert checked(tmp_path, "trucksim", sorted([*frames, ours])).clean
    found = checked(tmp_path, "trucksim", sorted([*frames, ours, stranger]))
    assert found.losses == {"another node commands the truck": 1}


def demand(first, last, mode, step=0.01):
    """TSC1 to the engine from the brake controller's address, handed back at the end."""
    times = [first + step * k for k in range(round((last - first) / step) + 1)]
    frames = [(t, 0x0C00000B, bytes([0xFC | mode]) + b"\xff" * 7) for t in times]
    return [*frames, (times[-1] + step, 0x0C00000B, b"\xfc" + b"\xff" * 7)]


def test_what_the_brakes_may_demand_is_sound(tmp_path):
    assert checked(tmp_path, "trucksim", sorted([*driven("trucksim"), *demand(2.0, 4.0, mode=3)])).clean


def test_a_forged_demand_of_a_known_address_is_told_with_its_times(tmp_path):
    found = checked(tmp_path, "trucksim", sorted([*driven("trucksim"), *demand(2.0, 3.0, mode=1)]))
    assert found.refusals == {"brake to engine: control mode 1": 101}
    assert found.losses == {"brake to engine: control mode 1": 1}
    assert found.engaged_s == pytest.approx(4.0, abs=0.2)  # until 2 s, and from a second after the last
    said = list(lines(found))
    assert "refused: brake to engine: control mode 1 (101 times, 2.00 to 3.00 s)" in said
    assert "control would have been lost: brake to engine: control mode 1 (at 2.00 s)" in said


def test_the_driver_is_named_and_does_not_take_over(tmp_path):
    codec = vehicles.load("trucksim").codec
    pedal = codec["EEC2"].encode({"AcceleratorPedalPosition": 30.0})
    frames = [(t, i, pedal if i & 0xFFFF00 == 0xF00300 else d) for t, i, d in driven("trucksim")]
    found = checked(tmp_path, "trucksim", frames)
    assert found.clean
    assert found.driver_s["accelerator"] == pytest.approx(6.0, abs=0.1)


def test_a_log_with_a_pause_starts_hearing_anew(tmp_path):
    frames = driven("trucksim", 3.0)
    later = [(t + 3600.0, i, d) for t, i, d in frames]
    found = checked(tmp_path, "trucksim", [*frames, *later])
    assert found.clean
    assert found.seconds == pytest.approx(6.0, abs=0.1)
    assert any("in 6.0 s, beside 1 pauses of 3597.0 s in all" in line for line in lines(found))
    assert any("rolling radius by the gears: 1.0" in line for line in lines(found))


def test_a_clock_that_goes_back_adds_no_pause_it_had_before(tmp_path):
    """Two loggers in one file, one of them 100 s late: 20 times back and forth."""
    frames = driven("trucksim", 2.0)
    found = checked(
        tmp_path,
        "trucksim",
        [(t + 100.0 * (round(10 * t) % 2), i, d) for t, i, d in frames],
    )
    assert (found.pauses, found.paused_s) == (1, pytest.approx(100.0, abs=0.2))


def test_who_is_never_heard_says_why(tmp_path):
    found = checked(tmp_path, "volvo", [f for f in driven("volvo") if f[1] & 0xFF != 0x0B])
    assert not found.clean
    assert any("never engaged because" in line and "EBC1 not fresh" in line for line in lines(found))


def told(times, data, source=0):
    return [(t, 0x18FECA00 | source, bytes.fromhex(data)) for t in times]


def test_a_fault_that_forbids_control_is_a_loss_and_its_times_are_said(tmp_path):
    quiet = told([0.5, 1.5], "00FF00000000FFFF")
    frames = sorted([*driven("trucksim", 9.0), *quiet, *told([2.5, 3.0], "10FF6E001001FFFF")])
    found = checked(tmp_path, "trucksim", frames)
    assert found.losses == {"fault: red_stop_lamp (engine)": 1} and not found.clean
    assert 3.2 < found.engaged_s < 3.5  # until 2.5 s, and again 5 s after the last word of it
    said = list(lines(found))
    assert "control would have been lost: fault: red_stop_lamp (engine) (at 2.50 s)" in said
    assert (
        "faults reported: SPN 110 FMI 16 (engine) (2 times, 2.50 to 3.00 s), "
        "red_stop_lamp (engine) (2 times, 2.50 to 3.00 s)"
    ) in said


def test_a_fault_that_forbids_nothing_is_said_and_the_drive_is_clean(tmp_path):
    frames = sorted([*driven("trucksim"), *told([1.0], "04FF6E001001FFFF", 0x03)])
    found = checked(tmp_path, "trucksim", frames)
    assert found.clean
    assert found.faults == {"SPN 110 FMI 16 (transmission)": 1, "amber_warning_lamp (transmission)": 1}


@pytest.mark.skipif(not REAL.is_file(), reason=f"{REAL} is not there (set DEEPTRUCK_REAL_DATA)")
def test_the_faults_of_a_real_truck_forbid_control_where_the_file_names_them(tmp_path):
    mine = RESEARCH.read_text().replace("codes: [{spn: 1569}]", "codes: [{spn: 829, fmi: 3}]")
    (tmp_path / "mine.yaml").write_text(mine)
    found = can_logs.check(REAL, vehicles.load(tmp_path / "mine.yaml"))
    assert found.losses == {"fault: SPN 829 FMI 3 (cab)": 1}
    assert found.engaged_s == pytest.approx(21.8, abs=0.2)
    assert found.faults["SPN 191 FMI 9 (engine)"] == 30


@pytest.mark.skipif(not REAL.is_file(), reason=f"{REAL} is not there (set DEEPTRUCK_REAL_DATA)")
def test_a_real_truck_is_never_refused_falsely():
    """Half a minute of a real truck, at the rates, with the holes and the second senders it really has."""
    found = can_logs.check(REAL, vehicles.load(RESEARCH))
    assert found.refusals == {}
    assert found.losses == {}
    assert sum(found.received.values()) == 7497
    assert found.engaged_s > 29.8


@pytest.mark.skipif(not FORGED.is_file(), reason=f"{FORGED} is not there (set DEEPTRUCK_REAL_DATA)")
def test_a_demand_forged_from_the_brake_controllers_address_is_found():
    """Speed control of the engine from address 0x0B, between true limits by the transmission."""
    found = can_logs.check(FORGED, vehicles.load(RESEARCH))
    reason = "brake to engine: control mode 1"
    assert found.refusals == {reason: 923, "brake to engine: not repeated in time": 1}
    assert found.losses == {reason: 1}
    assert found.lost_s[reason] == pytest.approx((14.98, 14.98), abs=0.01)
    assert found.refused_s[reason] == pytest.approx((14.98, 24.40), abs=0.01)


def test_what_many_pauses_cut_off_is_said_once(tmp_path):
    second = [f for f in driven("trucksim", 0.5) if f[1] == EEC1]
    announced = (0.4, 0x1CECFF00, bytes.fromhex("20140003FFCAFE00"))  # a DM1 of which nothing follows
    frames = [(t + 4.0 * k, i, d) for k in range(50) for t, i, d in sorted([*second, announced])]
    found = checked(tmp_path, "trucksim", frames)
    said = list(lines(found))
    assert found.pauses == 49 and len(said) < 15
    assert [line for line in said if "left out" in line] == [
        "messages of several frames left out: DM1 of 0x00: cut off (50)"
    ]


def test_a_driver_who_brakes_in_a_log_is_no_fault(tmp_path):
    frames = driven("trucksim", 4.0, brake=60.0)
    found = checked(tmp_path, "trucksim", frames)
    assert found.driver_s["brake_pedal"] > 2.0
    assert not any("slows" in reason for reason in found.losses)
