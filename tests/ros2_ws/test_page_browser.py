"""The page in a browser before a real run: nodes and pages that hang and die, and two viewers."""

from __future__ import annotations

import os
import re
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import page_browser
import pytest
from page_browser import Page

from deeptruck_model.recordings.bag_source import BagSource
from deeptruck_nodes.messages import SECOND
from deeptruck_nodes.recorder import header_stamp

TRUCK = ("--simulator", "truck:trucksim", "--policy", "baseline:acc")
RATE = 50  # Hz
CONNECTED, LOST, SILENT = (
    f"document.getElementById('link').textContent.includes('{says}')"
    for says in ("Connected", "Connection lost", "No word from the run")
)

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(
        page_browser.CHROMIUM is None,
        reason="no chromium here; install it (apt-get install chromium) to look",
    ),
]


@pytest.fixture
def open_page(tmp_path: Path) -> Iterator[Callable[..., Page]]:
    with page_browser.opened(tmp_path / "profile") as open_page:
        yield open_page


def address(run: Any) -> str:
    """What the start script printed; returns when the run is driving."""
    said = ""
    for line in run.process.stdout:
        said += line
        if line.startswith("ready after"):
            (found,) = re.findall(r"^page: (http://127\.0\.0\.1:\d+/[\w-]{32}/)$", said, re.M)
            return str(found)
    raise AssertionError(f"never ready: {said} {run.finish()}")


def is_in(topic: str, state: str) -> str:
    return f"document.querySelector('[data-topic=\"{topic}\"]')?.getAttribute('class') === '{state}'"


def pauses(page: Page, name: str) -> set[int]:
    """Milliseconds between the samples of a series that the page holds."""
    times = page.get(f"data('{name}').t")
    assert len(times) > RATE
    return set(np.diff(times).tolist())


def unread(page: Page) -> list[str]:
    """What went wrong, but for the connections that this test cut itself."""
    return [each for each in page.errors if "net::ERR" not in each]


def test_a_run_is_watched_through_all_that_happens_to_it(
    start: Callable[..., Any], open_page: Callable[..., Page], all_gone: Callable[..., bool], tmp_path: Path
) -> None:
    options = ("--record", tmp_path / "bag", "--rate", RATE, "--monitor", "truck:trucksim", "--page")
    run = start("start_simulation.py", *TRUCK, "--leader", "sine", *options)
    where = address(run)
    page = open_page(where)
    page.wait(CONNECTED)
    for topic in ("/truck/twist", "/truck/command", "/mismatch/residual", "/diagnostics"):
        page.wait(is_in(topic, "fresh"))
    page.wait(f"data('speed').t.length > {2 * RATE}")
    assert pauses(page, "speed") == {1000 // RATE}  # every sample, once
    assert {"m/s", "m", "N m", "%", "m/s²"} == set(page.get("strips.map(strip => strip.unit)"))
    assert "without a safety core" in page.text("safety")
    second = open_page(where, 390, 844)
    second.wait(CONNECTED)
    assert second.get("document.documentElement.scrollWidth") == 390
    held = page.get("data('gap').t.length")
    page.call("Page.reload")
    page.wait(f"typeof data === 'function' && data('gap').t.length > {held}")  # the last minute comes again
    assert page.errors == [] and second.errors == []

    controller = run.children["controller"]
    os.kill(controller, signal.SIGSTOP)
    for viewer in (page, second):
        viewer.wait(is_in("/truck/command", "silent"))
        assert viewer.get(is_in("/truck/twist", "fresh"))
    page.wait("document.getElementById('health').textContent.includes('no command: coasting')")
    page.wait("document.getElementById('health').textContent.includes('○ controller')")
    os.kill(controller, signal.SIGCONT)
    page.wait(is_in("/truck/command", "fresh"))

    os.kill(run.children["live_page"], signal.SIGSTOP)
    page.wait(SILENT)
    os.kill(run.children["live_page"], signal.SIGCONT)
    page.wait(CONNECTED)
    os.kill(run.children["live_page"], signal.SIGKILL)
    for viewer in (page, second):
        viewer.wait(LOST)
    for viewer in (page, second):  # the page is started again, at the same address
        viewer.wait(CONNECTED)
        viewer.wait(is_in("/truck/twist", "fresh"))
    assert unread(page) == [] and unread(second) == []
    assert {each for viewer in (page, second) for each in viewer.asked} == {where, f"{where}events"}

    children = run.children
    os.kill(children["controller"], signal.SIGKILL)
    for viewer in (page, second):
        viewer.wait("document.getElementById('link').textContent.includes('has ended: controller failed')")
    code, _, errors = run.finish()
    assert code == 1 and "controller ended (killed by SIGKILL)" in errors
    assert "live_page ended (killed by SIGKILL)" in errors and "it is started again" in errors
    assert all_gone(children)
    with BagSource(tmp_path / "bag") as bag:
        stamps = np.array([header_stamp(data) for _, _, data in bag.messages({"/truck/twist"})])
    assert np.all(np.diff(stamps) == SECOND // RATE)  # whatever happened to the page, nothing is missing
    for log in run.logs.iterdir():
        assert where.split("/")[3] not in log.read_text()  # logs may be read by others


def test_the_safety_core_and_the_shield_are_shown(
    start: Callable[..., Any], open_page: Callable[..., Page]
) -> None:
    leader = ("--leader", "stop:speed=20,at=12,deceleration=7,wait=60", "--radar", "clean")
    options = ("--vehicle", "trucksim", "--policy", "baseline:acc", "--emulator", "--page")
    run = start("start_vehicle.py", *options, *leader)
    page = open_page(address(run))
    page.wait("document.getElementById('reasons').textContent.includes('nobody asks')")
    assert "Not engaged. State: standby." in page.text("safety")
    assert page.get("document.getElementById('why-not').hidden") is False
    run.process.send_signal(signal.SIGINT)
    assert run.finish()[0] == 0
    for attempt in range(3):  # on a machine that stands still for 0.1 s the core hands control back, rightly
        again = start("start_vehicle.py", *options, *leader, "--engage", runs=f"again{attempt}")
        page = open_page(address(again))
        page.wait("/Engaged|handed back/.test(document.getElementById('safety').textContent)")
        if "Engaged" in page.text("safety"):
            break
        again.process.send_signal(signal.SIGINT)
        assert again.finish()[0] == 0
    assert page.get("document.getElementById('why-not').hidden") is True
    page.wait("document.getElementById('shield').textContent.includes('It acts')")
    assert page.errors == []
    again.process.send_signal(signal.SIGINT)
    page.wait("document.getElementById('link').textContent.includes('has ended: you asked it to')")
    assert again.finish()[0] == 0


def test_a_replay_is_paused_and_moved_by_button_and_slider(
    start: Callable[..., Any], open_page: Callable[..., Page], tmp_path: Path
) -> None:
    options = ("--lockstep", "--duration", 60, "--record", tmp_path / "bag")
    run = start("start_simulation.py", *TRUCK, *options, runs="made")
    assert run.finish()[0] == 0
    run = start("replay_recording.py", tmp_path / "bag", "--page")
    page = open_page(address(run), 390, 844)
    page.wait("!document.getElementById('replay').hidden && newest > 500")
    assert page.get("document.documentElement.scrollWidth") == 390
    page.get("document.getElementById('pause').click()")
    page.wait("replay.paused === 1 && document.getElementById('recorded').textContent.endsWith('paused')")
    move = "seek.value = {0}; seek.dispatchEvent(new Event('input')); seek.dispatchEvent(new Event('change'))"
    page.get(f"(() => {{ const seek = document.getElementById('seek'); {move.format(40)} }})()")
    page.wait("replay.position === 40")
    page.get("document.getElementById('pause').click()")
    page.wait("replay.position > 41 && data('speed').last() !== null")
    page.get(f"(() => {{ const seek = document.getElementById('seek'); {move.format(10)} }})()")
    page.wait("replay.position < 30 && data('speed').t.length > 0 && newest < 30000")  # nothing of the future
    assert "of 6" in page.text("recorded") and page.errors == []
    run.process.send_signal(signal.SIGINT)
    page.wait("document.getElementById('pause').disabled && document.getElementById('seek').disabled")
    assert run.finish()[0] == 0


def test_a_page_that_hangs_does_not_keep_the_run_from_ending(
    start: Callable[..., Any], all_gone: Callable[..., bool]
) -> None:
    run = start("start_simulation.py", *TRUCK, "--page")
    address(run)
    time.sleep(1.0)
    children = run.children
    os.kill(children["live_page"], signal.SIGSTOP)
    run.process.send_signal(signal.SIGINT)
    assert run.finish()[0] == 0
    assert all_gone(children)
