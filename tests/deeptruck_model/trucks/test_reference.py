"""The compiled truck against stored drives, which an implementation in numpy that shared no code with it
computed from the same equations; a batch against its singles.

Where the equations are to change, test_figures.py and the energy account judge the new ones, and
`python tests/deeptruck_model/trucks/test_reference.py` stores their drives.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deeptruck_model import trucks
from deeptruck_model.simulators import Run
from deeptruck_model.trucks.state import WORK

DRIVES = Path(__file__).with_name("reference_drives.npz")  # by truck: (7 moments, 12 rows, 6 signals)


def random_inputs(truck: trucks.PhysicsTruck, batch: int, steps: int, seed: int) -> tuple[Any, ...]:
    """Pedals held for seconds: pull, coast, engine brake, service brake to rest; slopes of +-5 %."""
    rng = np.random.default_rng(seed)
    full = truck.parameters()["reference_torque"] if truck.interface.engine_unit == "N m" else 100.0
    hard = 3.0 if truck.interface.brake_unit == "m/s^2" else 70.0
    blocks = (batch, steps // 40 + 1)
    engine = rng.choice([-0.4, 0.0, 0.0, 0.3, 0.6, 1.0, 1.0], blocks) * full
    brake = np.where((engine <= 0.0) & (rng.random(blocks) < 0.5), rng.uniform(0.0, hard, blocks), 0.0)
    grade = rng.uniform(-0.05, 0.05, blocks)
    u = np.repeat(np.stack([engine, brake], axis=2), 40, axis=1)[:, :steps]
    w = np.repeat(grade, 40, axis=1)[:, :steps, None]
    y0 = np.stack([np.zeros(batch), rng.uniform(0.0, 30.0, batch), np.zeros(batch)], axis=1)
    return u, w, y0


def driven(name: str) -> tuple[np.ndarray, Run]:
    """Acceleration, speed, fuel rate, engine speed, gear and brake temperature every 3.7 s; and the run."""
    truck = trucks.load(name).with_grade_input()
    run = truck.rollout(*random_inputs(truck, batch=12, steps=260, seed=7))
    inside = [run.inside[signal] for signal in ("engine_speed", "gear", "brake_temperature")]
    signals = np.concatenate([run.y, np.stack(inside, axis=-1)], axis=-1)
    return signals[:, 37::37].swapaxes(0, 1), run


@pytest.mark.parametrize("name", trucks.pool())
def test_the_compiled_truck_drives_as_the_equations_say(name: str) -> None:
    found, run = driven(name)
    with np.load(DRIVES) as stored:
        np.testing.assert_allclose(found, stored[name], rtol=0.0, atol=1e-8)
    assert len(np.unique(run.inside["gear"])) >= 5, "the test must shift through the gearbox"
    assert {0.0, 2.0} <= set(np.unique(run.inside["clutch"]))
    assert (run.y[:, 1:, 1] == 0.0).any(), "the test must come to rest"


@pytest.mark.parametrize("name", trucks.pool())
def test_batch_equals_singles_and_steps_equal_rollout(name: str) -> None:
    truck = trucks.load(name).with_grade_input()
    u, w, y0 = random_inputs(truck, batch=4, steps=300, seed=3)
    run = truck.rollout(u, w, y0)
    for i in range(4):
        single = truck.rollout(u[i : i + 1], w[i : i + 1], y0[i : i + 1])
        np.testing.assert_array_equal(single.y[0], run.y[i])
    state = truck.reset(y0)
    for k in range(299):
        state, y = truck.step(state, u[:, k], w[:, k])
        np.testing.assert_array_equal(y, run.y[:, k + 1])
    for name_inside, values in truck.inside(state).items():
        np.testing.assert_array_equal(values, run.inside[name_inside][:, -1])


def test_step_leaves_the_old_state_usable() -> None:
    truck = trucks.load("volvo")
    state = truck.reset(np.array([[0.0, 20.0, 0.0]]))
    u, w = np.array([[80.0, 0.0]]), np.zeros((1, 1))
    _, first = truck.step(state, u, w)
    _, again = truck.step(state, u, w)
    np.testing.assert_array_equal(first, again)


def test_rows_of_a_batch_may_have_parameters_of_their_own() -> None:
    truck = trucks.load("trucksim")
    masses = np.array([10_000.0, 20_000.0, 36_000.0])
    u, w, y0 = random_inputs(truck, batch=3, steps=200, seed=1)
    fleet = truck.with_batch_parameters({"mass": masses}).rollout(u, w, y0)
    for i, mass in enumerate(masses):
        single = truck.with_parameters({"mass": mass}).rollout(u[i : i + 1], w[i : i + 1], y0[i : i + 1])
        np.testing.assert_array_equal(single.y[0], fleet.y[i])


if __name__ == "__main__":
    np.savez(DRIVES, **{name: driven(name)[0] for name in trucks.pool()})


# The energy account closes


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
