"""The page in a browser, which is opened once: it is read, brushed, clicked, and read without scripts."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from found_mismatches import mismatch
from pages import pixels

from deeptruck_model.mismatch.report import page as report
from deeptruck_model.mismatch.report.what_now import Asked
from deeptruck_model.mismatch.result import Mismatch

WATCH = (Path(__file__).parent / "watch.js").read_text("utf-8")
CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None
)
VIEWS = ("track", "regime", "explained")

pytestmark = pytest.mark.skipif(
    CHROMIUM is None, reason="no chromium here; install it (apt-get install chromium) to look at the page"
)


def with_a_fault_first() -> Mismatch:
    """Two findings, of which the second has a curve: before a click the page shows the first."""
    found, fault = mismatch("missing_physics"), mismatch("measurement_fault").result.findings[-1]
    segments = tuple(replace(s, finding=1) for s in found.result.segments)
    findings = (fault, *found.result.findings)
    return replace(found, result=replace(found.result, findings=findings, segments=segments))


FRAMES = {  # what is in each frame, how wide it is, and what its page may do
    "explored": ("with a fault", 1200, ""),
    "phone": ("missing_physics", 390, ""),
    "undetermined": ("undetermined", 800, ""),
    "unscripted": ("missing_physics", 801, 'sandbox="allow-same-origin"'),
}


@pytest.fixture(scope="module")
def opened(once: Callable[[str, Callable[[Path], object]], Path]) -> tuple[dict[str, Any], bytes]:
    """What was seen in each frame, and a picture of it all."""
    folder = once("browser", _open)
    shot = folder / "shot.png"
    return json.loads((folder / "seen.json").read_text()), shot.read_bytes() if shot.exists() else b""


def _open(folder: Path) -> None:
    """Open the pages in a browser; what was seen goes to seen.json."""
    folder.mkdir()
    sources = {"with a fault": with_a_fault_first()}
    sources |= {kind: mismatch(kind) for kind in ("missing_physics", "undetermined")}
    written = {}
    for kind, found in sources.items():
        report.write(found, folder, Asked(folder))
        written[kind] = html.escape((folder / "report.html").read_text("utf-8"), quote=True)
    frames = [
        f'<iframe id="{name}" width="{width}" height="2600" {may} srcdoc="{written[kind]}"></iframe>'
        for name, (kind, width, may) in FRAMES.items()
    ]
    page = folder / "page.html"
    page.write_text(f"{''.join(frames)}<script>{WATCH}</script>", "utf-8")
    command = [
        str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
        "--disable-dev-shm-usage", "--no-first-run", "--host-resolver-rules=MAP * ~NOTFOUND",
        f"--user-data-dir={folder / 'profile'}", "--window-size=1280,2700",
    ]  # fmt: skip
    shot = folder / "shot.png"
    done = subprocess.run(
        [*command, "--dump-dom", f"--screenshot={shot}", page.as_uri()],
        capture_output=True, text=True, timeout=180, check=True,
    )  # fmt: skip
    title = re.search(r"<title>(.*?)</title>", done.stdout)
    assert title, done.stderr[-500:]
    seen = json.loads(html.unescape(title[1]))
    assert "error" not in seen, seen["error"]
    (folder / "seen.json").write_text(json.dumps(seen))


Opened = tuple[dict[str, Any], bytes]


@pytest.mark.parametrize("frame", FRAMES)
def test_it_opens_in_a_browser_without_sideways_scrolling(opened: Opened, frame: str) -> None:
    seen = opened[0][frame]
    assert seen["frame"] == FRAMES[frame][1]
    assert seen["wide"] <= seen["frame"]
    assert seen["loaded"]


def test_a_stretch_brushed_on_the_timeline_is_marked_in_the_other_views(opened: Opened) -> None:
    seen = opened[0]["explored"]
    assert all(seen["before"][view] == 0 for view in ("time", *VIEWS))
    assert all(seen["brushed"][view] > 50 for view in ("time", *VIEWS))
    assert seen["before"]["said"].startswith("Nothing is marked")
    assert re.match(r"Marked: \d\d s in drive <0> \d+ to \d+ s\. Mean speed ", seen["brushed"]["said"])
    assert seen["zoomed"]["time"] > 2 * seen["brushed"]["time"]


def test_what_is_brushed_elsewhere_is_marked_on_the_timeline(opened: Opened) -> None:
    seen = opened[0]["explored"]
    assert all(seen["brushedElsewhere"][view] > 50 for view in ("time", *VIEWS))
    assert seen["brushedElsewhere"]["said"] != seen["keyed"]["said"]


def test_keys_mark_and_take_the_mark_away(opened: Opened) -> None:
    seen = opened[0]["explored"]
    assert seen["escaped"]["time"] == 0 and seen["escaped"]["said"].startswith("Nothing is marked")
    assert seen["keyed"]["time"] > 0 and seen["keyed"]["said"].startswith("Marked: ")


def test_a_click_on_a_finding_shows_its_curve_its_stretches_and_the_held_out_errors(opened: Opened) -> None:
    seen = opened[0]["explored"]
    assert seen["before"]["curve"] == 0 and seen["clicked"]["curve"] > 200
    assert seen["pressed"] == "true"
    assert seen["clicked"]["said"].startswith("Marked: 90 s in drive <0> 20 to 50 s, drive <1> 20 to 50 s")
    assert seen["errors"] == 3  # a heading and two drives


def test_a_drive_below_the_others_is_brought_to_sight_when_it_alone_is_marked(opened: Opened) -> None:
    seen = opened[0]["explored"]
    assert seen["below"] and seen["shown"]
    assert seen["last"]["said"].startswith("Marked: 30 s in drive <2>")


def test_without_scripts_the_figures_are_open_and_the_views_are_away(opened: Opened) -> None:
    seen = opened[0]
    assert not seen["unscripted"]["explorer"] and all(seen["unscripted"]["open"])
    assert seen["explored"]["explorer"] and not any(seen["explored"]["open"])
    assert len(seen["unscripted"]["open"]) == 2


def test_where_nothing_could_be_compared_the_drives_are_explored_still(opened: Opened) -> None:
    assert opened[0]["undetermined"]["explorer"]


def test_a_picture_of_it_shows_something(opened: Opened) -> None:
    assert pixels(opened[1])[..., :3].std() > 0.05
