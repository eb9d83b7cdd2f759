"""The ruler by which the exam's cases are measured: what the true force gains in the tool's own evidence."""

from __future__ import annotations

import numpy as np
from small_drives import FORCES, N, posterior_of

from benchmarks.ideal_observer import ideal


def test_a_force_that_its_name_makes_up_is_attainable_and_held() -> None:
    found = ideal(posterior_of("brakes"), FORCES["brakes"], "brake_gain")
    assert found is not None and found.ahead > 2.9
    assert 0.9 < found.held < 1.05
    assert found.rival_nats < found.name_nats
    assert 0.0 < found.tool_ahead < found.ahead


def test_a_name_whose_laws_do_not_follow_the_force_holds_little_of_it() -> None:
    found = ideal(posterior_of("brakes"), FORCES["brakes"], "headwind")
    assert found is not None
    assert found.held < 0.2
    assert found.rival == "brake_gain" and not found.attainable


def test_a_force_that_the_data_do_not_show_is_not_attainable() -> None:
    found = ideal(posterior_of("none"), np.full(N, 2e-3), "dragging_brake")
    assert found is not None and not found.attainable
    assert ideal(posterior_of("none"), np.zeros(N), "dragging_brake") is None
