"""Delays, lags and rate limits of commands, and the response to them."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_core.signals import ACCELERATION, TruckInterface
from deeptruck_model import trucks
from deeptruck_model.mismatch.prepare.prepared import Prepared, forced, prepare
from deeptruck_model.mismatch.residual.commands import RUNS, CommandPath, Response, changed, command_response
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import Run
from deeptruck_model.trucks import driving_cycles

DT, N = 0.1, 400
CHANNELS = ("engine_command", "brake_command")
PATHS = [
    (f"{what}_{which}", amount)
    for what, amounts in {
        "delay": (0.1, 0.25, 0.8), "lag": (0.15, 1.0), "rise": (0.3,), "fall": (0.3,), "rate": (200.0, 30.0),
        "soft": (200.0, 30.0), "shaped": (200.0, 30.0),
    }.items()
    for which in ("all", "engine", "brake")
    for amount in amounts
]  # fmt: skip


def commands(seed: int = 0) -> np.ndarray:
    """Steps and ramps, (N, 2)."""
    rng = np.random.default_rng(seed)
    steps = np.repeat(rng.uniform(0.0, 1.0, (N // 20, 2)), 20, axis=0) * [1500.0, 60.0]
    return steps + np.linspace(0.0, 1.0, N)[:, None] * [100.0, 5.0]


def prepared(u: np.ndarray) -> Prepared:
    zero = np.zeros(N)
    channels = {"speed": zero + 10.0, "acceleration": zero, **dict(zip(CHANNELS, u.T, strict=True))}
    recording = Recording("a", DT, channels, TruckInterface("test", grade=False, fuel=False))
    y = np.stack([zero, zero + 10.0], axis=1)
    return Prepared(recording, u, np.zeros((N, 0)), y, zero, zero == 0, 0.0, False)


def stepped(path: CommandPath, *drives: np.ndarray) -> np.ndarray:
    memory, out = path.begin(), []
    for k in range(N):
        arrived, memory = path.step(memory, np.stack([u[k] for u in drives]))
        out.append(arrived)
    return np.stack(out, axis=1)


@pytest.mark.parametrize(("name", "amount"), PATHS)
def test_step_by_step_as_in_the_rerun(name: str, amount: float) -> None:
    one, two = commands(0), commands(1)
    out = stepped(CommandPath([(name, amount, 1.0)], CHANNELS, DT), one, two)
    assert out[0] == pytest.approx(changed(prepared(one), name, amount), abs=1e-9)
    assert out[1] == pytest.approx(changed(prepared(two), name, amount), abs=1e-9)
    assert np.abs(out[0] - one).max() > 1.0
    untouched = {"all": [], "engine": [1], "brake": [0]}[name.split("_")[1]]
    assert (out[0][:, untouched] == one[:, untouched]).all()


def test_a_share_goes_part_of_the_way() -> None:
    u = commands()
    whole, half = (stepped(CommandPath([("lag_all", 0.5, s)], CHANNELS, DT), u)[0] for s in (1.0, 0.5))
    assert half == pytest.approx((u + whole) / 2)


def test_paths_follow_each_other() -> None:
    u = commands()
    both = stepped(CommandPath([("delay_all", 0.3, 1.0), ("lag_brake", 0.4, 1.0)], CHANNELS, DT), u)[0]
    late = changed(prepared(u), "delay_all", 0.3)
    assert both == pytest.approx(changed(prepared(late), "lag_brake", 0.4))


def test_an_old_memory_stays_usable() -> None:
    path = CommandPath([("delay_all", 0.3, 1.0), ("rate_engine", 50.0, 1.0)], CHANNELS, DT)
    u, memory = commands(), path.begin()
    for k in range(30):
        _, memory = path.step(memory, u[None, k])
    first, _ = path.step(memory, u[None, 30])
    path.step(memory, u[None, 200])
    again, _ = path.step(memory, u[None, 30])
    assert (first == again).all()


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
