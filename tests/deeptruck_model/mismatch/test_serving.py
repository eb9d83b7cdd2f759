"""The served page of a result, as its user has it: a command, a browser or HTTP, and Ctrl-C."""

from __future__ import annotations

import hashlib
import json
import os
import re
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import page_browser
import pytest
from small_drives import TRUCK, LazyBrake, drives

from deeptruck_model import recordings

MAIN = "from deeptruck_model.cli import main; main()"


def content(folder: Path) -> dict[str, str]:
    return {
        str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in sorted(folder.rglob("*"))
        if p.is_file()
    }


@pytest.fixture(scope="module")
def served(
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[tuple[subprocess.Popen[str], str, Path, Path]]:
    folder = tmp_path_factory.mktemp("served")
    truck = TRUCK.with_forces([], [LazyBrake()])
    for k, drive in enumerate(drives(truck, 4, 150.0)):
        recordings.write_bag(folder / f"drive{k}", [drive], interface=drive.interface)
    (temporary := folder / "tmp").mkdir()
    bags = [str(folder / f"drive{k}") for k in range(4)]
    command = [
        sys.executable,
        "-c",
        MAIN,
        "mismatch",
        "--simulator",
        "truck:trucksim",
        "--recordings",
        *bags[:3],
    ]
    # a shell's background job ignores SIGINT, and so would what it starts
    heeding = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)}
    process = subprocess.Popen(
        [*command, "--held-out", bags[3], "--out", str(folder / "found"), "--serve"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "TMPDIR": str(temporary)},
        **heeding,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        said = iter(process.stdout.readline, "")
        address = next(
            re.findall(r"http://127\.0\.0\.1:\d+/[\w-]{32}/", line)[0] for line in said if "page: " in line
        )
        yield process, address, folder / "found", temporary
    finally:
        process.kill()
        process.wait()


def asked(address: str, data: bytes | None = None, **headers: str) -> tuple[int, bytes]:
    try:
        request = urllib.request.Request(address, data, headers)
        with urllib.request.urlopen(request, timeout=20) as answer:
            return answer.status, answer.read()
    except urllib.error.HTTPError as error:
        return error.code, error.read()


def result_of(address: str) -> dict[str, Any]:
    """Of the running comparison, when it is done."""
    until = time.monotonic() + 250.0
    while (now := state(address))["state"] == "running":
        assert time.monotonic() < until
        time.sleep(0.2)
    assert now["state"] == "done", now
    result: dict[str, Any] = now["result"]
    return result


def state(address: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(asked(f"{address}state")[1])
    return found


@pytest.mark.long
@pytest.mark.skipif(
    page_browser.CHROMIUM is None, reason="no chromium here; install it (apt-get install chromium) to look"
)
def test_in_a_browser_rows_are_marked_and_all_is_compared_again(
    served: tuple[Any, str, Path, Path], tmp_path: Path
) -> None:
    _, address, _, _ = served
    with page_browser.opened(tmp_path / "profile") as open_page:
        page = open_page(address, 420, 800)
        page.wait("document.getElementById('compare').disabled")
        page.get("drives.value = 0; view = null; against.value = 'speed'; draw()")
        assert re.match(r"simulated speed fits [\d.]+ %, off by [\d.]+ m/s \(rms\)", page.text("fit"))
        page.get("view = [20, 50]; against.value = ''; draw()")
        assert page.text("without") == "--without drive0:20.0:50.0"
        assert page.get("rows(data.drives[0], 'speed').step") == 0.1  # as recorded
        page.get("canvas.onpointermove({clientX: canvas.getBoundingClientRect().left + 200})")
        page.wait("document.getElementById('cursor').textContent.includes(' s: speed ')")
        page.get("document.getElementById('correlations').open = true")
        page.wait("document.getElementById('ranked').textContent")
        page.get("view = null; document.getElementById('mark').click()")
        assert "Drag over rows first" in page.text("step") and page.text("marks") == ""
        page.get("view = [20, 60]; drives.value = 1; document.getElementById('mark').click()")
        assert "drive1, 20.0 to 60.0 s" in page.text("marks")
        page.get("document.getElementById('compare').click()")
        page.wait(
            "document.getElementById('again').textContent.includes('samples were left out')", within=250
        )
        assert page.get("document.documentElement.scrollWidth") == 420
        assert page.get("document.getElementById('again').querySelectorAll('table').length") == 2
        page.get("document.querySelector('#marks button').click()")
        assert page.text("marks") == "" and page.get("document.getElementById('compare').disabled")
        whole = open_page(page.get("document.querySelector('#again a').href"))
        whole.wait("document.body.textContent.includes('rows that were marked')")
        assert page.errors == [] and whole.errors == []


@pytest.mark.long
def test_rows_are_left_out_and_all_is_compared_again(served: tuple[Any, str, Path, Path]) -> None:
    process, address, out, temporary = served
    before = content(out)
    assert asked(address)[0] == 200 and state(address)["state"] != "running"
    assert asked(address, Host="elsewhere.example")[0] == 403
    assert asked(re.sub(r"/[\w-]{32}/", "/" + "a" * 32 + "/", address))[0] == 403
    reversed_ = b'[{"drive": "drive0", "from": 60.0, "to": 20.0}]'
    for wrong in (b"no json", b"{}", b"[1]", b'[{"drive": "a"}]', reversed_, b"[" * 200_000):
        assert asked(f"{address}again", wrong)[0] == 400
    marks = json.dumps([{"drive": "drive0", "from": 20.0, "to": 60.0}]).encode()
    assert asked(f"{address}again", marks)[0] == 202
    assert asked(f"{address}again", marks)[0] == 409  # one after the other
    result = result_of(address)
    assert result["left_out"] == pytest.approx(400, abs=5)
    assert result["headline"] and result["budget"] and result["errors"]
    if result["command"]:  # the one it shows takes its corrected simulator over
        done = subprocess.run(
            [sys.executable, "-c", MAIN, *result["command"].split()[1:]], capture_output=True, check=False
        )
        assert done.returncode == 0 and (out.parent / "found_without_rows" / "simulator.json").exists()
    status, page = asked(f"{address}again/{result['number']}/")
    assert status == 200 and b"rows that were marked" in page
    assert asked(f"{address}again/../found/")[0] == asked(f"{address}again/99/")[0] == 404
    everything = [{"drive": f"drive{k}", "from": 0.0, "to": 1e9} for k in range(3)]
    asked(f"{address}again", json.dumps(everything).encode())
    assert result_of(address)["headline"] == "Undetermined: no cause is established"
    assert content(out) == before
    (folder,) = temporary.iterdir()
    assert folder.name.startswith("deeptruck-again-")
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=20)
    assert process.returncode == 130 and errors.splitlines()[-1:] == ["deeptruck-model: interrupted"]
    assert "Traceback" not in errors and not list(temporary.iterdir()) and content(out) == before
