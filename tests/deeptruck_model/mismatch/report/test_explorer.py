"""The explorer of the page: its columns, and what it shows in a browser."""

from __future__ import annotations

import base64
import re
from pathlib import Path
from typing import Any

import numpy as np
import page_browser
import pytest

from deeptruck_model import mismatch
from deeptruck_model.mismatch import Mismatch
from deeptruck_model.mismatch.correction.fit_result import Errors
from deeptruck_model.mismatch.report.explorer_data import along, packed


def unpacked(column: dict[str, Any]) -> np.ndarray[Any, np.dtype[np.float64]]:
    codes = np.frombuffer(base64.b64decode(column["codes"]), "<u2")
    return np.where(codes == 65535, np.nan, column["low"] + column["by"] * codes)


def test_a_column_is_kept_to_a_65_thousandth_of_its_range() -> None:
    x = np.random.default_rng(0).normal(12.0, 5.0, 500)
    x[40:60] = np.nan
    column = packed(x, 0.1, 1)
    assert column["step"] == 0.1
    np.testing.assert_allclose(unpacked(column), x, atol=float(np.nanmax(x) - np.nanmin(x)) / 65534)


@pytest.mark.parametrize(("x", "kept"), [(np.full(6, 3.5), 3.5), (np.full(6, np.nan), np.nan)])
def test_what_is_constant_or_unknown_is_kept(x: np.ndarray[Any, Any], kept: float) -> None:
    np.testing.assert_array_equal(unpacked(packed(x, 0.1, 1)), np.full(6, kept))


def test_means_are_those_of_known_samples_and_an_end_that_is_too_short_is_left_out() -> None:
    column = packed(np.array([1.0, 3.0, np.nan, 5.0, np.nan, np.nan, 9.0]), 0.1, 2)
    assert column["step"] == 0.2
    np.testing.assert_allclose(unpacked(column), [2.0, 5.0, np.nan], atol=1e-4)


def test_the_free_runs_of_one_drive_stand_where_they_began() -> None:
    speed = np.array([[1.0, 1.0], [2.0, 2.0], [3.0, 3.0]])
    errors = Errors(speed, speed, np.array([0, 1, 1]), np.array([0, 2, 3]))
    np.testing.assert_array_equal(along(errors, 1, 6), [np.nan, np.nan, 2.0, 2.0, 3.0, np.nan])


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
