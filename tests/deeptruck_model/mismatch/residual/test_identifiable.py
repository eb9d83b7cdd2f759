"""What is identifiable follows from what a simulator reports; and a foreign one is corrected."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import mismatch, simulators, trucks
from deeptruck_model.mismatch.residual import identifiable
from deeptruck_model.mismatch.residual.gather import REFIT_PARAMETERS
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators.protocol_check import Mark


def rows(simulator: Any) -> dict[str, Any]:
    return {row.about: row for row in identifiable.rows(simulator) if row.about != "time"}


def test_of_a_physics_truck_everything_is_identifiable() -> None:
    found = rows(trucks.load("trucksim"))
    assert {row.state for row in found.values()} == {Mark.YES}
    assert found["refitted"].says == f"{', '.join(REFIT_PARAMETERS)}; as an added force: none"


def test_a_parameter_at_its_upper_bound_is_refitted_too() -> None:
    found = rows(trucks.load("trucksim").with_parameters({"torque_gain": 3.0}))
    assert found["refitted"].says == f"{', '.join(REFIT_PARAMETERS)}; as an added force: none"


def test_of_a_truck_that_reports_nothing_the_rest_is_guessed(shuttle: Path) -> None:
    truck = simulators.load(f"python:{shuttle.stem}:make")
    assert rows(truck)["forces in N"].says == "by its own mass"
    assert rows(truck)["forces"].state is Mark.NOTE
    truck.parameters = dict  # type: ignore[method-assign]
    found = rows(truck)
    assert {row.state for row in found.values()} == {Mark.NOTE}
    assert "m/s^2" in found["forces in N"].says and "counts as learned" in found["own errors"].says


def test_who_reports_forces_and_no_parameters_is_no_learned_truck() -> None:
    truck = trucks.load("trucksim")
    truck.parameters = dict  # type: ignore[method-assign]
    assert "own errors" not in rows(truck)


def test_half_of_the_forces_and_parameters_that_do_nothing_are_missing(shuttle: Path) -> None:
    with shuttle.open("a") as file:
        file.write(
            "\n\nclass Half(Shuttle):\n"
            "    def inside(self, state): return {'traction_force': state, 'gear': state}\n"
            "    def with_parameters(self, values): return Half({**self.body})\n"
            "\n\ndef half(): return Half(BODY)\n"
        )
    found = rows(simulators.load(f"python:{shuttle.stem}:half"))
    assert found["forces"].state is Mark.NO and "not brake_force" in found["forces"].says
    assert found["refitted"].state is Mark.NO and "changes nothing" in found["refitted"].says


@pytest.mark.parametrize(
    ("name", "factor", "state"),
    [
        ("traction_force", 1e-3, Mark.NOTE),
        ("traction_force", -1.0, Mark.NOTE),
        ("brake_force", 1e-3, Mark.NOTE),
        ("mass", 1e-3, Mark.NOTE),
        ("brake_force", -1.0, Mark.YES),  # what holds back counts by its size
    ],
)
def test_forces_that_do_not_add_up_are_noted(name: str, factor: float, state: Mark) -> None:
    truck = trucks.load("trucksim")
    own = truck.inside
    truck.inside = lambda at: {n: x * (factor if n == name else 1.0) for n, x in own(at).items()}  # type: ignore[method-assign]
    row = rows(truck)["forces"]
    assert row.state is state and ("add up to" in row.says) == (state is Mark.NOTE)


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


def test_the_time_of_a_comparison_follows_that_of_a_step(shuttle: Path) -> None:
    truck = simulators.load(f"python:{shuttle.stem}:make")
    quick = truck.step

    def slow(*args: Any) -> Any:
        time.sleep(0.002)
        return quick(*args)

    truck.step = slow  # type: ignore[method-assign]
    (row,) = (row for row in identifiable.rows(truck) if row.about == "time")
    assert row.state is Mark.NOTE and "ms a step" in row.says and "numba" in row.mend
