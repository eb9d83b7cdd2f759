"""Recordings made fit to be compared, and simulators driven along them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from deeptruck_core.signals import FUEL
from deeptruck_core.vehicle_kinds import LEAST_SPEED
from deeptruck_model import trucks
from deeptruck_model.deep import coverage
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck, Term
from deeptruck_model.mismatch.mechanisms import variant
from deeptruck_model.mismatch.prepare.drives import with_inputs
from deeptruck_model.mismatch.prepare.prepared import (
    BRAKING,
    Prepared,
    fed,
    forced,
    learned,
    prepare,
    quantum,
)
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import Simulator, forced_run
from deeptruck_model.trucks import driving_cycles

TRUCK = trucks.load("trucksim")


@pytest.fixture(scope="module")
def drives() -> list[Recording]:
    return [driving_cycles.drive(TRUCK, seconds=200.0, seed=k) for k in range(2)]


def test_what_a_learned_simulator_is_fed() -> None:
    y = np.ones((5, 2))
    assert (fed(TRUCK, y) == 1.0).all()
    learned: Any = SimpleNamespace(parameters=dict)
    hidden = fed(learned, y)
    assert np.isnan(hidden[1:, 0]).all() and (hidden[:, 1] == 1.0).all() and (hidden[0] == 1.0).all()


def test_holes_are_filled_and_kept_out(drives: list[Recording]) -> None:
    holes = drives[0].piece(0, len(drives[0]))
    holes.channels["grade"] = holes.channels["grade"].copy()
    holes.channels["grade"][800:805] = np.nan
    p = prepare(holes, False)
    assert np.isfinite(p.u).all() and np.isfinite(p.w).all() and np.isfinite(p.y).all()
    assert not p.valid[797:825].any()
    assert not p.valid[:60].any() and not p.valid[p.y[:, 1] < LEAST_SPEED].any()
    assert (drives[0].channels["grade"][800:805] == drives[0].w[800:805, 0]).all()


@pytest.mark.parametrize(
    ("command", "slope", "kept"), [(0.0, 0.0, False), (0.0, 0.06, True), (-0.5, 0.0, True)]
)
def test_slowing_with_a_recorded_cause_is_compared(
    drives: list[Recording], command: float, slope: float, kept: bool
) -> None:
    rate = np.where(np.arange(1000) < 500, 0.0, -0.6)
    channels = {
        "speed": 25.0 + np.cumsum(rate) * 0.1 * (np.arange(1000) < 700),
        "acceleration": rate,
        "engine_command": np.where(rate < 0.0, command, 1.0),
        "grade": np.full(1000, slope),
    }
    interface = replace(drives[0].interface, brake_unit=None, fuel=False)
    p = prepare(Recording("stop", 0.1, channels, interface), False)
    assert p.valid[520:680].all() == kept == p.valid[520:680].any()
    assert (p.left_out[BRAKING] > 200) is not kept


def test_quantum_is_the_step_of_a_channel() -> None:
    rng = np.random.default_rng(0)
    x = np.round(np.cumsum(rng.normal(size=500)) / 0.5) * 0.5
    assert quantum(x) == pytest.approx(0.5, rel=0.01)
    assert quantum(np.zeros(500)) == 0.0


class Learned:
    """A simulator that has learned from driving without slopes."""

    def __init__(self, drives: list[Recording]) -> None:
        flat = [replace(r, channels=r.channels | {"grade": np.zeros(len(r))}) for r in drives]
        self.driven = coverage.measure_driven(flat)

    def parameters(self) -> dict[str, float]:
        return {}


def test_driving_that_was_never_learned_from_is_kept_out(drives: list[Recording]) -> None:
    flat = np.zeros(len(drives[0]))
    hilly = np.where(np.arange(len(flat)) > 1000, 0.05, 0.0)
    simulator: Any = Learned(drives)
    level, climbing = (
        learned(simulator, prepare(replace(r, channels=r.channels | {"grade": g}), False))
        for r, g in ((drives[0], flat), (drives[0], hilly))
    )
    assert level.valid.mean() > 0.7
    assert (climbing.valid[:1001] == level.valid[:1001]).mean() > 0.99 and not climbing.valid[1010:].any()


@pytest.mark.parametrize("lacking", [True, False])
def test_a_response_that_was_never_recorded_is_unknown(drives: list[Recording], lacking: bool) -> None:
    """A bag that lost its engine topic still has the truck's interface, with fuel."""
    bare = drives[0].piece(0, len(drives[0]))
    del bare.channels["fuel_rate"]
    if not lacking:
        bare.channels["fuel_rate"] = np.full(len(bare), np.nan)
    p = prepare(bare, False, TRUCK.interface)
    assert np.isnan(p.y[:, FUEL]).all() and np.isfinite(p.y[:, :FUEL]).all() and p.valid.mean() > 0.5


def test_a_piece_without_an_input_that_its_bag_has_is_left_out_and_said(drives: list[Recording]) -> None:
    nothing = drives[1].channels | {"grade": np.full(len(drives[1]), np.nan)}
    piece, other = (replace(drives[1], name=n, channels=nothing) for n in ("bag#0", "other"))
    whole = replace(drives[0], name="bag#1")
    kept, says = with_inputs(TRUCK, [piece, whole])
    assert [r.name for r in kept] == ["bag#1"] and len(says) == 1
    kept, says = with_inputs(TRUCK, [whole, other])
    assert [r.name for r in kept] == ["bag#1", "other"] and not says  # a whole bag is refused instead


LATE = CorrectedTruck(TRUCK, [Term("dragging_brake", (variant("constant"),), (0.1,))], {}, None, True)


@pytest.fixture(scope="module")
def uneven() -> list[Prepared]:
    lengths = (90.0, 30.0, 80.0)
    return [prepare(driving_cycles.drive(TRUCK, seconds=s, seed=k), True) for k, s in enumerate(lengths)]


@pytest.mark.parametrize("simulator", [TRUCK, LATE])
def test_each_runs_as_if_alone(uneven: list[Prepared], simulator: Simulator) -> None:
    together = forced(simulator, uneven, [p.u for p in uneven])
    for p, run in zip(uneven, together, strict=True):
        alone = forced_run(simulator, p.u[None], p.w[None], fed(simulator, p.y)[None])
        assert run.y == pytest.approx(alone.y, abs=1e-12)
        assert set(run.inside) == set(alone.inside)
        for name, x in alone.inside.items():
            assert run.inside[name].shape == x.shape and run.inside[name] == pytest.approx(x, nan_ok=True)
