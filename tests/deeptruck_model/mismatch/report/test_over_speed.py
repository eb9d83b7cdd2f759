"""What is missing over speed, while the truck pulls and while it coasts."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
from small_drives import evidence

from deeptruck_model.mismatch.report.page import _binned, _rows, force_over_speed


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
