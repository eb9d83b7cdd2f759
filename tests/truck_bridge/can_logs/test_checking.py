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


def driven(name, seconds=6.0):
    """(time, identifier, data) of what an emulated truck says at 15 m/s."""
    tape, frames = Tape(), []
    truck = EcuEmulator(vehicles.load(name), tape, speed=15.0)
    for k in range(round(seconds / 0.005)):
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


def test_who_is_never_heard_says_why(tmp_path):
    found = checked(tmp_path, "volvo", [f for f in driven("volvo") if f[1] & 0xFF != 0x0B])
    assert not found.clean
    assert any("never engaged because" in line and "EBC1 not fresh" in line for line in lines(found))


@pytest.mark.skipif(not REAL.is_file(), reason=f"{REAL} is not there (set DEEPTRUCK_REAL_DATA)")
def test_a_real_truck_is_never_refused_falsely():
    """Half a minute of a real truck, at the rates, with the holes and the second senders it really has."""
    found = can_logs.check(REAL, vehicles.load(RESEARCH))
    assert found.refusals == {}
    assert found.losses == {}
    assert sum(found.heard.values()) == 7497
    assert found.engaged_s > 29.8
