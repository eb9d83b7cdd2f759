"""Drives that are run at once, each as if alone."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_model import trucks
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck, Term
from deeptruck_model.mismatch.mechanisms import variant
from deeptruck_model.mismatch.prepare.prepared import Prepared, _alike, fed, forced, prepare
from deeptruck_model.simulators import Simulator, forced_run
from deeptruck_model.trucks import driving_cycles

TRUCK = trucks.load("trucksim")
LATE = CorrectedTruck(TRUCK, [Term("dragging_brake", (variant("constant"),), (0.1,))], {}, None, True)


@pytest.fixture(scope="module")
def drives() -> list[Prepared]:
    lengths = (90.0, 30.0, 80.0)
    return [prepare(driving_cycles.drive(TRUCK, seconds=s, seed=k), True) for k, s in enumerate(lengths)]


@pytest.mark.parametrize("simulator", [TRUCK, LATE])
def test_each_runs_as_if_alone(drives: list[Prepared], simulator: Simulator) -> None:
    together = forced(simulator, drives, [p.u for p in drives])
    for p, run in zip(drives, together, strict=True):
        alone = forced_run(simulator, p.u[None], p.w[None], fed(simulator, p.y)[None])
        assert run.y == pytest.approx(alone.y, abs=1e-12)
        assert set(run.inside) == set(alone.inside)
        for name, x in alone.inside.items():
            assert run.inside[name].shape == x.shape and run.inside[name] == pytest.approx(x, nan_ok=True)


def test_a_short_drive_is_not_drawn_out_to_a_long_one() -> None:
    assert _alike([900, 300, 800]) == [[0, 2], [1]]
    assert sorted(np.concatenate(_alike([5, 100, 99, 4, 1]))) == [0, 1, 2, 3, 4]
