"""The page, and its figure over speed."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import page_browser
import pytest
from small_drives import evidence

from deeptruck_model import mismatch
from deeptruck_model.mismatch import Mismatch
from deeptruck_model.mismatch.report.page import _binned, _rows, force_over_speed


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
        page.get("view = [20, 50]; against.value = ''; draw()")
        name = lazy_brake.prepared[0].recording.name
        assert page.text("without") == f"--without {name}:20.0:50.0"
        assert page.get("rows(data.drives[0], 'speed').step") == pytest.approx(0.1)  # as recorded
        at = "clientX: over.getBoundingClientRect().left + 200, clientY: over.getBoundingClientRect().top + 9"
        page.get(
            "const over = document.querySelector('.u-over');"
            f"over.dispatchEvent(new MouseEvent('mousemove', {{{at}, bubbles: true}}))"
        )
        page.wait("document.getElementById('cursor').textContent.includes(' s: speed ')")
        page.get("document.getElementById('correlations').open = true")
        page.wait("document.getElementById('ranked').textContent")
        assert page.get("document.documentElement.scrollWidth") == 420
        assert page.errors == []


def test_a_force_that_acts_only_while_coasting_is_seen_there_alone() -> None:
    e = evidence(noise=0.0)
    n = len(e)
    coasts = np.arange(n) % 200 < 100
    speed = np.linspace(2.0, 24.0, 200)[np.arange(n) % 200]
    signals = {**e.signals, "speed": speed, "engine_command": np.where(coasts, 0.0, 50.0)}
    e = replace(e, residual=np.where(coasts, -0.1, 0.0), signals=signals)
    rows = _rows(e)
    pulling, coasting = (list(_binned(e, rows[name])) for name in ("pulling", "coasting"))
    assert {median for _, _, median, _ in pulling} == {0.0}
    force = -0.1 * e.unit.scale
    assert np.allclose([median for _, _, median, _ in coasting], force)
    assert max(s for s, *_ in coasting) < min(s for s, *_ in pulling) + 3.0
    picture = force_over_speed(e, "km/h")
    assert len(re.findall("<polyline", picture)) == 2 and "speed, km/h" in picture
    shown = [float(x) for x in re.findall(r"middle\">([0-9]+)<", picture)]
    assert 70.0 < max(shown) < 90.0


def test_nothing_compared_has_no_picture() -> None:
    e = evidence()
    assert force_over_speed(replace(e, valid=np.zeros(len(e), dtype=bool))) == ""
