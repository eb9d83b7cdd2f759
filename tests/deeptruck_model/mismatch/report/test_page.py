"""The page in a browser."""

from __future__ import annotations

import re
from pathlib import Path

import page_browser
import pytest

from deeptruck_model import mismatch
from deeptruck_model.mismatch import Mismatch


@pytest.mark.long
@pytest.mark.skipif(
    page_browser.CHROMIUM is None, reason="no chromium here; install it (apt-get install chromium) to look"
)
def test_the_rows_shown_are_printed_as_an_option_that_leaves_them_out(
    lazy_brake: Mismatch, tmp_path: Path
) -> None:
    mismatch.write(lazy_brake, tmp_path / "found")
    with page_browser.opened(tmp_path / "profile") as open_page:
        page = open_page((tmp_path / "found" / "report.html").as_uri(), 420, 800)
        page.wait("document.getElementById('drive').options.length > 2")
        page.get("drives.value = 0; view = null; against.value = 'speed'; draw()")
        assert re.match(r"simulated speed fits [\d.]+ %, off by [\d.]+ m/s \(rms\)", page.text("fit"))
        assert page.get("document.getElementById('leave').hidden")
        name, acts = lazy_brake.prepared[0].recording.name, "document.getElementById('leave').hidden"
        page.get("against.value = ''; data.segments = []; marked(20, 50)")
        assert page.text("without") == f"--without {name}:20.0:50.0" and not page.get(acts)
        page.get(f"data.segments = [{{drive: '{name}', from: 40, to: 60}}]; marked(20, 50)")
        assert page.get(acts)  # the rows in which a finding acts are what it was found by
        assert page.get("rows(data.drives[0], 'speed').step") == pytest.approx(0.1)  # as recorded
        at = "clientX: over.getBoundingClientRect().left + 200, clientY: over.getBoundingClientRect().top + 9"
        page.get(
            "const over = document.querySelector('.u-over');"
            f"over.dispatchEvent(new MouseEvent('mousemove', {{{at}, bubbles: true}}))"
        )
        page.wait("document.getElementById('cursor').textContent.includes(' s: speed ')")
        assert page.get("document.documentElement.scrollWidth") == 420
        assert page.errors == []
