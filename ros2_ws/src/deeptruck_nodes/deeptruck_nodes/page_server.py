"""The live page of a run without ROS: what a viewer sees, and the server that shows it to browsers.

The server listens on 127.0.0.1 alone. Its address holds a random token, without which every request is
refused: other users of this machine do not know it, and neither does a foreign page in the same browser.
"""

from __future__ import annotations

import hmac
import json
import math
import os
import secrets
import socket
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources

from deeptruck_core import pages
from deeptruck_core.errors import InputError

LOCAL = "127.0.0.1"
SOCKET, TOKEN = "DEEPTRUCK_PAGE_SOCKET", "DEEPTRUCK_PAGE_TOKEN"
BATCHES = 600  # kept for a viewer who comes or comes back: the minute that the page can show
EVENTS = 40  # the newest that are listed
JUMP_MS = 5000  # by which the truck's stamps go on only if a replay was moved; they go back only then, too
PATIENCE = 10.0  # s that a viewer may take for a request, or leave an answer unread
CONTROLS = {"paused", "seek"}  # what a viewer may ask of a replay: the fields of /replay/control
CONTROL_BYTES = 200
DRIVERS = {
    1.0: "the controller drives",
    0.0: "the driver drives",
    -1.0: "the bridge brakes, holds or fades by itself",
}


class View:
    """What a viewer sees of a run: every sample of the last minute, and the present state of all else.

    Times are ms since the first stamp. `about` is what does not change: the page's title, units of commands.
    A status value named in `counted` is an event whenever it grows.
    """

    def __init__(self, about: Mapping[str, object], counted: Mapping[str, str]) -> None:
        self._about, self._counted = about, counted
        self._now = 0  # newest time of the truck's topics; a radar may have a clock of its own
        self._part = 0  # of a replay: another one begins where it is moved
        self._speed_at: int | None = None
        self._first: int | None = None
        self._samples: dict[str, tuple[list[int], list[float | None]]] = {}
        self._drives: float | None = None
        self._nodes: dict[str, tuple[str, str, float]] = {}  # level, message, and when it was heard
        self._safety: Mapping[str, str] = {}
        self._counts: dict[str, float] = {}
        self._events: deque[tuple[int, str, str, str]] = deque(maxlen=EVENTS)  # time, level, node, message
        self.replay: Mapping[str, float] = {}  # the newest /replay/state
        self._changed = threading.Condition()  # guards what follows, which the viewers' threads read
        self._batches: deque[str] = deque(maxlen=BATCHES)
        self._published = 0
        self._state = "{}"
        self.ended = False

    def sample(self, stamp: int, values: Mapping[str, float]) -> None:
        """Add a value to each of these series, with a stamp in ns."""
        at = self._time(stamp)
        if "speed" in values:
            if self._speed_at is not None and not 0 <= at - self._speed_at <= JUMP_MS:
                self._part, self._now = self._part + 1, at
                self._samples.clear()
                self._events.clear()
            self._speed_at = at
        if not values.keys() & {"gap", "leader_speed"}:
            self._now = max(self._now, at)
        for name, value in values.items():
            times, numbers = self._samples.setdefault(name, ([], []))
            times.append(at)
            numbers.append(round(value, 4) if math.isfinite(value) else None)
        drives = values.get("engaged")
        if drives in DRIVERS and drives != self._drives:
            self._drives = drives
            self._event(at, "ok" if drives == 1.0 else "warn", "", DRIVERS[drives])

    def report(self, stamp: int, node: str, level: str, says: str, values: Mapping[str, str]) -> None:
        """Add a status that a node published; a change of it is an event."""
        at = self._time(stamp)
        if self._nodes.get(node, ("ok", says))[:2] != (level, says):
            self._event(at, level, node, says)
        self._nodes[node] = (level, says, time.monotonic())
        if "not_engaged_because" in values:
            self._safety = {key: values.get(key, "") for key in ("state", "not_engaged_because", "no_load")}
        for name in self._counted.keys() & values.keys():
            count = float(values[name])
            if count > self._counts.get(name, 0.0):
                self._event(at, "warn", node, self._counted[name])
            self._counts[name] = count

    def _time(self, stamp: int) -> int:
        self._first = stamp if self._first is None else self._first
        return (stamp - self._first) // 1_000_000

    def _event(self, at: int, level: str, node: str, says: str) -> None:
        self._events.append((at, level, node, says))

    def publish(self, ended: str | None = None) -> None:
        """Show viewers what came since the last time; `ended`: why the run has ended, '' for no reason."""
        now = time.monotonic()
        state = {
            "about": self._about,
            "part": self._part,
            "now": self._now,
            "drives": None if self._drives is None else DRIVERS[self._drives],
            "safety": self._safety,
            "nodes": {name: (level, says, now - at) for name, (level, says, at) in self._nodes.items()},
            "events": list(self._events),
            "replay": self.replay,
            "ended": ended,
        }
        with self._changed:
            self._state = _json(state)
            self._batches.append(_json({"part": self._part, "samples": self._samples}))
            self._samples = {}
            self._published += 1
            self.ended = ended is not None
            self._changed.notify_all()

    def after(self, seen: int) -> tuple[int, str]:
        """The number of the newest batch, and a server-sent event with the state and the batches after number
        `seen`; waits for one. A viewer who is slower than all that is kept begins at the oldest."""
        with self._changed:
            self._changed.wait_for(lambda: self._published > seen, PATIENCE)
            new = min(self._published - seen, len(self._batches))
            batches = ",".join(list(self._batches)[len(self._batches) - new :])
            return self._published, f'data: {{"state":{self._state},"batches":[{batches}]}}\n\n'


def _json(value: object) -> str:
    return json.dumps(value, separators=(",", ":"), allow_nan=False)


def opened(port: int = 0) -> tuple[socket.socket, str]:
    """A listening socket on a port (0: a free one), and a new token. Raises InputError if it is taken."""
    try:
        return socket.create_server((LOCAL, port)), secrets.token_urlsafe(24)
    except OSError as error:
        raise InputError(
            f"the page cannot have port {port}: {error.strerror}; choose another, or 0 for a free one"
        ) from None


def inherited() -> tuple[socket.socket, str] | None:
    """Socket and token from the start script, which prints the address; None for a page started by hand.

    They come in the environment, which only the same user can read; parameter files and logs may be readable
    by everyone.
    """
    number, token = os.environ.pop(SOCKET, ""), os.environ.pop(TOKEN, "")
    return (socket.socket(fileno=int(number)), token) if number and token else None


def address(listener: socket.socket, token: str) -> str:
    """What a viewer opens in a browser."""
    return f"http://{LOCAL}:{listener.getsockname()[1]}/{token}/"


class Server(ThreadingHTTPServer):
    """Serves a view, each viewer in a thread, so that none delays another or the run. `control` receives what
    viewers ask of a replay."""

    daemon_threads = True

    def __init__(
        self,
        listener: socket.socket,
        token: str,
        view: View,
        control: Callable[[dict[str, float]], None] = lambda asked: None,
    ) -> None:
        super().__init__(listener.getsockname(), _Handler, bind_and_activate=False)
        self.socket.close()
        self.socket = listener
        self.token, self.view, self.control = token, view, control
        self.viewers: set[threading.Thread] = set()
        script = pages.shared(*pages.CHARTS) + _file("live_page.js")
        style = pages.shared(pages.CHART_STYLE) + _file("live_page.css")
        self.files = {
            "": ("text/html", _file("live_page.html").encode()),
            "page.js": ("text/javascript", script.encode()),
            "page.css": ("text/css", style.encode()),
        }

    def start(self) -> None:
        """Serve in a thread of its own."""
        threading.Thread(target=self.serve_forever, args=(0.1,), daemon=True).start()

    def close(self, why: str) -> None:
        """Tell the viewers why the run has ended, then stop, without waiting for one who does not listen."""
        self.view.publish(ended=why)
        until = time.monotonic() + 0.5
        for viewer in list(self.viewers):
            viewer.join(max(0.0, until - time.monotonic()))
        self.shutdown()
        self.server_close()

    def handle_error(self, request: object, client: object) -> None:
        """A viewer that left, or was too slow, is no error."""
        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client)  # type: ignore[arg-type]


class _Handler(BaseHTTPRequestHandler):
    server: Server
    timeout = PATIENCE

    def do_GET(self) -> None:
        what = self._asked_for()
        if what == "events":
            self._stream()
        elif what in self.server.files:
            self._answer(HTTPStatus.OK, *self.server.files[what])
        elif what is not None:
            self._answer(HTTPStatus.NOT_FOUND)

    def do_POST(self) -> None:
        what = self._asked_for()
        if what == "replay" and (asked := self._control()) is not None:
            self.server.control(asked)
            self._answer(HTTPStatus.NO_CONTENT)
        elif what is not None:
            self._answer(HTTPStatus.BAD_REQUEST)

    def _asked_for(self) -> str | None:
        """The path after the token; None, and an answer, for a request without it."""
        token, slash, what = self.path[1:].partition("/")
        if slash and hmac.compare_digest(token.encode(), self.server.token.encode()):
            return what
        self._answer(HTTPStatus.FORBIDDEN, "text/plain", b"Open the address that was printed.\n")
        return None

    def _control(self) -> dict[str, float] | None:
        """Numbers by name from the body of a request; None for anything else."""
        length = self.headers.get("Content-Length", "")
        if not length.isdecimal() or int(length) > CONTROL_BYTES:
            return None
        try:
            asked = json.loads(self.rfile.read(int(length)))
        except (ValueError, RecursionError):
            return None
        if not isinstance(asked, dict) or not asked.keys() <= CONTROLS:
            return None
        numbers = all(isinstance(x, int | float) and math.isfinite(x) for x in asked.values())
        return {name: float(x) for name, x in asked.items()} if numbers else None

    def _stream(self) -> None:
        self._head(HTTPStatus.OK, "text/event-stream")
        self.server.viewers.add(threading.current_thread())
        try:
            seen, over = 0, False
            while not over:
                over = self.server.view.ended
                seen, event = self.server.view.after(seen)
                self.wfile.write(event.encode())
        finally:
            self.server.viewers.discard(threading.current_thread())

    def _answer(self, status: HTTPStatus, kind: str = "text/plain", body: bytes = b"") -> None:
        self._head(status, kind)
        self.wfile.write(body)

    def _head(self, status: HTTPStatus, kind: str) -> None:
        self.send_response_only(status)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        self.send_header("Cache-Control", "no-store")
        self.send_header("Content-Security-Policy", "default-src 'self'; img-src data:")
        self.end_headers()

    def log_message(self, format: str, *args: object) -> None:
        """Logs nothing, because the path holds the token."""


def _file(name: str) -> str:
    return resources.files("deeptruck_nodes").joinpath(name).read_text(encoding="utf-8")
