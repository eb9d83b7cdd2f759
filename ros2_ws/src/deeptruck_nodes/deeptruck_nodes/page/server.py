"""HTTP server of the live page and its event stream, for browsers on this machine. POST pauses or moves a
replay; everything else is read only.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Callable
from http import HTTPStatus

from deeptruck_core.pages import local
from deeptruck_core.pages.local import PATIENCE, Place

CONTROLS = {"paused", "seek"}  # what a viewer may ask of a replay: the fields of /replay/control
ROOM = 50  # batches that may wait for a viewer: 5 s of them
KEPT_BYTES = 4_000_000  # of newest batches, for a viewer that comes or comes back
CONTROL_BYTES = 200  # of a request to the replay, at most
RETRY_MS = 1000  # until a browser that lost the page asks again


def event(kind: str, data: str) -> bytes:
    """A server-sent event; `data` is one line."""
    return f"event: {kind}\ndata: {data}\n\n".encode()


class Viewer:
    """Queue of events for one browser. `offer` never blocks: if the queue is full, its oldest event is
    dropped and counted."""

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
        """Number of events in the queue."""
        return len(self._waiting)

    def end(self) -> None:
        """Mark the end of the run: no further events follow."""
        with self._changed:
            self._over = True
            self._changed.notify()

    def take(self, timeout: float = PATIENCE) -> bytes | None:
        """All waiting batches, after a note on batches that were dropped; None after the end of the run."""
        with self._changed:
            if not self._waiting and not self._over:
                self._changed.wait(timeout)
            lost, self._lost = self._lost, 0
            said = [event("lost", str(lost))] if lost else []
            taken = b"".join([*said, *self._waiting])
            self._waiting.clear()
            return None if self._over and not taken else taken


class Stream:
    """Sends the events of a run to every viewer. A new viewer first gets a greeting and the newest
    batches."""

    def __init__(self, greeting: Callable[[], str], kept_bytes: int = KEPT_BYTES) -> None:
        self._greeting, self._room = greeting, kept_bytes
        self._kept: deque[bytes] = deque()
        self._kept_bytes = 0
        self._viewers: list[Viewer] = []
        self._over = False
        self._lock = threading.Lock()

    def send(self, data: str) -> None:
        """Send a batch to every viewer, and keep it for later viewers; the oldest batches are discarded
        first."""
        batch = event("batch", data)
        with self._lock:
            self._kept.append(batch)
            self._kept_bytes += len(batch)
            while self._kept_bytes > self._room:
                self._kept_bytes -= len(self._kept.popleft())
            for viewer in self._viewers:
                viewer.offer(batch)

    def join(self) -> tuple[Viewer, bytes]:
        """A new viewer, and the events it gets first."""
        viewer = Viewer()
        with self._lock:
            first = [f"retry: {RETRY_MS}\n".encode(), event("hello", self._greeting()), *self._kept]
            self._viewers.append(viewer)
            if self._over:
                viewer.end()
        return viewer, b"".join(first)

    def leave(self, viewer: Viewer) -> None:
        """Remove a viewer."""
        with self._lock:
            self._viewers.remove(viewer)

    def end(self, why: str) -> None:
        """Send the last event."""
        with self._lock:
            self._over = True
            for viewer in self._viewers:
                viewer.offer(event("ended", " ".join(why.split())))
                viewer.end()

    @property
    def waiting(self) -> list[int]:
        """Number of queued events of each viewer."""
        with self._lock:
            return [viewer.waiting for viewer in self._viewers]


class Server(local.Server):
    """Serves the page and its event stream at an address."""

    def __init__(
        self,
        place: Place,
        page: bytes,
        policy: str,
        stream: Stream,
        control: Callable[[dict[str, float]], None] | None = None,
    ) -> None:
        """`control` receives the viewers' requests to the replay; None if there is no replay."""
        super().__init__(place, _Handler, policy)
        self.page, self.stream, self.control = page, stream, control

    def close(self, why: str) -> None:
        """Send the end to the viewers, then stop, without waiting for viewers that do not respond."""
        self.stream.end(why)
        until = threading.Event()
        for _ in range(25):
            if not self.stream.waiting:
                break
            until.wait(0.02)
        self.shutdown()
        self.server_close()


class _Handler(local.Handler):
    server: Server

    @property
    def methods(self) -> tuple[str, ...]:
        replays = self.server.control is not None and self.path.endswith("/replay")
        return ("GET", "POST") if replays else ("GET",)

    def get(self, rest: str) -> None:
        if rest == "":
            self.answer(HTTPStatus.OK, self.server.page, "text/html; charset=utf-8")
        elif rest == "events":
            self._stream()
        else:
            super().get(rest)

    def post(self, rest: str) -> None:
        if (asked := self._asked()) is None or self.server.control is None:
            self.answer(HTTPStatus.BAD_REQUEST, b'Send {"paused": 0 or 1} or {"seek": seconds}.\n')
        else:
            self.server.control(asked)
            self.answer(HTTPStatus.NO_CONTENT, b"")

    def _asked(self) -> dict[str, float] | None:
        """Numbers by name from a request's body; None for anything else."""
        values = self.posted(CONTROL_BYTES)
        known = isinstance(values, dict) and values.keys() <= CONTROLS
        if not known or not all(isinstance(x, int | float) and math.isfinite(x) for x in values.values()):
            return None
        return {name: float(x) for name, x in values.items()}

    def _stream(self) -> None:
        viewer, first = self.server.stream.join()
        try:
            self.begin(HTTPStatus.OK, "text/event-stream; charset=utf-8", {})
            self.wfile.write(first)
            while (batches := viewer.take()) is not None:
                self.wfile.write(batches or b": still here\n\n")
        finally:
            self.server.stream.leave(viewer)
