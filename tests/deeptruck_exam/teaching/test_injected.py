"""Laws along drives with nothing missing: all but the sealed, at once or one by one."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_exam.construction import Built, build
from deeptruck_exam.effects import EFFECTS
from deeptruck_exam.effects.planting import SEALED
from deeptruck_exam.plans import draw_plan
from deeptruck_exam.teaching.injected import DRAWS, STRAYED, Injection


@pytest.fixture(scope="module")
def built() -> Built:
    return build(draw_plan("nothing_missing", 3, None, "physics", 1.0, forms="first"))


def test_no_law_of_the_sealed_family_is_taught(built: Built) -> None:
    laws = Injection(built, np.random.default_rng(0)).laws()
    assert len(laws) > 100
    assert not [law.key for law in laws if law.family == SEALED or law.kind != "missing_physics"]
    assert not [law.key for law in laws if law.leader]  # nobody drives ahead here


def test_a_force_is_drawn_several_times_and_a_filter_once(built: Built) -> None:
    injection = Injection(built, np.random.default_rng(0))
    delay = next(e for e in EFFECTS.values() if e.name == "command_delay" and e.family == "first")
    limit = EFFECTS["torque_limit"]
    found = list(injection.forces([limit, delay]))
    n = built.extra.shape[0] * built.extra.shape[1] // 2
    assert [f.key for f in found].count("torque_limit" + STRAYED) == DRAWS - 1  # and one as it was written
    assert [f.key for f in found].count("torque_limit") >= 1
    assert [f.key for f in found].count(delay.key) == 1
    assert all(f.acceleration.shape == (n,) and np.isfinite(f.acceleration).all() for f in found)
    assert all(np.abs(f.acceleration).max() > 1e-3 for f in found)
