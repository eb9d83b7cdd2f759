"""The picture of docs/mismatch_page.md: a report in a browser, with heat on an axis and a mark.

python benchmarks/picture_explorer.py --report found/report.html --out docs/figures/fading_by_hand.png
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

WIDTH, HEIGHT = 1240, 1130
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
BY_HAND = """<script>
for (const each of document.body.children) each.hidden = each.id !== "explorer";
for (const id of ["chosen", "finding-list"]) document.getElementById(id).hidden = true;
for (const [id, name] of [["regime-x", "brake"], ["regime-y", "braking power over 60 s"]]) {
  const choice = document.getElementById(id);
  choice.value = name;
  choice.dispatchEvent(new Event("change"));
}
const regime = document.getElementById("regime"), box = regime.getBoundingClientRect();
const at = (x, y) => ({clientX: box.left + x * box.width, clientY: box.top + y * box.height, button: 0});
const way = [["pointerdown", 0.36, 0.02], ["pointermove", 0.4, 0.3], ["pointerup", 0.46, 0.4]];
for (const [kind, x, y] of way) {
  regime.dispatchEvent(new PointerEvent(kind, at(x, y)));
}
</script>"""


def picture(report: Path, out: Path, browser: str) -> None:
    """Write the picture (PNG) of a report that has the braking power among its axes."""
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "page.html"
        page.write_text(report.read_text(encoding="utf-8").replace("</body>", f"{BY_HAND}</body>"), "utf-8")
        command = [
            browser, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars",
            f"--user-data-dir={folder}/profile", f"--window-size={WIDTH},{HEIGHT}",
            f"--screenshot={out.absolute()}", page.as_uri(),
        ]  # fmt: skip
        subprocess.run(command, check=True, timeout=120, stderr=subprocess.DEVNULL)


def main() -> int:
    """Entry point; 2 where there is no report or no browser."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--report", type=Path, required=True, help="report.html of a mismatch")
    parser.add_argument("--out", type=Path, required=True, help="picture to write, PNG")
    asked = parser.parse_args()
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if browser is None or not asked.report.is_file():
        missing = f"{asked.report} is no file; make it first" if browser else "no chromium here; install it"
        print(f"error: {missing}", file=sys.stderr)
        return 2
    picture(asked.report, asked.out, browser)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
