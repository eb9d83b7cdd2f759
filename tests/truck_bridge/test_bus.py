"""The loopback bus: between processes, on 127.0.0.1 only, like any other python-can interface."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import can
import pytest

from truck_bridge.bus import BLOCKS, FIRST_PORT, SLOTS
from truck_bridge.bus_connection import BURST, RETRY_S, BusConnection
from truck_bridge.j1939.address_claim import AddressClaim, name


@pytest.fixture
def channel(request):
    return f"{os.getpid()}-{request.node.name}"


@pytest.fixture
def pair(channel):
    buses = [can.Bus(interface="loopback", channel=channel) for _ in range(2)]
    yield buses
    for bus in buses:
        bus.shutdown()


@pytest.mark.parametrize(
    "message",
    [
        can.Message(arbitration_id=0x0CF00400, data=bytes(range(8))),
        can.Message(arbitration_id=0x7FF, data=b"\x01", is_extended_id=False),
        can.Message(arbitration_id=0x18FEF100, data=b""),
        can.Message(arbitration_id=0x18EAFF00, is_remote_frame=True, dlc=3),
        can.Message(arbitration_id=0x40, data=bytes(8), is_error_frame=True, is_extended_id=False),
    ],
    ids=["extended", "standard", "empty", "remote", "error"],
)
def test_a_frame_arrives_as_it_left_and_not_at_its_sender(pair, message):
    pair[0].send(message)
    arrived = pair[1].recv(2.0)
    assert arrived is not None
    assert arrived.equals(message, timestamp_delta=None, check_channel=False, check_direction=False)
    assert pair[0].recv(0) is None


def test_frames_of_one_sender_keep_their_order(pair):
    for number in range(500):
        pair[0].send(can.Message(arbitration_id=0x18FF0000 + number, data=number.to_bytes(8, "little")))
    assert [pair[1].recv(2.0).arbitration_id - 0x18FF0000 for _ in range(500)] == list(range(500))


def test_another_process_hears_and_answers(pair, channel):
    code = (
        "import can, sys\n"
        "bus = can.Bus(interface='loopback', channel=sys.argv[1])\n"
        "bus.send(can.Message(arbitration_id=1)); m = bus.recv(60)\n"
        "bus.send(can.Message(arbitration_id=m.arbitration_id + 1, data=m.data)); bus.shutdown()\n"
    )
    with subprocess.Popen([sys.executable, "-c", code, channel]) as process:
        assert pair[0].recv(60) is not None
        pair[0].send(can.Message(arbitration_id=0x100, data=b"hello"))
        answer = pair[0].recv(60)
        assert (answer.arbitration_id, bytes(answer.data)) == (0x101, b"hello")
        assert process.wait(60) == 0


def test_a_killed_process_leaves_its_slot_free(channel):
    code = (
        "import can, sys\n"
        "bus = can.Bus(interface='loopback', channel=sys.argv[1])\n"
        "print(bus._socket.getsockname()[1], flush=True); bus.recv(60)\n"
    )
    with subprocess.Popen([sys.executable, "-c", code, channel], stdout=subprocess.PIPE) as process:
        port = int(process.stdout.readline())
        process.kill()
        process.wait()
    with can.Bus(interface="loopback", channel=channel) as bus:
        assert bus._socket.getsockname()[1] == port


def test_the_socket_is_bound_to_the_loopback_device(pair):
    address, port = pair[0]._socket.getsockname()
    assert address == "127.0.0.1"
    assert FIRST_PORT <= port < 32_768, "ports from 32768 on are the kernel's to give away"
    assert FIRST_PORT + SLOTS * BLOCKS <= 32_768
    assert {peer[0] for peer in pair[0]._peers} == {"127.0.0.1"}


def test_strangers_on_the_port_are_ignored(pair):
    _, port = pair[1]._socket.getsockname()
    for packet in (b"", b"hello", b"x" * 22, b"dtCB" + b"\xff" * 18):
        pair[0]._socket.sendto(packet, ("127.0.0.1", port))
    pair[0].send(can.Message(arbitration_id=7))
    messages = [pair[1].recv(0.2) for _ in range(6)]
    assert [m.arbitration_id for m in messages if m] == [7]


def test_channels_do_not_hear_each_other_and_a_bus_itself_on_request(pair, channel):
    with can.Bus(interface="loopback", channel=channel + "other", receive_own_messages=True) as other:
        pair[0].send(can.Message(arbitration_id=1))
        assert pair[1].recv(60) is not None
        assert other.recv(0.05) is None
        other.send(can.Message(arbitration_id=2))
        assert other.recv(60).arbitration_id == 2


# The connection alone: what a bus that fails, floods or comes back does to frames in and out


CLAIM = 0x18EEFF2A


@pytest.fixture
def buses():
    made = [can.Bus(interface="virtual", channel="link") for _ in range(2)]
    yield made
    for bus in made:
        bus.shutdown()


@pytest.fixture
def connection(buses):
    return BusConnection(buses[0], AddressClaim(name(1), 0x2A))


def frame(**fields):
    return can.Message(**{"arbitration_id": 0x0CF00400, "data": bytes(8), **fields})


def test_only_extended_data_frames_are_heard(connection, buses):
    others = ({"is_extended_id": False, "arbitration_id": 1}, {"is_remote_frame": True, "data": None}, {})
    for fields in others:
        buses[1].send(frame(**fields))
    assert connection.hear(0.0) == [(0x0CF00400, bytes(8))]
    assert connection.received == 1


def test_a_flood_is_taken_in_bursts(connection, buses):
    for _ in range(BURST + 10):
        buses[1].send(frame())
    assert len(connection.hear(0.0)) == BURST
    assert len(connection.hear(0.0)) == 10


@pytest.mark.parametrize("hears", [True, False])
def test_bus_off_is_silence_until_a_frame_is_heard_or_the_next_try(connection, buses, hears):
    connection.start(0.0)
    assert connection.claims(0.0) == [(CLAIM, name(1))]
    assert connection.up(0.3)
    buses[1].send(frame(arbitration_id=0x40, is_error_frame=True, is_extended_id=False))
    assert connection.hear(0.4) == []
    assert (connection.lost, connection.up(0.4)) == (True, False)
    assert connection.claims(0.4) == []
    if hears:
        buses[1].send(frame())
        assert connection.hear(0.41) == [(0x0CF00400, bytes(8))]
        assert connection.claims(0.41) == [(CLAIM, name(1))]
    else:
        assert connection.claims(0.4 + RETRY_S - 0.01) == []
        assert connection.claims(0.4 + RETRY_S) == [(CLAIM, name(1))]
    assert (connection.lost, connection.up(0.55)) == (False, True)


def test_a_bus_that_cannot_send_is_lost(connection, buses):
    assert connection.send(CLAIM, bytes(8), 0.0)
    assert connection.sent == 1
    buses[0].shutdown()
    assert not connection.send(CLAIM, bytes(8), 0.1)
    assert connection.lost
    assert connection.sent == 1


def test_a_bus_that_cannot_be_made_again_is_no_bus(connection, buses):
    def fails():
        raise OSError("gone")

    connection.reopen = fails
    buses[0].shutdown()
    assert not connection.send(CLAIM, bytes(8), 0.0)
    assert connection.claims(RETRY_S) == []
    assert not connection.send(CLAIM, bytes(8), RETRY_S)
    begun = time.monotonic()
    connection.wait(0.05)  # and does not spin
    assert time.monotonic() - begun >= 0.05


def test_what_ended_the_wait_is_heard_next(connection, buses):
    buses[1].send(frame())
    connection.wait(1.0)
    assert len(connection.hear(0.0)) == 1


def test_a_bus_that_is_off_at_the_start_is_claimed_by_the_next_try(connection, buses):
    buses[1].send(frame(arbitration_id=0x40, is_error_frame=True, is_extended_id=False))
    connection.start(0.0)
    assert connection.lost
    assert connection.claims(RETRY_S - 0.01) == []
    assert connection.claims(RETRY_S) == [(CLAIM, name(1))]


def test_a_flooded_bus_does_not_keep_the_bridge_from_starting(connection, buses, monkeypatch):
    monkeypatch.setattr(buses[0], "recv", lambda timeout: frame())
    connection.start(0.0)
    assert connection.claims(0.0) == [(CLAIM, name(1))]


def test_a_full_channel_says_so(channel):
    buses = []
    try:
        with pytest.raises(can.CanInitializationError, match="already has"):
            for _ in range(SLOTS + 1):
                buses.append(can.Bus(interface="loopback", channel=channel))
    finally:
        for bus in buses:
            bus.shutdown()
