"""The page's server without ROS: who is let in, what a stream is, and that nobody holds up anybody."""

from __future__ import annotations

import http.client
import json
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress

import pytest

from deeptruck_core.errors import InputError
from deeptruck_core.pages import local
from deeptruck_core.pages.local import CONNECTIONS, PATIENCE
from deeptruck_nodes.page import assets, place
from deeptruck_nodes.page.server import ROOM, Server, Stream, Viewer

LONG = 60.0  # s; on a busy machine
Reply = tuple[int, dict[str, str], bytes]


@pytest.fixture
def server() -> Iterator[Server]:
    made = Server(local.made(), *assets.page(), Stream(lambda: json.dumps({"nodes": ["leader"]})))
    made.start()
    yield made
    made.close("the test is over")


def port(server: Server) -> int:
    return int(server.place.listener.getsockname()[1])


def ask(
    server: Server, path: str, method: str = "GET", host: str | None = None, body: str | None = None
) -> Reply:
    connection = http.client.HTTPConnection("127.0.0.1", port(server), timeout=LONG)
    try:
        connection.request(method, path, body, {} if host is None else {"Host": host})
        got = connection.getresponse()
        return got.status, {name.lower(): text for name, text in got.getheaders()}, got.read()
    finally:
        connection.close()


@contextmanager
def watching(server: Server) -> Iterator[http.client.HTTPResponse]:
    """A viewer's open stream."""
    connection = http.client.HTTPConnection("127.0.0.1", port(server), timeout=LONG)
    connection.request("GET", f"/{server.place.token}/events")
    got = connection.getresponse()
    try:
        yield got
    finally:
        got.close()
        connection.close()


def event(stream: http.client.HTTPResponse) -> tuple[str, str]:
    """The next event: kind and data. Comments and retry times are passed over."""
    found: dict[str, str] = {}
    while True:
        line = stream.readline().decode()
        assert line.endswith("\n"), "the stream has ended"
        if line == "\n" and "data" in found:
            return found["event"], found["data"]
        name, _, text = line.rstrip("\n").partition(": ")
        found[name] = text


def settled(server: Server, viewers: int) -> bool:
    until = time.monotonic() + LONG
    while len(server.stream.waiting) != viewers and time.monotonic() < until:
        time.sleep(0.01)
    return len(server.stream.waiting) == viewers


def test_the_page_is_served_to_who_knows_the_token(server: Server) -> None:
    status, headers, body = ask(server, f"/{server.place.token}/")
    assert status == 200 and body.startswith(b"<!doctype html>") and b"/*script*/" not in body
    assert headers["content-type"].startswith("text/html") and headers["cache-control"] == "no-store"
    assert "default-src 'none'" in headers["content-security-policy"]
    assert "unsafe-inline" not in headers["content-security-policy"]
    assert ask(server, f"/{server.place.token}/else")[0] == 404
    status, headers, _ = ask(server, f"/{server.place.token}")
    assert (status, headers["location"]) == (308, f"/{server.place.token}/")


def test_it_listens_on_this_machine_alone(server: Server) -> None:
    assert server.place.listener.getsockname()[0] == "127.0.0.1"
    assert server.place.address == f"http://127.0.0.1:{port(server)}/{server.place.token}/"


def test_two_places_have_two_tokens_of_many_characters() -> None:
    with local.made().listener, local.made().listener:
        tokens = {local.made().token for _ in range(5)}
    assert len(tokens) == 5 and min(map(len, tokens)) >= 32


@pytest.mark.parametrize("path", ["/", "/events", "/{token}x/", "/{part}/", "/x/{token}/", "//", "/é/"])
def test_a_wrong_or_missing_token_is_refused(server: Server, path: str) -> None:
    token = server.place.token
    path = path.format(token=token, part=token[:-1]).encode().decode("latin-1")
    with socket.create_connection(("127.0.0.1", port(server)), timeout=LONG) as raw:
        raw.sendall(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode("latin-1"))
        said = raw.recv(65536)
    assert said.startswith(b"HTTP/1.1 403") and token.encode() not in said


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "", "0.0.0.0", "[::1]"]
)
def test_another_host_is_refused_though_the_token_is_right(server: Server, host: str) -> None:
    assert ask(server, f"/{server.place.token}/", host=host)[0] == 403
    assert ask(server, f"/{server.place.token}/events", host=host)[0] == 403


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "localhost:8000", "LOCALHOST:1"])
def test_this_machine_by_any_port_is_let_in(server: Server, host: str) -> None:
    assert ask(server, f"/{server.place.token}/", host=host)[0] == 200


@pytest.mark.parametrize("hosts", ["", "Host: 127.0.0.1\r\nHost: evil.example\r\n"])
def test_no_host_or_two_are_refused(server: Server, hosts: str) -> None:
    with socket.create_connection(("127.0.0.1", port(server)), timeout=LONG) as raw:
        raw.sendall(f"GET /{server.place.token}/ HTTP/1.1\r\n{hosts}\r\n".encode())
        assert raw.recv(65536).startswith(b"HTTP/1.1 403")


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "PATCH", "OPTIONS", "HEAD", "CONNECT", "TRACE"])
def test_it_can_only_be_read(server: Server, method: str) -> None:
    status, headers, body = ask(server, f"/{server.place.token}/", method)
    assert (status, headers["allow"]) == (405, "GET") and b"doctype" not in body


@pytest.fixture
def replayed() -> Iterator[tuple[Server, list[dict[str, float]]]]:
    """The page of a replay, and what was asked of it."""
    asked: list[dict[str, float]] = []
    made = Server(local.made(), *assets.page(), Stream(lambda: "{}"), asked.append)
    made.start()
    yield made, asked
    made.close("")


def test_a_replay_is_asked_to_pause_and_to_move(replayed: tuple[Server, list[dict[str, float]]]) -> None:
    server, asked = replayed
    path = f"/{server.place.token}/replay"
    assert ask(server, path, "POST", body='{"paused": 1}')[0] == 204
    assert ask(server, path, "POST", body='{"seek": 12.5}')[0] == 204
    assert asked == [{"paused": 1.0}, {"seek": 12.5}]


@pytest.mark.parametrize(
    "body",
    [
        "",
        "[]",
        "{",
        '{"speed": 2}',
        '{"seek": "12"}',
        '{"seek": NaN}',
        "[" * 150,
        f'{{"seek": 1{" " * 200}}}',
    ],
)
def test_what_a_replay_cannot_do_is_refused(
    replayed: tuple[Server, list[dict[str, float]]], body: str
) -> None:
    server, asked = replayed
    assert ask(server, f"/{server.place.token}/replay", "POST", body=body)[0] == 400 and not asked


def test_a_replay_obeys_who_knows_the_token_alone(replayed: tuple[Server, list[dict[str, float]]]) -> None:
    server, asked = replayed
    path = f"/{server.place.token}/replay"
    assert ask(server, "/x/replay", "POST", body='{"paused": 1}')[0] == 403
    assert ask(server, path, "POST", "evil.example", '{"paused": 1}')[0] == 403
    assert ask(server, f"/{server.place.token}/", "POST", body='{"paused": 1}')[0] == 405
    assert ask(server, path, "PUT", body='{"paused": 1}')[0] == 405 and not asked


def test_without_a_replay_nothing_is_asked_of_the_run(server: Server) -> None:
    assert ask(server, f"/{server.place.token}/replay", "POST", body='{"paused": 1}')[0] == 405


def test_a_viewer_is_greeted_then_gets_each_batch_once(server: Server) -> None:
    server.stream.send('{"n":0}')
    with watching(server) as stream:
        assert stream.getheader("Content-Type") == "text/event-stream; charset=utf-8"
        assert event(stream) == ("hello", '{"nodes": ["leader"]}')
        assert event(stream) == ("batch", '{"n":0}')
        for n in range(1, 20):
            server.stream.send(json.dumps({"n": n}))
        assert [json.loads(event(stream)[1])["n"] for _ in range(19)] == list(range(1, 20))


def test_the_bytes_of_a_stream_are_those_of_server_sent_events(server: Server) -> None:
    server.stream.send("{}")
    with socket.create_connection(("127.0.0.1", port(server)), timeout=LONG) as raw:
        raw.sendall(f"GET /{server.place.token}/events HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
        said = b""
        while not said.endswith(b"{}\n\n"):
            said += raw.recv(4096)
    body = said.partition(b"\r\n\r\n")[2]
    assert body == b'retry: 1000\nevent: hello\ndata: {"nodes": ["leader"]}\n\nevent: batch\ndata: {}\n\n'


def test_a_second_viewer_and_one_that_comes_back_see_what_was(server: Server) -> None:
    with watching(server) as first:
        event(first)
        server.stream.send("1")
        with watching(server) as second:
            assert [event(second), event(second)][1] == ("batch", "1")
            server.stream.send("2")
            assert [event(first), event(first)] == [("batch", "1"), ("batch", "2")]
            assert event(second) == ("batch", "2")
    for n in (3, 4):  # a viewer that left is found when it is written to, a second time at the latest
        server.stream.send(str(n))
        time.sleep(0.1)
    assert settled(server, 0)
    with watching(server) as again:
        assert [event(again)[1] for _ in range(5)][1:] == ["1", "2", "3", "4"]


def test_one_that_does_not_read_loses_batches_and_delays_nobody(server: Server) -> None:
    batch = json.dumps("x" * 20_000)
    with watching(server) as quick, socket.create_connection(("127.0.0.1", port(server))) as slow:
        slow.sendall(f"GET /{server.place.token}/events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
        assert settled(server, 2) and event(quick)[0] == "hello"
        for _ in range(800):  # 16 MB: more than the buffers of a socket hold
            server.stream.send(batch)
            assert event(quick) == ("batch", batch)
        for _ in range(800):  # the kernel's buffers grow: until they have, some go out in between
            if sorted(server.stream.waiting) == [0, ROOM]:
                break
            server.stream.send(batch)
            assert event(quick) == ("batch", batch)
        assert sorted(server.stream.waiting) == [0, ROOM]


def test_a_viewer_is_told_how_much_it_lost() -> None:
    viewer = Viewer(room=3)
    for n in range(5):
        viewer.offer(f"{n};".encode())
    assert viewer.take() == b"event: lost\ndata: 2\n\n2;3;4;"
    assert viewer.take(timeout=0.01) == b""
    viewer.end()
    assert viewer.take() is None


def test_what_is_kept_is_bounded() -> None:
    stream = Stream(lambda: "{}", kept_bytes=10_000)
    for n in range(1000):
        stream.send(f"{n:0100d}")
    _, first = stream.join()
    assert 9_000 < len(first) < 10_200 and f"{999:0100d}".encode() in first


def test_a_viewer_that_stalls_midway_is_cut_off(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("deeptruck_nodes.page.server._Handler.timeout", 0.2)
    with socket.create_connection(("127.0.0.1", port(server)), timeout=LONG) as raw:
        raw.sendall(b"GET /half a req")
        assert raw.recv(100) == b""


def silent(server: Server) -> socket.socket:
    """A connection that asks for nothing."""
    return socket.create_connection(("127.0.0.1", port(server)), timeout=LONG)


def test_a_viewer_takes_the_place_of_the_oldest_connection_that_shows_no_token(server: Server) -> None:
    with ExitStack() as opened:
        stream = opened.enter_context(watching(server))
        idle = [opened.enter_context(silent(server)) for _ in range(CONNECTIONS + 8)]
        assert ask(server, f"/{server.place.token}/")[0] == 200
        assert [connection.recv(10) for connection in idle[:10]] == 10 * [b""]
        idle[-1].setblocking(False)
        with pytest.raises(BlockingIOError):  # still open
            idle[-1].recv(10)
        assert event(stream)[0] == "hello"


def test_too_many_viewers_are_turned_away_and_places_become_free_again(server: Server) -> None:
    with ExitStack() as opened:
        streams = [opened.enter_context(watching(server)) for _ in range(CONNECTIONS)]
        assert [event(stream)[0] for stream in streams] == CONNECTIONS * ["hello"]
        with silent(server) as one_more:
            assert one_more.recv(10) == b""
    answers: list[int] = []
    while not answers:
        server.stream.send("{}")  # by which it finds out that they are gone
        time.sleep(0.01)
        with suppress(ConnectionError):
            answers.append(ask(server, f"/{server.place.token}/")[0])
    assert answers == [200]


def test_the_end_is_said_and_waits_for_nobody() -> None:
    server = Server(local.made(), b"", "", Stream(lambda: "{}"))
    server.start()
    with watching(server) as stream, socket.create_connection(("127.0.0.1", port(server))) as silent:
        event(stream)
        silent.sendall(b"GET")
        begun = time.monotonic()
        closing = threading.Thread(target=server.close, args=("controller\nfailed",))
        closing.start()
        assert event(stream) == ("ended", "controller failed") and stream.readline() == b""
        closing.join(LONG)
        assert time.monotonic() - begun < PATIENCE


def test_a_port_that_is_taken_is_refused_in_one_line() -> None:
    with local.made().listener as held:
        number = held.getsockname()[1]
        with pytest.raises(InputError, match=f"cannot have port {number}.*choose another"):
            local.made(number)


def test_a_process_inherits_its_place_by_the_environment_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    assert place.inherited() is None
    with local.made().listener as listener:
        given = local.Place(listener.dup(), "a token")
        for name, text in place.environment(given).items():
            monkeypatch.setenv(name, text)
        got = place.inherited()
        assert got is not None and got.address == given.address
        assert place.inherited() is None  # it is not handed on to what this process starts
        given.listener.detach()
        got.listener.close()
