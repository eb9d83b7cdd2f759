"""Serves the page of a result on this machine; users can exclude rows there and repeat the comparison.

Repeated comparisons go to a temporary folder that is removed at the end; the result is not changed.
"""

from __future__ import annotations

import json
import shutil
import tempfile
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from http import HTTPStatus
from pathlib import Path
from typing import Any

from deeptruck_model import files
from deeptruck_model.errors import InputError
from deeptruck_model.mismatch.folders import apply_command
from deeptruck_model.mismatch.found import Mismatch
from deeptruck_model.mismatch.output import fill
from deeptruck_model.mismatch.prepare import Span
from deeptruck_model.mismatch.report import page
from deeptruck_model.pages import local

Say = Callable[[str], None]
Again = Callable[[Sequence[Span], Say], Mismatch]

POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
LARGEST = 100_000  # bytes of a request: some thousand marks
REPORT = "report.html"
DEFECT = "this went wrong; what did is on the terminal"


class Comparisons:
    """Runs comparisons one after another in a thread; results go to `folder`, and those the user keeps to
    `to`."""

    def __init__(self, found: Mismatch, again: Again, folder: Path, to: Path, units: str) -> None:
        self._found, self._again, self._folder, self._to = found, again, folder, to
        self._units = units
        self._state: dict[str, Any] = {"state": "idle"}
        self._count = 0
        self._lock = threading.Lock()

    @property
    def state(self) -> dict[str, Any]:
        """`state`: idle, running, done or refused; `step`: the present step, or the error; `result`."""
        return self._state

    def begin(self, spans: Sequence[Span]) -> bool:
        """Start a comparison without these rows; False while another one runs."""
        with self._lock:
            if self._state["state"] == "running":
                return False
            self._state = {"state": "running", "step": "comparing"}
            self._count += 1
        threading.Thread(target=self._compare, args=(spans, self._count), daemon=True).start()
        return True

    def _compare(self, spans: Sequence[Span], number: int) -> None:
        try:
            found = self._again(spans, self._say)
            folder = self._folder / str(number)
            folder.mkdir()
            command = apply_command(folder, self._to)
            fill(folder, found, command, self._units)
            result = {"number": number, "command": command if found.result.validated else ""}
            self._state = {"state": "done", "result": result | page.brief(found, self._found, self._units)}
        except (InputError, OSError) as error:
            self._state = {"state": "refused", "step": str(error)}
        except Exception:
            traceback.print_exc()
            self._state = {"state": "refused", "step": DEFECT}

    def _say(self, step: str) -> None:
        self._state = {"state": "running", "step": step}

    def page(self, number: str) -> bytes | None:
        """The page of a comparison; None if there is none."""
        file = self._folder / number / REPORT
        return file.read_bytes() if number.isdecimal() and file.exists() else None


class _Server(local.Server):
    def __init__(self, place: local.Place, text: bytes, comparisons: Comparisons) -> None:
        super().__init__(place, _Handler, POLICY)
        self.text, self.comparisons = text, comparisons


class _Handler(local.Handler):
    server: _Server

    @property
    def methods(self) -> tuple[str, ...]:
        return ("GET", "POST")

    def get(self, rest: str) -> None:
        folder, _, number = rest.rstrip("/").partition("/")
        text = self.server.text if rest == "" else None
        if folder == "again":
            text = self.server.comparisons.page(number)
        if text is not None:
            self.answer(HTTPStatus.OK, text, "text/html; charset=utf-8")
        elif rest == "state":
            self._json(HTTPStatus.OK, self.server.comparisons.state)
        else:
            super().get(rest)

    def post(self, rest: str) -> None:
        try:
            marks: Any = self.posted(LARGEST) if rest == "again" else None
            spans = [Span(str(m["drive"]), float(m["from"]), float(m["to"])) for m in marks]
            if not spans or not all(s.from_s < s.to_s for s in spans):
                raise ValueError
        except (ValueError, TypeError, KeyError):
            self._json(HTTPStatus.BAD_REQUEST, {})
            return
        begun = self.server.comparisons.begin(spans)
        self._json(HTTPStatus.ACCEPTED if begun else HTTPStatus.CONFLICT, {})

    def _json(self, status: HTTPStatus, data: dict[str, Any]) -> None:
        self.answer(status, json.dumps(data, allow_nan=False).encode(), "application/json")


@contextmanager
def served(found: Mismatch, out: Path, again: Again, units: str = "m/s") -> Iterator[str]:
    """Serve the page of the result in `out` while the block runs, with speeds in `units`; yields its address.
    `again` repeats the comparison without some rows."""
    folder = Path(tempfile.mkdtemp(prefix="deeptruck-again-"))
    with files.removing(lambda: shutil.rmtree(folder, ignore_errors=True)):
        text = page.html(found, apply_command(out), served=True, units=units).encode()
        server = _Server(
            local.made(), text, Comparisons(found, again, folder, Path(f"{out}_without_rows"), units)
        )
        server.start()
        try:
            yield server.place.address
        finally:
            server.shutdown()
            server.server_close()
