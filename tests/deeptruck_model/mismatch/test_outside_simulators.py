"""A simulator by another author is corrected, kept and loaded again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import mismatch, simulators
from deeptruck_model.recordings import Recording


class Limited:
    """A truck whose engine gives no more than a part of what it is asked for, N m."""

    def __init__(self, truck: Any, most: float) -> None:
        self.truck, self.most = truck, [most, np.inf]
        self.reset, self.inside, self.interface, self.dt = (
            truck.reset,
            truck.inside,
            truck.interface,
            truck.dt,
        )

    def step(self, state: Any, u: Any, w: Any) -> tuple[Any, Any]:
        return self.truck.step(state, np.minimum(u, self.most), w)


def drives(truck: Any, count: int) -> list[Recording]:
    """40 s each of pedals that come and go on hills, with the noise of a wheel-speed sensor."""
    out = []
    for seed in range(count):
        rng = np.random.default_rng(seed)
        held = np.repeat(rng.uniform(-800.0, 1600.0, 10), 40)
        u = np.stack([np.maximum(held, 0.0), np.maximum(-held, 0.0) / 40.0], axis=1)[None]
        w = np.repeat(rng.normal(0.0, 0.01, 4), 100)[None, :, None]
        y = simulators.free_run(truck, u, w, np.array([[0.0, 15.0]])).y[0]
        channels = {
            "engine_command": u[0, :, 0],
            "brake_command": u[0, :, 1],
            "grade": w[0, :, 0],
            "speed": y[:, 1] + rng.normal(0.0, 0.003, len(y)),
            "acceleration": y[:, 0] + rng.normal(0.0, 0.02, len(y)),
        }
        out.append(Recording(f"drive{seed}", 0.1, channels, truck.interface))
    return out


def test_an_outside_simulator_is_corrected_kept_and_loaded_again(shuttle: Path) -> None:
    truck = simulators.load(f"python:{shuttle.stem}:make")
    *fit, held, also = drives(truck.with_parameters({"brake_gain": 0.75}), 8)
    found = mismatch.find_mismatch(truck, fit, [held, also])
    assert [f.effect for f in found.result.findings] == ["brake_gain"] and found.result.fit.validated
    assert found.evidence.mass == 20000.0 and not [c for c in found.result.caveats if "forces in N" in c]
    found.corrected.save(Path("better"))
    better = simulators.load("better")
    assert better.parameters()["brake_gain"] == pytest.approx(0.75, rel=0.03)
    shuttle.write_text(shuttle.read_text().replace("PER_NM = 4.0", "PER_NM = 4.5"))
    with pytest.raises(InputError, match="SHA-256"):
        simulators.load("better")


def test_a_force_goes_into_a_simulator_that_reports_none_of_its_own(shuttle: Path) -> None:
    truck = simulators.load(f"python:{shuttle.stem}:make")
    *fit, held, also = drives(Limited(truck, 900.0), 8)
    found = mismatch.find_mismatch(truck, fit, [held, also])
    first = found.result.findings[0]
    assert "torque_limit" in (first.effect, *first.credible_set)
    assert found.result.fit.validated
    assert found.result.fit.errors.after.speed < 0.2 * found.result.fit.errors.before.speed
