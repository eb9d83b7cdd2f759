"""The page in a browser."""

from __future__ import annotations

import html
import re
import shutil
import subprocess

import pytest
from found_mismatches import mismatch
from pages import pixels

from deeptruck_model.mismatch.report import page as report
from deeptruck_model.mismatch.report.what_now import Asked

MEASURE = """<script>
addEventListener("load", () => {
  const frame = document.querySelector("iframe"), inside = frame.contentDocument;
  const loaded = [...inside.images].every(image => image.naturalWidth > 99);
  document.title = [inside.documentElement.scrollWidth, frame.contentWindow.innerWidth, loaded];
});
</script>"""
CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None
)


@pytest.mark.skipif(
    CHROMIUM is None, reason="no chromium here; install it (apt-get install chromium) to look at the page"
)
@pytest.mark.parametrize("width", [390, 1200])
def test_it_opens_in_a_browser_without_sideways_scrolling(tmp_path, width):
    page = tmp_path / "page.html"
    report.write(mismatch("missing_physics"), tmp_path, Asked(tmp_path))
    inside = html.escape((tmp_path / "report.html").read_text("utf-8"), quote=True)
    page.write_text(f'<iframe width="{width}" height="900" srcdoc="{inside}"></iframe>{MEASURE}', "utf-8")
    command = [
        str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
        "--disable-dev-shm-usage", "--no-first-run", "--host-resolver-rules=MAP * ~NOTFOUND",
        f"--user-data-dir={tmp_path / 'profile'}", f"--window-size={width + 50},900",
    ]  # fmt: skip
    dumped = subprocess.run(
        [*command, "--dump-dom", page.as_uri()], capture_output=True, text=True, timeout=120, check=True
    )
    title = re.search(r"<title>(\d+),(\d+),(\w+)</title>", dumped.stdout)
    assert title, dumped.stderr[-500:]
    assert int(title[2]) == width
    assert int(title[1]) <= width
    assert title[3] == "true"
    shot = tmp_path / "shot.png"
    subprocess.run(
        [*command, f"--screenshot={shot}", page.as_uri()], capture_output=True, timeout=120, check=True
    )
    assert pixels(shot.read_bytes())[..., :3].std() > 0.05
