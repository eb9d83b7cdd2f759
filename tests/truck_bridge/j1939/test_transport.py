"""Messages of several frames: broadcasts and transfers received whole or not at all."""

from __future__ import annotations

import time

import can
import j1939
import pytest
from hypothesis import given
from hypothesis import strategies as st

from truck_bridge.j1939.transport import MOST, Transport, reference_torque

CONFIGURATION = bytes.fromhex("a816b13052c2e81cb96022c7c044cb8057ffff5504385e1446fa7dc780578600f702")
ENGINE, TOOL, GLOBAL = 0x00, 0xF9, 0xFF


def control(source, destination, *head, pgn=0xFEE3):
    return 0x1CEC0000 | destination << 8 | source, bytes([*head, *pgn.to_bytes(3, "little")])


def announced(size, source=ENGINE, destination=GLOBAL, pgn=0xFEE3, packets=None):
    kind = 32 if destination == GLOBAL else 16
    count = -(-size // 7) if packets is None else packets
    return control(source, destination, kind, size & 0xFF, size >> 8, count & 0xFF, 0xFF, pgn=pgn)


def asked(count, first, source=ENGINE, destination=TOOL, pgn=0xFEE3):
    """A CTS, which the receiver sends."""
    return control(destination, source, 17, count, first, 0xFF, 0xFF, pgn=pgn)


def packets(data, source=ENGINE, destination=GLOBAL):
    padded = data + b"\xff" * 7
    return [
        (0x1CEB0000 | destination << 8 | source, bytes([k + 1]) + padded[7 * k : 7 * k + 7])
        for k in range(-(-len(data) // 7))
    ]


def whole(data, source=ENGINE, destination=GLOBAL, pgn=0xFEE3):
    return [announced(len(data), source, destination, pgn), *packets(data, source, destination)]


def hear(frames, step=0.05, transport=None, start=0.0):
    """The messages and what broke, of frames `step` apart or with a time of their own."""
    transport, found, now = transport or Transport(), [], start
    for frame in frames:
        now = now + step if len(frame) == 2 else frame[2]
        message = transport.hear(*frame[:2], now)
        found += [message] if message else []
    return found, {(b.pgn, b.source, b.why): n for b, n in transport.broken.items()}


def test_a_broadcast_is_put_together_and_holds_the_reference_torque():
    """The engine configuration of the public recording: SPN 544 in bytes 20 and 21."""
    assert hear(whole(CONFIGURATION)) == ([(0xFEE3, ENGINE, GLOBAL, CONFIGURATION)], {})
    assert reference_torque(0xFEE3, CONFIGURATION) == 1109.0
    assert reference_torque(0xFEE1, CONFIGURATION) is None
    assert reference_torque(0xFEE3, CONFIGURATION[:20]) is None
    assert reference_torque(0xFEE3, CONFIGURATION[:19] + b"\xff\xfa") == 64255.0
    assert reference_torque(0xFEE3, CONFIGURATION[:19] + b"\x00\xfb") is None


@pytest.mark.parametrize("size", [9, 1785])
def test_all_sizes_are_heard(size):
    data = bytes(k % 251 for k in range(size))
    assert hear(whole(data))[0] == [(0xFEE3, ENGINE, GLOBAL, data)]


@pytest.mark.parametrize(("size", "count"), [(8, 2), (0, 0), (1786, 0), (20, 2), (20, 4)], ids=str)
def test_a_wrong_size_is_no_message(size, count):
    frames = [announced(size, packets=count), *packets(bytes(20))]
    assert hear(frames) == ([], {(0xFEE3, ENGINE, "wrong size"): 1})


@pytest.mark.parametrize(("pause", "received"), [(0.74, True), (0.76, False), (-0.76, False)])
def test_a_broadcast_waits_for_750_ms(pause, received):
    first, second, third = whole(bytes(14))
    before_the_first = [(*first, 10.0), (*second, 10.0 + pause), (*third, 10.0 + pause)]
    before_the_last = [(*first, 10.0), (*second, 10.1), (*third, 10.1 + pause)]
    for frames in (before_the_first, before_the_last):
        found, broken = hear(frames)
        assert (bool(found), broken) == (received, {} if received else {(0xFEE3, ENGINE, "timed out"): 1})


def test_a_transfer_with_its_receiver_s_words_is_heard_once():
    data = bytes(range(30))
    first, *rest = whole(data, destination=TOOL)
    end = control(TOOL, ENGINE, 19, 30, 0, 5, 0xFF)
    frames = [first, asked(2, 1), *rest[:2], asked(0, 255), asked(3, 3), *rest[2:], end]
    assert hear(frames) == ([(0xFEE3, ENGINE, TOOL, data)], {})


def test_a_packet_that_is_asked_for_again_replaces_what_came():
    data = bytes(range(30))
    first, *rest = whole(data, destination=TOOL)
    lost = [first, asked(5, 1), *rest[:2], rest[3], rest[4]]
    assert hear(lost) == ([], {})
    found, broken = hear([*lost, asked(3, 3), *rest[2:]])
    assert (found, broken) == ([(0xFEE3, ENGINE, TOOL, data)], {})
    assert hear([*lost, rest[2], rest[3], rest[4]])[0] == []  # nobody asked for them
    anew = [first, asked(5, 1), *rest[:3], asked(5, 1), *rest]
    assert hear(anew) == ([(0xFEE3, ENGINE, TOOL, data)], {})


@pytest.mark.parametrize("who", [(ENGINE, TOOL), (TOOL, ENGINE)], ids=["sender", "receiver"])
def test_a_transfer_is_aborted_by_either_end(who):
    frames = whole(bytes(30), destination=TOOL)
    abort = control(*who, 255, 1, 0xFF, 0xFF, 0xFF)
    assert hear([*frames[:3], abort, *frames[3:]]) == ([], {(0xFEE3, ENGINE, "aborted"): 1})
    of_another = control(*who, 255, 1, 0xFF, 0xFF, 0xFF, pgn=0xFECA)
    assert len(hear([*frames[:3], of_another, *frames[3:]])[0]) == 1
    of_another = asked(2, 5, pgn=0xFECA)
    assert len(hear([*frames[:3], of_another, *frames[3:]])[0]) == 1


@pytest.mark.parametrize(
    ("before", "pause", "received"),
    [
        (0, 1.24, True),  # T3: announced, not yet asked for
        (0, 1.26, False),
        (1, 1.24, True),  # T2: asked for
        (1, 1.26, False),
        (2, 0.74, True),  # T1: more of the window
        (2, 0.76, False),
        (3, 1.24, True),  # T3: the window is through
        (3, 1.26, False),
        (4, 1.04, True),  # T4: asked to wait
        (4, 1.06, False),
    ],
)
def test_each_step_of_a_transfer_has_its_time(before, pause, received):
    first, *rest = whole(bytes(30), destination=TOOL)
    frames = [first, asked(2, 1), *rest[:2], asked(0, 255), asked(3, 3), *rest[2:]]
    late = [(*f, 0.01 * k + (pause - 0.01 if k > before else 0.0)) for k, f in enumerate(frames)]
    found, broken = hear(late)
    assert (len(found), len(broken)) == ((1, 0) if received else (0, 1))


def test_a_flood_of_announcements_takes_bounded_memory_and_is_counted():
    transport = Transport()
    transfers = [announced(30, n % 250, n // 250) for n in range(3 * MOST)]
    broadcasts = [announced(8, n % 250, pgn=n) for n in range(3 * MOST)]  # of a wrong size
    hear([*transfers, *broadcasts], step=1e-4, transport=transport)
    found, _ = hear(whole(bytes(30)), start=0.13, transport=transport)
    assert len(found) == 1
    assert len(transport.finish()) <= MOST + 1
    assert sum(transport.broken.values()) == 6 * MOST


# any frames in any order

ADDRESS = st.sampled_from([0, 3, 0xF9, 0xFF])
PGN = st.sampled_from([0xFECA, 0xFEEC])
SIZE = st.sampled_from([8, 9, 14, 15])
ANY = st.one_of(
    st.tuples(st.integers(0, (1 << 29) - 1), st.binary(max_size=8)),
    st.builds(announced, SIZE, ADDRESS, ADDRESS, PGN, st.sampled_from([None, 0, 2, 3])),
    st.builds(asked, st.integers(0, 3), st.integers(0, 4), ADDRESS, ADDRESS, PGN),
    st.builds(
        lambda source, to, number, fill: (0x1CEB0000 | to << 8 | source, bytes([number, *[fill] * 7])),
        ADDRESS, ADDRESS, st.integers(0, 4), st.integers(0, 2),
    ),
    st.builds(
        lambda a, b, kind, pgn: control(a, b, kind, 14, 0, 2, 0xFF, pgn=pgn),
        ADDRESS, ADDRESS, st.sampled_from([19, 255, 0]), PGN,
    ),
)  # fmt: skip


@given(st.lists(st.tuples(ANY, st.floats(-1.0, 2.0)), max_size=60))
def test_any_frames_give_nothing_but_what_was_announced_and_came(frames):
    transport, now, past = Transport(), 0.0, []
    for frame, step in frames:
        now += step
        past.append(frame)
        message = transport.hear(*frame, now)
        if message is not None:
            assert message.data == _as_sent(message, past)
    transport.finish()


def _as_sent(message, past):
    """The newest announcement's size of the newest packets behind it, told anew from the frames alone."""
    ends = message.destination << 8 | message.source
    kind = 32 if message.destination == GLOBAL else 16
    sent = [(i & 0x3FFFFFF, d) for i, d in past if len(d) == 8]
    begins = [k for k, (i, d) in enumerate(sent) if i == 0xEC0000 | ends and d[0] == kind]
    head = sent[begins[-1]][1]
    size, count = int.from_bytes(head[1:3], "little"), head[3]
    assert (int.from_bytes(head[5:8], "little"), 9 <= size <= 1785) == (message.pgn, True)
    came = [d for i, d in sent[begins[-1] :] if i == 0xEB0000 | ends]
    assert came[-1][0] == count == -(-size // 7)
    newest = {d[0]: d[1:] for d in came}
    return b"".join(newest[k] for k in range(1, count + 1))[:size]


SENT = st.lists(
    st.tuples(st.sampled_from([0, 3]), st.sampled_from([GLOBAL, 0x17]), st.binary(min_size=9, max_size=40)),
    min_size=1,
    max_size=4,
)


@given(SENT, st.data())
def test_of_messages_that_lose_or_repeat_frames_only_whole_ones_are_heard(sent, data):
    """Each node sends one after the other, a second apart, as DM1 is; nodes talk at once."""
    frames, free = [], {}
    for source, destination, content in sent:
        at = free.get(source, 0.1 * source)
        for k, frame in enumerate(whole(content, source, destination)):
            times = data.draw(st.sampled_from([1, 1, 1, 1, 0, 2]), label="times received")
            frames += [(*frame, at + 0.05 * k)] * times
        free[source] = at + 0.05 * k + 1.3
    found, _ = hear(sorted(frames, key=lambda frame: frame[2]))
    said = [(0xFEE3, *message) for message in sent]
    assert len(found) <= len(said) and all(message in said for message in found)
    if len(frames) == len(set(frames)) == sum(1 + -(-len(content) // 7) for *_, content in sent):
        assert sorted(found) == sorted(said)


# another implementation


class Peer:
    """A node of can-j1939."""

    def __init__(self, channel, address):
        self.unit = j1939.ElectronicControlUnit(max_cmdt_packets=4)
        self.unit.connect(interface="virtual", channel=channel)
        its_name = j1939.Name(arbitrary_address_capable=0, manufacturer_code=1, identity_number=address)
        self.node = j1939.ControllerApplication(its_name, address)
        self.unit.add_ca(controller_application=self.node)
        self.node.start()

    @property
    def speaks(self):
        return self.node.state == j1939.ControllerApplication.State.NORMAL

    def close(self):
        self.node.stop()
        self.unit.disconnect()
        self.unit.stop()


def test_what_another_implementation_sends_is_heard():
    """can-j1939 broadcasts a message, and transfers another between two of its nodes."""
    channel, data = object(), bytes(range(40))
    bus = can.Bus(interface="virtual", channel=channel)
    peers = [Peer(channel, address) for address in (0x10, 0x20)]
    transport, found, kinds, until = Transport(), set(), set(), time.monotonic() + 120.0
    try:
        while not all(peer.speaks for peer in peers) and time.monotonic() < until:
            time.sleep(0.02)
        assert peers[0].node.send_pgn(0, 0xFE, 0xCA, 6, list(data))
        assert peers[0].node.send_pgn(0, 0xEF, 0x20, 6, list(data))
        while (len(found) < 2 or 19 not in kinds) and time.monotonic() < until:
            message = bus.recv(0.1)
            if message is not None:
                kinds |= {message.data[0]} if message.arbitration_id >> 16 & 0xFF == 0xEC else set()
                found.add(transport.hear(message.arbitration_id, bytes(message.data), message.timestamp))
                found.discard(None)
    finally:
        for peer in peers:
            peer.close()
        bus.shutdown()
    assert found == {(0xFECA, 0x10, GLOBAL, data), (0xEF00, 0x10, 0x20, data)}
    assert kinds == {16, 17, 19, 32}
    assert not transport.broken


def test_a_message_begun_anew_and_one_cut_off_are_counted():
    transport, frames = Transport(), whole(bytes(30))
    hear([*frames[:3], *frames[:2], announced(30, source=7)], transport=transport)
    found = {(b.source, b.why): n for b, n in transport.finish().items()}
    assert found == {(ENGINE, "begun anew"): 1, (ENGINE, "cut off"): 1, (7, "cut off"): 1}
