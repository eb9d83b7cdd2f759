"""Responses to changed commands from a few runs, against the simulator run with each of them."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_core.signals import ACCELERATION
from deeptruck_model import trucks
from deeptruck_model.mismatch.prepare.prepared import forced, prepare
from deeptruck_model.mismatch.residual.commands import RUNS, Response, changed, command_response
from deeptruck_model.simulators import Run
from deeptruck_model.trucks import driving_cycles

TRUCK = trucks.load("trucksim")
DRIVES = [prepare(driving_cycles.drive(TRUCK, seconds=300.0, seed=k), False) for k in range(2)]
UNUSUAL = 0.98  # of samples: in the others gears are shifted at another moment


class Counted:
    """A truck that counts the rows that it is driven along."""

    def __init__(self) -> None:
        self.interface, self.dt, self.rows = TRUCK.interface, TRUCK.dt, 0
        self.parameters = TRUCK.parameters

    def rollout(self, u: np.ndarray, w: np.ndarray, y0: np.ndarray, recorded: np.ndarray | None) -> Run:
        self.rows += len(u)
        return TRUCK.rollout(u, w, y0, recorded)


@pytest.fixture(scope="module")
def response() -> Response:
    return command_response(TRUCK, DRIVES, forced(TRUCK, DRIVES, [p.u for p in DRIVES]))


@pytest.mark.parametrize(
    ("name", "amount", "error"),
    [
        ("delay_brake", 0.3, 0.1),
        ("rise_brake", 0.6, 0.2),
        ("climb_brake", 20.0, 0.2),
        ("delay_engine", 0.35, 0.35),  # a torque is asked for in steps, and gears follow it
        ("lag_engine", 0.4, 0.4),
        ("delay_all", 0.6, 0.15),
    ],
)
def test_as_the_simulator_responds(response: Response, name: str, amount: float, error: float) -> None:
    own = forced(TRUCK, DRIVES, [p.u for p in DRIVES])
    exact = forced(TRUCK, DRIVES, [changed(p, name, amount) for p in DRIVES])
    changes = [(b.y - a.y)[0, :, ACCELERATION] for a, b in zip(own, exact, strict=True)]
    valid = np.concatenate([p.valid for p in DRIVES])
    wanted, made = (np.concatenate(x)[valid] for x in (changes, response(name, amount)))
    off = np.abs(made - wanted)
    usual = off <= np.quantile(off, UNUSUAL)
    assert np.linalg.norm(off[usual]) < error * np.linalg.norm(wanted[usual])


@pytest.mark.parametrize(("what", "amount"), RUNS)
def test_exact_where_it_was_run(response: Response, what: str, amount: float) -> None:
    us = [changed(p, f"{what}_brake", amount) for p in DRIVES]
    for p, own, exact, made in zip(
        DRIVES,
        forced(TRUCK, DRIVES, [p.u for p in DRIVES]),
        forced(TRUCK, DRIVES, us),
        response(f"{what}_brake", amount),
        strict=True,
    ):
        known = p.valid & (np.abs(made) > 1e-6)
        np.testing.assert_allclose(made[known], (exact.y - own.y)[0, known, ACCELERATION], atol=0.02)


def test_four_runs_a_command_and_none_before_one_is_asked_for() -> None:
    truck = Counted()
    runs = forced(truck, DRIVES, [p.u for p in DRIVES])
    truck.rows = 0
    asked = command_response(truck, DRIVES, runs)
    assert truck.rows == 0
    for amount in np.linspace(0.1, 1.2, 12):
        asked("delay_brake", amount)
    assert truck.rows == len(RUNS) * len(DRIVES)
    asked("lag_all", 0.5)
    assert truck.rows == 2 * len(RUNS) * len(DRIVES)
