"""A browser controlled over a pipe by the DevTools protocol, without a port or a library."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None
)
PATIENCE = 120.0  # s for an answer


class Browser:
    """A browser process, in which `Page`s are opened."""

    def __init__(self, profile: Path) -> None:
        to_browser, ours_out = os.pipe()
        ours_in, from_browser = os.pipe()
        flags = [
            "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
            "--no-first-run", "--hide-scrollbars", "--disable-dev-shm-usage",
            "--disable-backgrounding-occluded-windows", "--disable-renderer-backgrounding",
            "--remote-debugging-pipe", f"--user-data-dir={profile}",
            "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
        ]  # fmt: skip
        # The browser reads descriptor 3 and writes descriptor 4.
        shell = f'exec "$@" 3<&{to_browser} 4>&{from_browser}'
        self.process = subprocess.Popen(
            ["bash", "-c", shell, "bash", str(CHROMIUM), *flags],
            pass_fds=(to_browser, from_browser), stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip
        os.close(to_browser)
        os.close(from_browser)
        self._out, self._in = os.fdopen(ours_out, "wb", 0), os.fdopen(ours_in, "rb")
        self._number = 0
        self._answers: dict[int, queue.Queue[dict[str, Any]]] = {}
        self._pages: dict[str, Page] = {}
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        text = b""
        while chunk := self._in.read1(65536):
            *whole, text = (text + chunk).split(b"\0")
            for message in map(json.loads, whole):
                if "id" in message:
                    self._answers.pop(message["id"]).put(message)
                elif page := self._pages.get(message.get("sessionId", "")):
                    page.received.append(message)

    def call(self, method: str, session: str = "", **parameters: Any) -> dict[str, Any]:
        """Call a method of the browser and wait for its answer."""
        self._number += 1
        number, answer = self._number, queue.Queue[dict[str, Any]]()
        self._answers[number] = answer
        message = {"id": number, "method": method, "params": parameters}
        self._out.write(json.dumps(message | ({"sessionId": session} if session else {})).encode() + b"\0")
        got = answer.get(timeout=PATIENCE)
        assert "error" not in got, (method, got["error"])
        result: dict[str, Any] = got["result"]
        return result

    def open(self, address: str, width: int = 1280, height: int = 900) -> Page:
        """A new page of this size."""
        target = self.call("Target.createTarget", url="about:blank", newWindow=True)["targetId"]
        session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        page = self._pages[session] = Page(self, session)
        for domain in ("Page", "Runtime", "Log"):
            page.call(f"{domain}.enable")
        page.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )
        page.call("Page.navigate", url=address)
        return page

    def close(self) -> None:
        """End the process and its children, which are a process group."""
        os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        self._out.close()


class Page:
    """One page: its content and its errors."""

    def __init__(self, browser: Browser, session: str) -> None:
        self._browser, self._session = browser, session
        self.received: list[dict[str, Any]] = []

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        return self._browser.call(method, self._session, **parameters)

    def get(self, expression: str) -> Any:
        """The value of a JavaScript expression in the page."""
        said = self.call("Runtime.evaluate", expression=expression, returnByValue=True)
        assert "exceptionDetails" not in said, said["exceptionDetails"]
        return said["result"].get("value")

    def text(self, of: str) -> str:
        """The text of an element by its id."""
        return str(self.get(f"document.getElementById('{of}').textContent"))

    def wait(self, expression: str, within: float = PATIENCE) -> None:
        """Wait until an expression is true."""
        until = time.monotonic() + within
        asked = f"(() => {{ try {{ return Boolean({expression}); }} catch {{ return false; }} }})()"
        while not self.get(asked):  # a page that is still loading has nothing to look at
            assert time.monotonic() < until, f"never: {expression}; {self.get('document.body.innerText')}"
            time.sleep(0.05)

    @property
    def errors(self) -> list[str]:
        """Errors and warnings on the console, of the page and the browser."""
        found = []
        for message in list(self.received):
            parameters = message["params"]
            if message["method"] == "Runtime.exceptionThrown":
                found.append(json.dumps(parameters["exceptionDetails"]))
            elif message["method"] == "Runtime.consoleAPICalled" and parameters["type"] in (
                "error",
                "warning",
            ):
                found.append(json.dumps(parameters["args"]))
            elif message["method"] == "Log.entryAdded" and parameters["entry"]["level"] in (
                "error",
                "warning",
            ):
                found.append(f"{parameters['entry']['text']} {parameters['entry'].get('url', '')}")
        return found


@contextlib.contextmanager
def opened(profile: Path) -> Iterator[Callable[..., Page]]:
    """A context with a browser, which ends with the block; yields the function that opens pages."""
    browser = Browser(profile)
    try:
        yield browser.open
    finally:
        browser.close()
