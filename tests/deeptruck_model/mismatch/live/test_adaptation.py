"""What a drive has of its own, from its first minutes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_drives import TRUCK, drives

from deeptruck_core.errors import InputError
from deeptruck_model import simulators
from deeptruck_model.mismatch.correction.free_runs import free_windows
from deeptruck_model.mismatch.live.adaptation import _quantity, adapt, begin, with_state
from deeptruck_model.mismatch.live.questions import DriveState, Quantity, State
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import Simulator

NONE = Quantity()
HEAVIER, WIND_M_S, FORCE = 0.2, 6.0, -0.06


class SteadyForce:
    """A force of -0.06 m/s^2 against the truck while it moves."""

    def reset(self, batch: int) -> None: ...

    def force(self, view, dt: float) -> np.ndarray:
        return FORCE * view.mass * (view.speed > 0.3)


def rest_of(drive: Recording, first_s: float) -> list:
    return begin(TRUCK, [drive.piece(round(first_s / drive.dt), len(drive))], 1e9)


def error(simulator: Simulator, rest: list) -> float:
    return free_windows(simulator, rest, 40.0).rmse().speed


def test_a_load_is_found_and_helps_the_rest_of_the_drive(tmp_path: Path) -> None:
    heavier = TRUCK.with_parameters({"mass": (1.0 + HEAVIER) * TRUCK.parameters()["mass"]})
    (drive,) = drives(heavier, 1, 420.0)
    found = adapt(TRUCK, [drive], 210.0)
    load = found.own.load
    assert load.state is State.ESTIMATED
    assert load.ci95[0] < HEAVIER < load.ci95[1]
    assert load.value == pytest.approx(HEAVIER, abs=0.03)
    assert State.ESTIMATED not in (found.own.wind.state, found.own.constant.state)
    rest = rest_of(drive, 210.0)
    before, after = error(TRUCK, rest), error(found.truck, rest)
    assert after < 0.3 * before
    found.truck.save(tmp_path / "adapted")
    again = error(simulators.load(str(tmp_path / "adapted")), rest)
    assert again == pytest.approx(after, rel=1e-6)


def test_a_steady_force_is_found_and_helps_the_rest_of_the_drive() -> None:
    (drive,) = drives(TRUCK.with_forces([SteadyForce()], []), 1, 420.0)
    found = adapt(TRUCK, [drive], 210.0)
    assert found.own.constant.state is State.ESTIMATED
    assert found.constant == pytest.approx(FORCE, abs=0.02)
    assert found.sd < 0.03
    rest = rest_of(drive, 210.0)
    assert error(found.truck, rest) < 0.5 * error(TRUCK, rest)


def test_a_drive_without_anything_of_its_own_is_left_as_it_is() -> None:
    found = adapt(TRUCK, drives(TRUCK, 1, 240.0), 240.0)
    assert {q.state for q in found.own.each.values()} == {State.UNESTIMATED}
    assert not found.own.known
    assert not found.truck.adds and not found.truck.moved
    assert str(found.own) == "nothing of its own shows: the simulator is as given"


@pytest.mark.parametrize(
    ("probability", "size", "state"),
    [
        (0.49, 0.01, State.UNESTIMATED),
        (0.5, 0.01, State.ESTIMATED),
        (1.0, -0.75, State.ESTIMATED),
        (1.0, 0.76, State.INVALID),
        (1.0, -0.76, State.INVALID),
        (0.49, 0.76, State.UNESTIMATED),
    ],
)
def test_the_state_of_a_quantity(probability: float, size: float, state: State) -> None:
    drawn = np.full(100, size)
    found = _quantity(probability, drawn, 0.75, Rules())
    assert found == Quantity(state, pytest.approx(size), (size, size), probability)
    sure = _quantity(probability, drawn, 0.75, Rules(named=1.01))
    assert sure.state is State.UNESTIMATED


def test_all_that_is_valid_is_used_where_anything_is_estimated() -> None:
    """Each is its mean over the draws, so that what is improbable hardly moves the simulator."""
    load, wind = Quantity(State.ESTIMATED, 0.2), Quantity(State.UNESTIMATED, 0.5)
    beyond = Quantity(State.INVALID, 40.0)
    own = DriveState(load, wind, beyond)
    assert [own.used(name) for name in own.each] == [0.2, 0.5, 0.0]
    assert not DriveState(NONE, wind, beyond).known
    assert DriveState(NONE, wind, beyond).used("wind") == 0.0


def test_a_sentence_has_what_is_estimated_and_what_is_not_possible() -> None:
    load = Quantity(State.ESTIMATED, 0.2, (0.15, 0.25), 1.0)
    own = DriveState(load, Quantity(State.INVALID, 40.0, (30.0, 50.0), 1.0), NONE)
    assert str(own) == (
        "load +20 % of mass (+15 to +25, 95 %); wind invalid: the estimate leaves what a vehicle can have"
    )


def test_a_constant_accelerates_by_itself_and_a_headwind_slows() -> None:
    (p,) = begin(TRUCK, drives(TRUCK, 1, 120.0), 120.0)
    plain = free_windows(TRUCK, [p], 20.0).speed

    def gained(own: DriveState) -> float:
        return float(np.median((free_windows(with_state(TRUCK, own), [p], 20.0).speed - plain)[:, -1]))

    constant = gained(DriveState(NONE, NONE, Quantity(State.ESTIMATED, 0.05)))
    assert 0.7 < constant <= 1.0  # turning masses take a part; a run may shift otherwise
    assert gained(DriveState(NONE, Quantity(State.ESTIMATED, WIND_M_S), NONE)) < -0.1


def test_a_drive_that_is_too_short_is_refused() -> None:
    with pytest.raises(InputError, match="too little can be compared"):
        adapt(TRUCK, [drives(TRUCK, 1, 60.0)[0].piece(0, 100)])
