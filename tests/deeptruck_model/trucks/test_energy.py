"""The energy account closes: the work of all forces is the change of kinetic energy, the grade's height."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_model import trucks
from deeptruck_model.trucks.state import WORK


class Wind:
    """A force of one's own, so that the account has an external entry."""

    def reset(self, batch: int) -> None:
        self.gust = np.zeros(batch)

    def force(self, view: trucks.View, dt: float) -> np.ndarray:
        self.gust += dt * (0.5 - self.gust)
        return -800.0 * self.gust * np.sin(0.3 * view.time) - 2.0 * view.speed


def kinetic(truck: trucks.PhysicsTruck, state: trucks.TruckState) -> np.ndarray:
    """Translation, wheels and engine, J."""
    p = truck.parameters()
    vehicle = p["mass"] + p["wheel_inertia"] / p["wheel_radius"] ** 2
    records = state.records
    return 0.5 * vehicle * records["speed"] ** 2 + 0.5 * p["engine_inertia"] * records["engine_speed"] ** 2


@pytest.mark.parametrize("name", trucks.pool())
def test_energy_bookkeeping_closes(name: str) -> None:
    truck = trucks.load(name).with_grade_input().with_forces([Wind()])
    rng = np.random.default_rng(4)
    full = truck.parameters()["reference_torque"] if name == "trucksim" else 100.0
    hard = 3.0 if name == "volvo" else 60.0
    state = truck.reset(np.array([[0.0, 0.0], [0.0, 12.0], [0.0, 26.0]]))
    start = kinetic(truck, state)
    for k in range(1200):
        if k % 60 == 0:
            engine = rng.choice([0.0, 0.4, 1.0, 1.0, -0.5], 3) * full
            brake = np.where((engine <= 0.0) & (rng.random(3) < 0.6), rng.random(3) * hard, 0.0)
            u, w = np.stack([engine, brake], axis=1), rng.uniform(-0.05, 0.05, (3, 1))
        state, _ = truck.step(state, u, w)
    work = {name: state.records[name] for name in WORK}
    spent = sum(work[n] for n in WORK if n not in ("engine_work", "external_work"))
    gained = kinetic(truck, state) - start
    scale = sum(np.abs(work[n]) for n in WORK)
    np.testing.assert_array_less(
        np.abs(work["engine_work"] + work["external_work"] - spent - gained) / scale, 1e-9
    )
    weight = truck.parameters()["mass"] * truck.parameters()["gravity"]
    np.testing.assert_allclose(work["grade_work"], weight * state.records["elevation"], rtol=1e-9)
    for name in ("slip_loss", "driveline_loss", "brake_work", "drag_work", "rolling_work"):
        assert (work[name] > 0.0).all(), f"{name} must dissipate"
    assert (np.abs(work["external_work"]) > 1e3).all()
    assert (np.diff(state.records["brake_temperature"]) != 0.0).any()


def test_brake_heat_is_the_work_of_the_brakes() -> None:
    insulated = {"brake_cooling": 0.0, "brake_cooling_speed": 0.0}
    truck = trucks.load("trucksim").with_parameters(insulated)
    state = truck.reset(np.array([[0.0, 25.0]]))
    for _ in range(100):
        state, _ = truck.step(state, np.array([[0.0, 50.0]]), np.zeros((1, 1)))
    warming = state.records["brake_temperature"] - truck.parameters()["ambient_temperature"]
    stored = warming * truck.parameters()["brake_heat_capacity"]
    np.testing.assert_allclose(stored, state.records["brake_work"], rtol=1e-9)
