"""A `rollout` that others wrote is used where it drives as the steps do, and never where it does not."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from deeptruck_core.signals import TruckInterface
from deeptruck_model.simulators import Run, completed, forced_run, free_run, protocol_check, run
from deeptruck_model.simulators.protocol_check import Mark
from deeptruck_model.simulators.running import said_of_rollout, stepped

DT, ROWS = 0.1, 2


class Mass:
    """A mass that an engine drives; the state is its speed (batch,)."""

    interface = TruckInterface("mass", engine_unit="N m", brake_unit="percent", grade=True, fuel=False)
    dt = DT

    def reset(self, y0: Any) -> Any:
        return y0[:, 1].copy()

    def step(self, state: Any, u: Any, w: Any) -> Any:
        a = 4.0 * u[:, 0] / 2e4 - 0.06 * u[:, 1] - 9.81 * w[:, 0] - 6e-4 * state**2
        after = np.maximum(state + a * self.dt, 0.0)
        return after, np.stack([(after - state) / self.dt, after], axis=1)

    def force(self, state: Any, y: Any) -> Any:
        return np.where(np.isnan(y[:, 1]), state, y[:, 1])

    def inside(self, state: Any) -> Any:
        return {"engine_speed": 4.0 * state}


class WithRollout(Mass):
    """It counts the drives that go by it."""

    calls = 0

    def rollout(self, u: Any, w: Any, y0: Any, recorded: Any = None) -> Run:
        type(self).calls += 1
        return stepped(self, u, w, y0, recorded)


class Forgets(WithRollout):
    def rollout(self, u: Any, w: Any, y0: Any, recorded: Any = None) -> Run:
        return super().rollout(u, w, y0, None)


class KeepsNothing(WithRollout):
    """NaN is in its state from where nothing is fed back."""

    def rollout(self, u: Any, w: Any, y0: Any, recorded: Any = None) -> Run:
        made = super().rollout(u, w, y0, recorded)
        if recorded is None:
            return made
        lost = np.maximum.accumulate(np.isnan(recorded[:, :, 1]), axis=1)
        return Run(np.where(lost[:, :, None], np.nan, made.y), made.inside)


class OffLater(WithRollout):
    """By 0.02 m/s, from 40 s on."""

    def rollout(self, u: Any, w: Any, y0: Any, recorded: Any = None) -> Run:
        made = super().rollout(u, w, y0, recorded)
        made.y[:, round(40.0 / DT) :, 1] += 0.02
        return made


class InsideOff(WithRollout):
    def rollout(self, u: Any, w: Any, y0: Any, recorded: Any = None) -> Run:
        made = super().rollout(u, w, y0, recorded)
        return Run(made.y, {"engine_speed": 1.01 * made.inside["engine_speed"]})


class TakesThree(WithRollout):
    def rollout(self, u: Any, w: Any, y0: Any) -> Run:  # type: ignore[override]
        return super().rollout(u, w, y0, None)


WRONG = {
    Forgets: "differs from its steps in y from 0.2 s",
    KeepsNothing: "its y is not finite",
    OffLater: "differs from its steps in y from 40.0 s",
    InsideOff: "differs from its steps in engine_speed",
    TakesThree: "cannot be run (",
}


def drive(seconds: float = 100.0) -> tuple[Any, Any, Any]:
    """Commands, slope and a response that no simulator here has."""
    rng, n = np.random.default_rng(0), round(seconds / DT)
    engine = np.repeat(rng.uniform(0.0, 3000.0, (ROWS, n // 50)), 50, axis=1)
    u = np.stack([engine, np.zeros_like(engine)], axis=2)
    w = 0.02 * np.sin(np.arange(n) * DT / 9.0)[None, :, None] * np.ones((ROWS, 1, 1))
    y = np.zeros((ROWS, n, 2))
    y[:, :, 1] = 15.0 + np.cumsum(rng.normal(0.0, 0.02, (ROWS, n)), axis=1)
    return u, w, y


@pytest.mark.parametrize("kind", list(WRONG))
def test_a_wrong_rollout_is_not_used_and_said(kind: type[WithRollout]) -> None:
    u, w, y = drive()
    mixed = y.copy()
    mixed[:, 300:700] = np.nan
    simulator, right = completed(kind()), completed(Mass())
    for recorded in (y, mixed, None):
        made = run(simulator, u, w, y[:, 0], recorded)
        np.testing.assert_array_equal(made.y, run(right, u, w, y[:, 0], recorded).y)
        assert np.isfinite(made.y).all()
    assert kind.calls <= 2, "what was compared once is not compared again"
    assert WRONG[kind] in said_of_rollout(simulator)


class SharesASlope(WithRollout):
    """That of row 0."""

    def rollout(self, u: Any, w: Any, y0: Any, recorded: Any = None) -> Run:
        return super().rollout(u, np.broadcast_to(w[:1], w.shape), y0, recorded)


class RowEarly(WithRollout):
    """Its first row is the response to the first command."""

    def rollout(self, u: Any, w: Any, y0: Any, recorded: Any = None) -> Run:
        made = super().rollout(u, w, y0, recorded)
        return Run(np.concatenate([made.y[:, 1:], made.y[:, -1:]], axis=1), made.inside)


class RowShort(WithRollout):
    def rollout(self, u: Any, w: Any, y0: Any, recorded: Any = None) -> Run:
        made = super().rollout(u, w, y0, recorded)
        return Run(made.y[:, 1:], made.inside)


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        (OffLater, "differs from its steps in y from 40.0 s"),
        (SharesASlope, "differs from its steps in y from 0.1 s"),
        (RowEarly, r"y\[:, 0\] is not y0, the start"),
        (RowShort, r"expected \(3, 6000, 2\); mend its rollout"),
    ],
)
def test_the_check_finds_it_and_says_so(kind: type[WithRollout], says: str) -> None:
    row = next(r for r in protocol_check.examine(completed(kind())) if r.about == "rollout")
    assert row.state is Mark.NO and re.search(says, row.says) and "leave it out" in row.mend


def test_a_right_rollout_is_used() -> None:
    u, w, y = drive()
    simulator = completed(WithRollout())
    forced_run(simulator, u, w, y)
    before = WithRollout.calls
    forced_run(simulator, u, w, y)
    free_run(simulator, u, w, y[:, 0])
    assert WithRollout.calls == before + 2 and said_of_rollout(simulator) == ""
    row = next(r for r in protocol_check.examine(simulator) if r.about == "rollout")
    assert row.state is Mark.YES


def test_a_drive_of_one_sample_and_one_without_rollout_run() -> None:
    u, w, y = drive()
    assert run(completed(Mass()), u[:, :1], w[:, :1], y[:, 0], None).y.shape == (ROWS, 1, 2)
