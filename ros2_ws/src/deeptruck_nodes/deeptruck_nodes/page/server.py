"""One page and its stream of events, for browsers on this machine. A replay can be paused and moved by POST;
everything else is read only.

Whoever does not know the token is refused. So is a request whose Host is not this machine: a web page whose
name was pointed at 127.0.0.1 would otherwise be read by whoever serves it (DNS rebinding).
"""

from __future__ import annotations

import hmac
import json
import math
import socket
import sys
import threading
import traceback
from collections import deque
from collections.abc import Callable, Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import MappingProxyType

from deeptruck_nodes.page.place import LOCAL, Place

HOSTS = (LOCAL, "localhost")
CONTROLS = {"paused", "seek"}  # what a viewer may ask of a replay: the fields of /replay/control
FORBIDDEN = b"Open the address that the start script printed.\n"
ROOM = 50  # batches that may wait for a viewer: 5 s of them
KEPT_BYTES = 4_000_000  # of newest batches, for a viewer that comes or comes back
CONNECTIONS = 32  # at once
PATIENCE = 10.0  # s that a viewer may take for a request, or leave a batch unread, before it is cut off
CONTROL_BYTES = 200  # of a request to the replay, at most
RETRY_MS = 1000  # until a browser that lost the page asks again


def event(kind: str, data: str) -> bytes:
    """A server-sent event; `data` is one line."""
    return f"event: {kind}\ndata: {data}\n\n".encode()


class Viewer:
    """What waits for one browser. Who offers never waits; the oldest gives way and is counted."""

    def __init__(self, room: int = ROOM) -> None:
        self._waiting: deque[bytes] = deque(maxlen=room)
        self._lost = 0
        self._over = False
        self._changed = threading.Condition()

    def offer(self, data: bytes) -> None:
        """Put an event in the queue."""
        with self._changed:
            self._lost += len(self._waiting) == self._waiting.maxlen
            self._waiting.append(data)
            self._changed.notify()

    @property
    def waiting(self) -> int:
        """How many events wait."""
        return len(self._waiting)

    def end(self) -> None:
        """Nothing more comes."""
        with self._changed:
            self._over = True
            self._changed.notify()

    def take(self, timeout: float = PATIENCE) -> bytes | None:
        """All that waits, with a word on what was lost before it; None once it is over."""
        with self._changed:
            if not self._waiting and not self._over:
                self._changed.wait(timeout)
            lost, self._lost = self._lost, 0
            said = [event("lost", str(lost))] if lost else []
            taken = b"".join([*said, *self._waiting])
            self._waiting.clear()
            return None if self._over and not taken else taken


class Stream:
    """The events of a run, to every viewer. A new one first gets a greeting and the newest batches."""

    def __init__(self, greeting: Callable[[], str], kept_bytes: int = KEPT_BYTES) -> None:
        self._greeting, self._room = greeting, kept_bytes
        self._kept: deque[bytes] = deque()
        self._kept_bytes = 0
        self._viewers: list[Viewer] = []
        self._over = False
        self._lock = threading.Lock()

    def send(self, data: str) -> None:
        """A batch to everyone; it is kept for those who come later, as long as there is room."""
        batch = event("batch", data)
        with self._lock:
            self._kept.append(batch)
            self._kept_bytes += len(batch)
            while self._kept_bytes > self._room:
                self._kept_bytes -= len(self._kept.popleft())
            for viewer in self._viewers:
                viewer.offer(batch)

    def join(self) -> tuple[Viewer, bytes]:
        """A new viewer, and what it is shown first."""
        viewer = Viewer()
        with self._lock:
            first = [f"retry: {RETRY_MS}\n".encode(), event("hello", self._greeting()), *self._kept]
            self._viewers.append(viewer)
            if self._over:
                viewer.end()
        return viewer, b"".join(first)

    def leave(self, viewer: Viewer) -> None:
        """A viewer is gone."""
        with self._lock:
            self._viewers.remove(viewer)

    def end(self, why: str) -> None:
        """The last event."""
        with self._lock:
            self._over = True
            for viewer in self._viewers:
                viewer.offer(event("ended", " ".join(why.split())))
                viewer.end()

    @property
    def waiting(self) -> list[int]:
        """How many events wait for each of those who watch."""
        with self._lock:
            return [viewer.waiting for viewer in self._viewers]


class Server(ThreadingHTTPServer):
    """The page and its stream at a place. A thread a connection, so that one viewer never delays another."""

    daemon_threads = True
    block_on_close = False

    def __init__(
        self,
        place: Place,
        page: bytes,
        policy: str,
        stream: Stream,
        control: Callable[[dict[str, float]], None] | None = None,
    ) -> None:
        """`control` takes what a viewer asks of the replay; None where there is none."""
        super().__init__(place.listener.getsockname(), _Handler, bind_and_activate=False)
        self.socket.close()
        self.socket = place.listener
        self.place, self.page, self.policy, self.stream = place, page, policy, stream
        self.control = control
        self._free = threading.Semaphore(CONNECTIONS)
        self._thread = threading.Thread(target=self.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True)

    def start(self) -> None:
        """Serve in a thread of its own."""
        self._thread.start()

    def close(self, why: str) -> None:
        """Tell the viewers, then stop; one that does not listen is not waited for."""
        self.stream.end(why)
        until = threading.Event()
        for _ in range(25):
            if not self.stream.waiting:
                break
            until.wait(0.02)
        self.shutdown()
        self.server_close()

    def process_request(self, request: socket.socket | tuple[bytes, socket.socket], client: object) -> None:
        if not self._free.acquire(blocking=False):
            self.shutdown_request(request)
            return
        super().process_request(request, client)

    def process_request_thread(
        self, request: socket.socket | tuple[bytes, socket.socket], client: object
    ) -> None:
        try:
            super().process_request_thread(request, client)
        finally:
            self._free.release()

    def handle_error(self, request: object, client: object) -> None:
        """A viewer that left, or was too slow, is no news; anything else is a fault of ours."""
        if not isinstance(sys.exc_info()[1], OSError):
            traceback.print_exc()


class _Handler(BaseHTTPRequestHandler):
    server: Server
    protocol_version = "HTTP/1.1"
    timeout = PATIENCE

    def do_GET(self) -> None:
        token, slash, rest = self.path.removeprefix("/").partition("/")
        if not self._is_allowed():
            self._answer(HTTPStatus.FORBIDDEN, FORBIDDEN)
        elif not slash:  # what the page asks for lies beside it
            self._answer(HTTPStatus.PERMANENT_REDIRECT, b"", more={"Location": f"/{token}/"})
        elif rest == "":
            self._answer(HTTPStatus.OK, self.server.page, "text/html; charset=utf-8")
        elif rest == "events":
            self._stream()
        else:
            self._answer(HTTPStatus.NOT_FOUND, b"There is one page here.\n")

    def do_POST(self) -> None:
        if not self._is_allowed():
            self._answer(HTTPStatus.FORBIDDEN, FORBIDDEN)
        elif (asked := self._asked()) is None or self.server.control is None:
            self._answer(HTTPStatus.BAD_REQUEST, b'Send {"paused": 0 or 1} or {"seek": seconds}.\n')
        else:
            self.server.control(asked)
            self._answer(HTTPStatus.NO_CONTENT, b"")

    def _asked(self) -> dict[str, float] | None:
        """Numbers by name out of a request's body; None where it is anything else."""
        length = self.headers.get("Content-Length", "")
        if not length.isdecimal() or int(length) > CONTROL_BYTES:
            return None
        try:
            values = json.loads(self.rfile.read(int(length)))
        except (ValueError, RecursionError):
            return None
        known = isinstance(values, dict) and values.keys() <= CONTROLS
        if not known or not all(isinstance(x, int | float) and math.isfinite(x) for x in values.values()):
            return None
        return {name: float(x) for name, x in values.items()}

    def parse_request(self) -> bool:
        """Nothing but GET, and POST to a replay, is looked at any further."""
        understood = super().parse_request()
        allowed = ("GET", "POST") if understood and self._is_replay() else ("GET",)
        if understood and self.command not in allowed:
            self._answer(HTTPStatus.METHOD_NOT_ALLOWED, b"This page is read only: GET.\n")
        return understood and self.command in allowed

    def _is_replay(self) -> bool:
        return self.server.control is not None and self.path.endswith("/replay")

    def _is_allowed(self) -> bool:
        """Whether who asks knows the token, and believes to talk to this machine, by whatever port a tunnel
        has."""
        token = self.path.removeprefix("/").partition("/")[0]
        hosts = self.headers.get_all("Host", [])
        ours = len(hosts) == 1 and hosts[0].partition(":")[0].lower() in HOSTS
        return ours and hmac.compare_digest(token.encode(), self.server.place.token.encode())

    def _answer(
        self,
        status: HTTPStatus,
        body: bytes,
        kind: str = "text/plain; charset=utf-8",
        more: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self._begin(status, kind, {"Content-Length": str(len(body)), **more})
        if self.command != "HEAD":
            self.wfile.write(body)

    def _begin(self, status: HTTPStatus, kind: str, more: dict[str, str]) -> None:
        self.close_connection = True
        self.send_response_only(status)
        headers = {
            "Content-Type": kind,
            "Connection": "close",
            "Allow": "GET",
            "Cache-Control": "no-store",
            "Content-Security-Policy": self.server.policy,
            "Cross-Origin-Resource-Policy": "same-origin",
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
            "X-Frame-Options": "DENY",
        }
        for name, value in {**headers, **more}.items():
            self.send_header(name, value)
        self.end_headers()

    def _stream(self) -> None:
        viewer, first = self.server.stream.join()
        try:
            self._begin(HTTPStatus.OK, "text/event-stream; charset=utf-8", {})
            self.wfile.write(first)
            while (batches := viewer.take()) is not None:
                self.wfile.write(batches or b": still here\n\n")
        finally:
            self.server.stream.leave(viewer)

    def log_message(self, format: str, *args: object) -> None:
        """Nothing: the path holds the token."""
