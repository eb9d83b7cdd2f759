"""A correction of an FMU with a wrong mass is kept beside its reference, loads again, and drives better."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from deeptruck_model import simulators, trucks
from deeptruck_model.mismatch import CorrectedTruck
from deeptruck_model.trucks import driving_cycles


def test_the_corrected_fmu_loads_again_and_is_better(heavy: Path, tmp_path: Path) -> None:
    truck = trucks.load("trucksim")
    c = driving_cycles.drive(truck, seconds=60.0, seed=1).channels
    i = truck.interface
    u, w, y = (np.stack([c[name] for name in names], -1)[None] for names in (i.u, i.w, i.y))
    base = simulators.load(f"fmu:{heavy}")
    assert base.parameters()["mass"] == 24000.0
    CorrectedTruck(base, [], {"mass": -1 / 6}, None, True).save(tmp_path / "better")
    again = simulators.load(tmp_path / "better")
    before, after = (
        np.abs(simulators.free_run(s, u, w, y[:, 0]).y[:, :, 1] - y[:, :, 1]).max() for s in (base, again)
    )
    assert after < 1e-6 < 0.1 < before
