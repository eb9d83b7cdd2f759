"""The simulator along the recordings: nothing left on its own truck, and what each question to it returns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model import driving_cycles, trucks
from deeptruck_model.errors import InputError
from deeptruck_model.mismatch import residual
from deeptruck_model.mismatch.evidence import Evidence
from deeptruck_model.recordings import Recording

TRUCK = trucks.load("trucksim")
MASS = TRUCK.parameters()["mass"]


class BlackBox:
    """A physics truck that shows nothing of itself."""

    def __init__(self, truck: trucks.PhysicsTruck) -> None:
        self.interface, self.dt = truck.interface, truck.dt
        self.reset, self.step, self.force = truck.reset, truck.step, truck.force

    def inside(self, state: object) -> dict[str, np.ndarray]:
        return {}

    def parameters(self) -> dict[str, float]:
        return {}


@pytest.fixture(scope="module")
def drives() -> list[Recording]:
    return [driving_cycles.drive(TRUCK, seconds=200.0, seed=k) for k in range(2)]


@pytest.fixture(scope="module")
def own(drives: list[Recording]) -> Evidence:
    return residual.gather(TRUCK, [residual.prepare(r, False) for r in drives], [False, True])


def test_on_its_own_truck_nothing_is_left(own: Evidence) -> None:
    assert own.dt == pytest.approx(0.2) and len(own.stretches) == 2 and own.held_out.sum() == 1000
    sure = own.valid & (own.doubt(0.02) < 1.5)
    assert sure.mean() > 0.4 and np.sqrt(np.mean(own.residual[sure] ** 2)) < 5e-3
    assert own.mass == pytest.approx(MASS)


def test_sensitivities_are_the_answers_of_other_trucks(drives: list[Recording], own: Evidence) -> None:
    heavy = TRUCK.with_parameters({"mass": 1.02 * MASS})
    other = residual.gather(heavy, [residual.prepare(r, False) for r in drives], [False, True])
    sure = own.valid & (own.doubt(0.02) < 1.5) & (other.doubt(0.02) < 1.5)
    expected = -0.02 * own.sensitivity["mass"]
    assert np.corrcoef((other.residual - own.residual)[sure], expected[sure])[0, 1] > 0.99
    assert set(own.sensitivity) == set(residual.PARAMETERS)


def test_rerun_is_the_change_by_late_commands(own: Evidence) -> None:
    change = own.rerun("delay_all", 0.5)
    assert change.shape == own.residual.shape and 0.01 < change[own.valid].std() < 1.0
    assert np.abs(own.rerun("delay_all", 1e-9)).max() < 1e-6


def test_a_black_box_is_split_into_what_it_is_made_of(drives: list[Recording], own: Evidence) -> None:
    prepared = [residual.prepare(r, False) for r in drives]
    asked = residual.gather(BlackBox(TRUCK), prepared, [False, True])
    assert asked.dt == pytest.approx(1.0) and asked.mass == pytest.approx(MASS, rel=0.3)

    def seconds(x: np.ndarray) -> np.ndarray:
        return np.concatenate([x[s.rows].reshape(-1, 5).mean(axis=1) for s in own.stretches])

    for name in ("engine", "brake"):
        assert np.corrcoef(asked[name][asked.valid], seconds(own[name])[asked.valid])[0, 1] > 0.9
    assert set(asked.sensitivity) == set(residual.PARAMETERS)


def test_what_a_learned_simulator_is_fed() -> None:
    y = np.ones((5, 2))
    assert (residual.fed(TRUCK, y) == 1.0).all()
    hidden = residual.fed(BlackBox(TRUCK), y)
    assert np.isnan(hidden[1:, 0]).all() and (hidden[:, 1] == 1.0).all() and (hidden[0] == 1.0).all()


def test_holes_are_filled_and_kept_out(drives: list[Recording]) -> None:
    holes = drives[0].piece(0, len(drives[0]))
    holes.channels["grade"] = holes.channels["grade"].copy()
    holes.channels["grade"][800:805] = np.nan
    p = residual.prepare(holes, False)
    assert np.isfinite(p.u).all() and np.isfinite(p.w).all() and np.isfinite(p.y).all()
    assert not p.valid[797:825].any()
    assert not p.valid[:60].any() and not p.valid[p.y[:, 1] < residual.MOVING].any()
    assert (drives[0].channels["grade"][800:805] == drives[0].w[800:805, 0]).all()


def test_quantum_is_the_step_of_a_channel() -> None:
    rng = np.random.default_rng(0)
    x = np.round(np.cumsum(rng.normal(size=500)) / 0.5) * 0.5
    assert residual.quantum(x) == pytest.approx(0.5, rel=0.01)
    assert residual.quantum(np.zeros(500)) == 0.0


def test_less_than_a_block_is_refused(drives: list[Recording]) -> None:
    with pytest.raises(InputError, match="shorter than one block"):
        residual.gather(TRUCK, [residual.prepare(drives[0].piece(0, 1), False)], [False])


def test_a_shift_that_comes_a_little_sooner_is_no_part_of_a_slope() -> None:
    recording = driving_cycles.drive(TRUCK, seconds=600.0, seed=4)
    channels = recording.channels | {"speed": np.round(recording.channels["speed"] * 921.6) / 921.6}
    prepared = residual.prepare(replace(recording, channels=channels), False)
    driven = residual.gather(TRUCK.with_parameters({"mass": 0.7 * MASS}), [prepared], [False])
    slope = driven.sensitivity["rolling_resistance"][driven.valid]
    assert driven["gear"].min() < driven["gear"].max()
    assert np.abs(slope - np.median(slope)).max() < 0.5 * np.abs(np.median(slope))
