"""Draws figures/mismatch_report.png, the head of the report of the case in mismatch.md, by its code and
command and a Chromium without a window: `make docs` runs it before the site is built.
"""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
PICTURE = HERE / "figures" / "mismatch_report.png"
WIDTH, HEIGHT = 1000, 1060  # px
BROWSERS = ("chromium", "chromium-browser", "google-chrome")


def case() -> tuple[str, list[str]]:
    """The code that records the drives, and the words of the command that compares them."""
    text = (HERE / "mismatch.md").read_text(encoding="utf-8").partition("## A case to repeat")[2]
    code = re.findall(r"^```python\n(.*?)^```", text, re.S | re.M)[0]
    commands = re.findall(r"^```bash\n(.*?)^```", text, re.S | re.M)[0]
    return code, shlex.split(commands.splitlines()[0])


def main() -> None:
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        print(
            f"{PICTURE.name} stays as it is: there is none of {', '.join(BROWSERS)} to draw it",
            file=sys.stderr,
        )
        return
    code, (_, *words) = case()
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, "-c", code], cwd=folder, check=True)
        script = Path(sys.executable).with_name("deeptruck-model")
        subprocess.run([script, *words], cwd=folder, check=True, stdout=subprocess.DEVNULL)
        report = (Path(folder) / "found" / "report.html").as_uri()
        options = (
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--hide-scrollbars",
            "--virtual-time-budget=5000",
        )
        size = (f"--window-size={WIDTH},{HEIGHT}", f"--user-data-dir={folder}/profile")
        subprocess.run(
            [browser, *options, *size, f"--screenshot={PICTURE}", report], check=True, capture_output=True
        )


if __name__ == "__main__":
    main()
