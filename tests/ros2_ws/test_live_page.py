"""The live page as a viewer sees it in a browser, fed without nodes; and a run that is watched."""

from __future__ import annotations

import http.client
import os
import re
import signal
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import page_browser
import pytest
from page_browser import Page

from deeptruck_nodes import page_server
from deeptruck_nodes.messages import SECOND
from deeptruck_nodes.page_server import Server, View
from deeptruck_nodes.topics import COUNTED

LONG = 60.0  # s; on a busy machine
ABOUT = {
    "title": "truck:trucksim, baseline:acc",
    "units": {"engine_command": "N m", "brake_command": "percent"},
}
needs_browser = pytest.mark.skipif(
    page_browser.CHROMIUM is None, reason="no chromium here; install it (apt-get install chromium) to look"
)


@dataclass
class Run:
    """A served view, and what viewers asked of its replay."""

    view: View
    server: Server
    token: str
    asked: list[dict[str, float]] = field(default_factory=list)

    @property
    def port(self) -> int:
        return int(self.server.server_address[1])

    @property
    def address(self) -> str:
        return page_server.address(self.server.socket, self.token)

    def drive(self, seconds: range, **values: float) -> None:
        """Samples at 10 Hz over whole seconds, each a second's batch."""
        for second in seconds:
            for k in range(10):
                self.view.sample(second * SECOND + k * SECOND // 10, values)
            self.view.publish()

    def request(self, path: str, method: str = "GET", body: str | None = None) -> tuple[int, bytes]:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=LONG)
        try:
            connection.request(method, path, body)
            answer = connection.getresponse()
            return answer.status, answer.read()
        finally:
            connection.close()


@pytest.fixture
def run() -> Iterator[Run]:
    listener, token = page_server.opened()
    asked: list[dict[str, float]] = []
    view = View(ABOUT, COUNTED)
    made = Run(view, Server(listener, token, view, asked.append), token, asked)
    made.server.start()
    yield made
    made.server.close("")


@pytest.fixture
def open_page(tmp_path: Path) -> Iterator[Callable[..., Page]]:
    with page_browser.opened(tmp_path / "profile") as open_page:
        yield open_page


def sees(element: str, text: str) -> str:
    """That a viewer reads a text in an element, as JavaScript."""
    return f"document.getElementById('{element}').textContent.includes({text!r})"


@needs_browser
def test_a_viewer_sees_the_drive_who_drives_and_what_happened(
    run: Run, open_page: Callable[..., Page]
) -> None:
    core = {"state": "standby", "not_engaged_because": "no vehicle ahead", "no_load": "False"}
    run.drive(range(2), speed=20.0, engaged=0.0)
    run.view.report(2 * SECOND, "can_bridge", "ok", "standby", core)
    run.view.publish()
    page = open_page(run.address, 390, 844)
    page.wait(sees("reasons", "no vehicle ahead"))
    assert page.text("drives") == "The driver drives. Safety core: standby."
    driven = {"speed": 20.0, "leader_speed": 18.5, "gap": 41.26, "engine_command": 700.0}
    run.drive(range(2, 40), **driven, brake_command=0.0, engaged=1.0)
    engaged = {"state": "engaged", "not_engaged_because": "", "no_load": "True"}
    run.view.report(4 * SECOND, "can_bridge", "ok", "engaged", engaged)
    run.view.report(39 * SECOND, "controller", "ok", "following", {"shield_interventions": "1"})
    run.view.publish()
    page.wait(sees("nodes", "✓ controller: following"))
    shown = {"speed": "20.0 m/s", "gap": "41.3 m", "engine_command": "700.0 N m", "brake_command": "0.0 %"}
    assert {name: page.text(f"now-{name}") for name in shown} == shown
    assert page.text("drives") == "The controller drives. Safety core: engaged. Nothing is sent (no load)."
    assert page.get("document.documentElement.scrollWidth") == 390, "a phone scrolls down alone"
    run.drive(range(40, 44), speed=12.0)  # the controller and the radar hang
    page.wait(sees("now-speed", "12.0 m/s"))
    assert page.text("now-engine_command") == "– (700.0 N m, 4 s ago)" and "(4 s ago)" in page.text("drives")
    page.call("Page.reload")
    page.wait(sees("now-gap", "41.3 m, 4 s ago"))  # the last minute is shown again
    run.drive(range(44, 46), speed=15.0, engaged=-1.0, gap=float("nan"))
    run.view.report(45 * SECOND, "can_bridge", "error", "the controller is silent: stopping", engaged)
    run.view.publish()
    page.wait(sees("drives", "The bridge brakes, holds or fades by itself"))
    assert page.text("now-gap") == "–"
    events = page.get("[...document.getElementById('events').children].map(x => x.textContent)")
    assert events == [
        "45.0 s ✖ can_bridge: the controller is silent: stopping",
        "44.0 s ▲ the bridge brakes, holds or fades by itself",
        "39.0 s ▲ controller: the shield acted",
        "4.0 s ✓ can_bridge: engaged",
        "2.0 s ✓ the controller drives",
        "0.0 s ▲ the driver drives",
    ]
    assert page.errors == []


@needs_browser
@pytest.mark.parametrize(
    ("why", "kind", "says"),
    [
        ("60 s have passed", "silent", "○ The run has ended: 60 s have passed."),
        ("controller failed", "error", "✖ The run has ended: controller failed."),
    ],
)
def test_a_viewer_is_told_the_end(
    run: Run, open_page: Callable[..., Page], why: str, kind: str, says: str
) -> None:
    run.drive(range(2), speed=20.0)
    page = open_page(run.address)
    page.wait(sees("link", "Connected"))
    run.server.close(why)
    page.wait(sees("link", says))
    assert page.get("document.getElementById('link').className") == kind
    assert page.text("now-speed") == "20.0 m/s" and page.errors == []


@needs_browser
def test_a_viewer_pauses_and_moves_a_replay(run: Run, open_page: Callable[..., Page]) -> None:
    run.view.replay = {"position": 40.0, "duration": 60.0, "paused": 0.0, "may_seek": 1.0}
    run.drive(range(35, 40), speed=20.0)
    page = open_page(run.address)
    page.wait(sees("recorded", "40.0 of 60.0 s recorded"))
    page.get("document.getElementById('pause').click()")
    page.get("(() => { const seek = document.getElementById('seek'); seek.value = 10; seek.onchange(); })()")
    page.wait("document.getElementById('pause').disabled === false")
    until = time.monotonic() + LONG
    while len(run.asked) < 2 and time.monotonic() < until:
        time.sleep(0.02)
    assert sorted(run.asked, key=str) == [{"paused": 1.0}, {"seek": 10.0}]
    run.view.replay = {"position": 12.0, "duration": 60.0, "paused": 1.0, "may_seek": 0.0}
    run.drive(range(10, 12), speed=5.0)  # back in time: nothing of what was shown remains
    page.wait(sees("recorded", "12.0 of 60.0 s recorded, paused; a copy is recorded"))
    assert page.get("series.speed.t.length") <= 20 and page.text("now-speed") == "5.0 m/s"
    assert page.get("document.getElementById('seek').disabled") is True and page.errors == []


def test_only_who_has_the_address_is_answered(run: Run) -> None:
    status, body = run.request(f"/{run.token}/")
    assert status == 200 and body.startswith(b"<!doctype html>")
    assert run.request(f"/{run.token}/else")[0] == 404
    assert run.request(f"/{run.token}/replay", "POST", '{"seek": 12.5}')[0] == 204
    for path in ("/", "/events", f"/{run.token}", f"/{run.token[:-1]}/", f"/x/{run.token}/", "/%C3%A9/"):
        status, body = run.request(path)
        assert status == 403 and run.token.encode() not in body
    assert run.request("/x/replay", "POST", '{"paused": 1}')[0] == 403
    assert run.request(f"/{run.token}/", "PUT")[0] == 501
    assert run.asked == [{"seek": 12.5}] and run.server.server_address[0] == "127.0.0.1"


@pytest.mark.parametrize(
    "body", ["", "[]", "{", '{"speed": 2}', '{"seek": "1"}', '{"seek": NaN}', "[" * 150, "1" * 201]
)
def test_what_a_replay_cannot_do_is_refused(run: Run, body: str) -> None:
    assert run.request(f"/{run.token}/replay", "POST", body)[0] == 400 and not run.asked


def test_a_viewer_who_does_not_read_holds_up_nobody(run: Run) -> None:
    with socket.create_connection(("127.0.0.1", run.port)) as slow:
        slow.sendall(f"GET /{run.token}/events HTTP/1.1\r\n\r\n".encode())
        slow.recv(10)
        begun = time.monotonic()
        for second in range(1000):  # more than the buffers of a socket hold
            run.drive(range(second, second + 1), **dict.fromkeys(map(str, range(50)), 1.25))
        assert run.request(f"/{run.token}/")[0] == 200
        run.server.close("")
        assert time.monotonic() - begun < LONG


# Real runs


def address(run: Any) -> str:
    """What the start script printed; returns when the run is driving."""
    said = ""
    for line in run.process.stdout:
        said += line
        if line.startswith("ready after"):
            (found,) = re.findall(r"^page: (http://127\.0\.0\.1:\d+/[\w-]{32}/)$", said, re.M)
            return str(found)
    raise AssertionError(f"never ready: {said} {run.finish()}")


@needs_browser
@pytest.mark.long
def test_a_drive_over_can_is_watched_to_its_end(
    start: Callable[..., Any], open_page: Callable[..., Page]
) -> None:
    leader = ("--leader", "stop:speed=20,at=12,deceleration=7,wait=60", "--radar", "clean")
    options = ("--vehicle", "trucksim", "--policy", "baseline:acc", "--emulator", "--page", *leader)
    run = start("start_vehicle.py", *options)
    page = open_page(address(run))
    page.wait(sees("reasons", "nobody asks"))
    assert page.text("drives") == "The driver drives. Safety core: standby."
    run.process.send_signal(signal.SIGINT)
    assert run.finish()[0] == 0
    for attempt in range(3):  # on a machine that stands still for 0.1 s the core hands control back, rightly
        run = start("start_vehicle.py", *options, "--engage", runs=f"again{attempt}")
        where = address(run)
        page = open_page(where)
        page.wait(f"{sees('events', 'the controller drives')} || {sees('events', 'handed back')}")
        if "handed back" not in page.text("events"):
            break
        run.process.send_signal(signal.SIGINT)
        assert run.finish()[0] == 0
    page.wait(sees("events", "controller: the shield acted"))
    assert re.fullmatch(r"\d+\.\d m/s", page.text("now-speed")) and page.text("now-gap").endswith(" m")
    assert page.errors == []
    run.process.send_signal(signal.SIGINT)
    page.wait(sees("link", "has ended: you asked it to"))
    assert run.finish()[0] == 0
    for log in run.logs.iterdir():
        assert where.split("/")[3] not in log.read_text()  # logs may be read by others


@pytest.mark.long
def test_a_page_that_hangs_or_dies_changes_nothing(
    start: Callable[..., Any], all_gone: Callable[..., bool], eventually: Callable[..., None]
) -> None:
    for number in (signal.SIGSTOP, signal.SIGKILL):
        run = start(
            "start_simulation.py",
            "--simulator",
            "truck:trucksim",
            "--policy",
            "baseline:acc",
            "--page",
            runs=number.name,
        )
        address(run)
        children = run.children
        os.kill(children["live_page"], number)
        time.sleep(1.0)
        assert run.process.poll() is None
        run.process.send_signal(signal.SIGINT)
        code, _, errors = run.finish()
        assert code == 0 and ("live_page ended" in errors) == (number == signal.SIGKILL)
        assert all_gone(children)
