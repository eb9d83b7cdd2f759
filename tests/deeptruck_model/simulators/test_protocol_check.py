"""Each fault that somebody else's simulator can have is found by the row that is about it."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from deeptruck_core.signals import TruckInterface
from deeptruck_model import trucks
from deeptruck_model.simulators import Run, completed, forced_run, free_run, protocol_check, run
from deeptruck_model.simulators.protocol_check import Mark
from deeptruck_model.simulators.running import said_of_rollout, stepped

SHUTTLE = TruckInterface("shuttle", fuel=False)


@dataclass(eq=False)  # a key, as a simulator that was compared is
class Minimal:
    """What a truck must have; the state is its speed and how often it was stepped."""

    body: float = 20000.0
    dt: float = 0.1
    interface: TruckInterface = SHUTTLE

    def reset(self, y0: Any) -> Any:
        return {"speed": np.array(y0[:, 1]), "steps": 0}

    def accelerate(self, speed: Any, u: Any, w: Any) -> Any:
        return 4.0 * u[:, 0] / self.body - 0.06 * u[:, 1] - 9.81 * w[:, 0] - 1e-4 * speed**2

    def step(self, state: Any, u: Any, w: Any) -> Any:
        speed = np.maximum(state["speed"] + self.accelerate(state["speed"], u, w) * self.dt, 0.0)
        y = np.stack([(speed - state["speed"]) / self.dt, speed], axis=1)
        return {"speed": speed, "steps": state["steps"] + 1}, y

    def force(self, state: Any, y: Any) -> Any:
        return state | {"speed": np.where(np.isnan(y[:, 1]), state["speed"], y[:, 1])}

    def inside(self, state: Any) -> Any:
        return {"engine_speed": 4.0 * state["speed"]}


class Sound(Minimal):
    """A truck that keeps the protocol."""

    def parameters(self) -> dict[str, float]:
        return {"mass": self.body}

    def with_parameters(self, values: Any) -> Any:
        return replace(self, body=values["mass"])

    def save(self, path: Any) -> None: ...


def changed(**methods: Callable[..., Any]) -> Any:
    return type("Changed", (Sound,), methods)()


def not_ok(simulator: Any) -> dict[str, protocol_check.Row]:
    return {r.about: r for r in protocol_check.examine(simulator) if r.state is not Mark.YES}


def step_of(change: Callable[..., Any]) -> Callable[..., Any]:
    def step(self: Sound, state: Any, u: Any, w: Any) -> Any:
        return change(self, state, u, w, *Sound.step(self, state, u, w))

    return step


def in_km_h(self: Any, state: Any, u: Any, w: Any, after: Any, y: Any) -> Any:
    return after, y * [1.0, 3.6]


def in_g(self: Any, state: Any, u: Any, w: Any, after: Any, y: Any) -> Any:
    return after, y / [9.81, 1.0]


def noisy(self: Any, state: Any, u: Any, w: Any, after: Any, y: Any) -> Any:
    return after, y + np.random.default_rng().normal(0.0, 1e-9, y.shape)


def mixed(self: Any, state: Any, u: Any, w: Any, after: Any, y: Any) -> Any:
    return after | {"speed": y[:, 1] + 1e-3 * y[:, 1].mean()}, y


def in_place(self: Any, state: Any, u: Any, w: Any, after: Any, y: Any) -> Any:
    state.update(after)
    return state, y


def no_number(self: Any, state: Any, u: Any, w: Any, after: Any, y: Any) -> Any:
    return after, y * np.nan


def test_a_sound_simulator_and_the_pool_lack_nothing() -> None:
    assert set(not_ok(Sound())) == {"forces"}  # which it need not report
    for name in trucks.pool():
        assert set(not_ok(trucks.load(name))) <= {"grade"}


FORCED: dict[str, Callable[..., Any]] = {
    "deaf": lambda self, state, y: state,
    "numb": lambda self, state, y: state | {"speed": y[:, 1]},
    "own": lambda self, state, y: state.update(speed=y[:, 1]) or state,
}


def test_what_ends_every_drive_is_said_once() -> None:
    def reset(self: Any, y0: Any) -> Any:
        raise RuntimeError("the licence has run out")

    said = [row.says for row in protocol_check.missing(protocol_check.examine(changed(reset=reset)))]
    assert "licence has run out" in said[0] and set(said[1:]) == {"as at reset, step"}


FAULTS: list[tuple[dict[str, Any], str]] = [
    ({"step": step_of(no_number)}, "reset, step"),
    ({"step": step_of(in_km_h)}, "reset, step"),
    ({"step": step_of(in_g)}, "acceleration"),
    ({"step": step_of(noisy)}, "determinism"),
    ({"step": step_of(mixed)}, "batches"),
    ({"step": step_of(in_place)}, "old states"),
    ({"force": FORCED["own"]}, "old states"),
    ({"force": FORCED["deaf"]}, "force"),
    ({"force": FORCED["numb"]}, "force with NaN"),
    ({"accelerate": lambda self, v, u, w: Sound.accelerate(self, v, -u, w)}, "engine command"),
    ({"accelerate": lambda self, v, u, w: Sound.accelerate(self, v, u * [1, 0], w)}, "brake command"),
    ({"accelerate": lambda self, v, u, w: Sound.accelerate(self, v, u * [100, 1], w)}, "engine command"),
    ({"accelerate": lambda self, v, u, w: Sound.accelerate(self, v, u, -w)}, "grade"),
    ({"inside": lambda self, state: {"gear": np.ones(7)}}, "inside"),
    ({"inside": lambda self, state: {"traction_force": np.full(3, np.nan)}}, "inside"),
    ({"inside": lambda self, state: {"traction_force": state["speed"]}}, "forces"),
    ({"inside": lambda self, state: {"engine_speed": np.full(3, 1500.0)}}, "inside"),
    ({"parameters": lambda self: {"mass": np.nan}}, "parameters"),
    ({"with_parameters": lambda self, values: self}, "parameters"),
    ({"reset": lambda self, y0: 1 / 0}, "reset, step"),
]


@pytest.mark.parametrize(("methods", "about"), FAULTS)
def test_each_fault_is_found(methods: dict[str, Any], about: str) -> None:
    rows = not_ok(changed(**methods))
    assert about in rows and rows[about].state is Mark.NO and rows[about].mend, rows


@pytest.mark.parametrize(
    ("name", "factor", "is_noted"),
    [
        ("traction_force", 1e-3, True),
        ("traction_force", -1.0, True),
        ("brake_force", 1e-3, True),
        ("mass", 1e-3, True),
        ("brake_force", -1.0, False),  # what holds back counts by its size
    ],
)
def test_forces_that_do_not_add_up_are_noted(name: str, factor: float, is_noted: bool) -> None:
    truck = trucks.load("trucksim")
    own = truck.inside
    truck.inside = lambda at: {n: x * (factor if n == name else 1.0) for n, x in own(at).items()}  # type: ignore[method-assign]
    rows = not_ok(truck)
    assert ("forces" in rows) is is_noted
    assert not is_noted or rows["forces"].state is Mark.NOTE


def test_what_only_some_need_is_noted() -> None:
    bare = changed(
        inside=lambda self, state: {},
        parameters=lambda self: {},
        accelerate=lambda self, v, u, w: 2e-4 * np.nan_to_num(u[:, 0]),
    )
    bare.interface, bare.dt = TruckInterface("b", brake_unit=None, grade=False, fuel=False), 0.5
    rows = not_ok(bare)
    noted = {"dt", "brake command", "grade", "command of NaN", "inside", "forces", "parameters"}
    assert set(rows) == noted
    assert all(row.state is Mark.NOTE and row.mend for row in rows.values())
    assert not protocol_check.missing(list(rows.values()))


# A `rollout` that others wrote is used where it drives as the steps do, and never where it does not


ROWS = 2


class WithRollout(Minimal):
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
        made.y[:, round(40.0 / Minimal.dt) :, 1] += 0.02
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
    rng, n = np.random.default_rng(0), round(seconds / Minimal.dt)
    engine = np.repeat(rng.uniform(0.0, 3000.0, (ROWS, n // 50)), 50, axis=1)
    u = np.stack([engine, np.zeros_like(engine)], axis=2)
    w = 0.02 * np.sin(np.arange(n) * Minimal.dt / 9.0)[None, :, None] * np.ones((ROWS, 1, 1))
    y = np.zeros((ROWS, n, 2))
    y[:, :, 1] = 15.0 + np.cumsum(rng.normal(0.0, 0.02, (ROWS, n)), axis=1)
    return u, w, y


@pytest.mark.parametrize("kind", list(WRONG))
def test_a_wrong_rollout_is_not_used_and_said(kind: type[WithRollout]) -> None:
    u, w, y = drive()
    mixed = y.copy()
    mixed[:, 300:700] = np.nan
    simulator, right = completed(kind()), completed(Minimal())
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
    assert run(completed(Minimal()), u[:, :1], w[:, :1], y[:, 0], None).y.shape == (ROWS, 1, 2)
