"""What the fitted drives tell is told along the held-out ones too, where it acts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from deeptruck_model.mismatch.posterior.causes import Cause, Explanation
from deeptruck_model.mismatch.posterior.free_law import FreeModel
from deeptruck_model.mismatch.posterior.linearised import located_everywhere
from deeptruck_model.mismatch.posterior.search import Search
from deeptruck_model.mismatch.residual.evidence import Evidence


def test_a_slow_force_is_located_on_held_out_drives(nothing_missing: Evidence) -> None:
    slow = 0.3 * np.sin(nothing_missing["elapsed"] / 40.0)
    seen = replace(nothing_missing, residual=nothing_missing.residual + slow).to_fit()
    search = Search(seen)
    model = search.model((), frozenset())
    told = np.where(seen.valid, slow, 0.0)
    cause = Cause("missing_physics", "road_grade", 0.0, 1.0, told, needed={"road_grade": 0.03})
    left = FreeModel(np.zeros(len(seen)), 0.0, {}, {})
    before = Explanation((cause,), model, model, model, left, 0.0, None, ())
    (after,) = located_everywhere(seen, before).causes
    np.testing.assert_array_equal(after.force[seen.valid], told[seen.valid])
    held_out = ~seen.valid & seen.everywhere().valid
    assert held_out.any() and np.corrcoef(after.force[held_out], slow[held_out])[0, 1] > 0.9
