"""Serves a page to browsers on this machine: a socket on 127.0.0.1, an access token, and checks of requests.

Requests without the token are refused, and so are requests whose Host is not this machine, which would
otherwise let a foreign web page whose name resolves to 127.0.0.1 read the page (DNS rebinding). Standard
library only.
"""

from __future__ import annotations

import contextlib
import hmac
import json
import secrets
import socket
import sys
import threading
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import MappingProxyType
from typing import Any

from deeptruck_core.errors import InputError

LOCAL = "127.0.0.1"
HOSTS = (LOCAL, "localhost")
BACKLOG = 16
CONNECTIONS = 32  # at once
MAKES_ROOM = 0.5  # s in which the thread of a connection that is cut off ends
PATIENCE = 10.0  # s that a viewer may take for a request, or leave an answer unread, before it is cut off


@dataclass(frozen=True)
class Place:
    """A listening socket and the access token in its address."""

    listener: socket.socket
    token: str

    @property
    def address(self) -> str:
        """The address to open in a browser."""
        return f"http://{LOCAL}:{self.listener.getsockname()[1]}/{self.token}/"


def made(port: int = 0) -> Place:
    """A new socket and token on a port (0: a free one). Raises InputError if the port is in use."""
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((LOCAL, port))
    except OSError as error:
        listener.close()
        raise InputError(
            f"the page cannot have port {port}: {error.strerror}; choose another, or 0 for a free one"
        ) from None
    listener.listen(BACKLOG)
    return Place(listener, secrets.token_urlsafe(24))


class Server(ThreadingHTTPServer):
    """Serves a `Handler` at a place, with a content security `policy`. Each connection has a thread, so that
    viewers do not delay each other. If all are taken, a new connection replaces the oldest one that has not
    shown the token yet."""

    daemon_threads = True
    block_on_close = False

    def __init__(self, place: Place, handler: type[Handler], policy: str) -> None:
        super().__init__(place.listener.getsockname(), handler, bind_and_activate=False)
        self.socket.close()
        self.socket = place.listener
        self.place, self.policy = place, policy
        self._free = threading.Semaphore(CONNECTIONS)
        self._silent: dict[socket.socket, None] = {}  # connections without the token so far, oldest first
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True)

    def start(self) -> None:
        """Serve in a separate thread."""
        self._thread.start()

    def process_request(self, request: socket.socket | tuple[bytes, socket.socket], client: object) -> None:
        assert isinstance(request, socket.socket)
        if not self._free.acquire(blocking=False) and not (
            self._cut_off_silent() and self._free.acquire(timeout=MAKES_ROOM)
        ):
            self.shutdown_request(request)
            return
        with self._lock:
            self._silent[request] = None
        super().process_request(request, client)

    def _cut_off_silent(self) -> bool:
        """End the oldest connection that has not shown the token; False if all have."""
        with self._lock:
            oldest = next(iter(self._silent), None)
            if oldest is not None:
                del self._silent[oldest]
                with contextlib.suppress(OSError):  # it has just left by itself
                    oldest.shutdown(socket.SHUT_RDWR)
        return oldest is not None

    def is_known(self, request: object) -> None:
        """Called when a connection has shown the token."""
        with self._lock:
            self._silent.pop(request, None)  # type: ignore[call-overload]

    def process_request_thread(
        self, request: socket.socket | tuple[bytes, socket.socket], client: object
    ) -> None:
        try:
            super().process_request_thread(request, client)
        finally:
            self.is_known(request)
            self._free.release()

    def handle_error(self, request: object, client: object) -> None:
        """Ignore errors of viewers that left or were too slow; report others."""
        if not isinstance(sys.exc_info()[1], OSError):
            traceback.print_exc()


class Handler(BaseHTTPRequestHandler):
    """A request. Subclasses implement `get`, and `post` if `methods` permits it, for the part of the path
    after the token."""

    server: Server
    protocol_version = "HTTP/1.1"
    timeout = PATIENCE

    @property
    def methods(self) -> tuple[str, ...]:
        """Permitted methods of this path; other requests are refused unread."""
        return ("GET",)

    def get(self, rest: str) -> None:
        """Answer a GET."""
        self.answer(HTTPStatus.NOT_FOUND, b"There is one page here.\n")

    def post(self, rest: str) -> None:
        """Answer a POST."""

    def do_GET(self) -> None:
        if (rest := self._opened()) is not None:
            self.get(rest)

    def do_POST(self) -> None:
        if (rest := self._opened()) is not None:
            self.post(rest)

    def _opened(self) -> str | None:
        """The path after the token; None for a request that is refused or redirected, which is then
        answered."""
        token, slash, rest = self.path.removeprefix("/").partition("/")
        if not self._is_ours() or not hmac.compare_digest(token.encode(), self.server.place.token.encode()):
            self.answer(HTTPStatus.FORBIDDEN, b"Open the address that was printed.\n")
            return None
        self.server.is_known(self.request)
        if not slash:  # what the page requests lies next to it
            self.answer(HTTPStatus.PERMANENT_REDIRECT, b"", more={"Location": f"/{token}/"})
            return None
        return rest

    def parse_request(self) -> bool:
        """Refuse other methods."""
        understood, allowed = super().parse_request(), False
        if understood:
            allowed = self.command in self.methods
            if not allowed:
                self.answer(HTTPStatus.METHOD_NOT_ALLOWED, f"Only {', '.join(self.methods)}.\n".encode())
        return understood and allowed

    def _is_ours(self) -> bool:
        """Whether the request's Host is this machine, on any port because of tunnels."""
        hosts = self.headers.get_all("Host", [])
        return len(hosts) == 1 and hosts[0].partition(":")[0].lower() in HOSTS

    def answer(
        self,
        status: HTTPStatus,
        body: bytes,
        kind: str = "text/plain; charset=utf-8",
        more: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        """Send a complete response."""
        self.begin(status, kind, {"Content-Length": str(len(body)), **more})
        if self.command != "HEAD":
            self.wfile.write(body)

    def begin(self, status: HTTPStatus, kind: str, more: Mapping[str, str]) -> None:
        """Send the header of a response."""
        self.close_connection = True
        self.send_response_only(status)
        headers = {
            "Content-Type": kind,
            "Connection": "close",
            "Allow": ", ".join(self.methods),
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

    def posted(self, most: int) -> Any:
        """The JSON body of a request of up to `most` bytes; None for anything else."""
        length = self.headers.get("Content-Length", "")
        if not length.isdecimal() or int(length) > most:
            return None
        try:
            return json.loads(self.rfile.read(int(length)))
        except (ValueError, RecursionError):
            return None

    def log_message(self, format: str, *args: object) -> None:
        """Logs nothing, because the path contains the token."""
