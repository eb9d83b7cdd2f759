"""A simulator with interface, dt, reset and step alone; and the flat face of the package."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model import find_mismatch, mismatch
from deeptruck_model.recordings import Recording, write_bag
from deeptruck_model.simulators import (
    MinimalSimulator,
    Simulator,
    completed,
    forced_run,
    free_run,
    protocol_check,
)

Array = NDArray[np.float64]
DOCS = Path(__file__).parents[3] / "docs"
INTERFACE = TruckInterface("mass", engine_unit="N m", brake_unit="percent", grade=True, fuel=False)
MASS, GAIN, FULL_BRAKE, GRAVITY, DRAG = 20000.0, 4.0, 6.0, 9.81, 12.0  # kg, 1/m, m/s^2, m/s^2, kg/m


class MyTruck:
    """A mass with air drag, and nothing that may be left out. The state is the speed, (batch,)."""

    interface = INTERFACE
    dt = 0.1

    def __init__(self, drag: float = DRAG) -> None:
        self.drag = drag

    def reset(self, y0: Array) -> Array:
        return y0[:, 1].copy()

    def step(self, state: Array, u: Array, w: Array) -> tuple[Array, Array]:
        force = GAIN * u[:, 0] - self.drag * state**2
        a = force / MASS - FULL_BRAKE * u[:, 1] / 100.0 - GRAVITY * w[:, 0]
        after = np.maximum(state + a * self.dt, 0.0)
        return after, np.stack([(after - state) / self.dt, after], axis=1)


def drive(truck: MyTruck, name: str, seed: int, seconds: float = 120.0) -> Recording:
    """Pulses of the engine and of the brake on rolling hills."""
    rng, n = np.random.default_rng(seed), round(seconds / truck.dt)
    engine = np.repeat(rng.uniform(0.0, 3000.0, n // 50 + 1), 50)[:n]
    brake = np.repeat(rng.choice([0.0, 0.0, 0.0, 8.0], n // 50 + 1), 50)[:n]
    u = np.stack([np.where(brake > 0.0, 0.0, engine), brake], axis=1)[None]
    w = 0.02 * np.sin(2.0 * np.pi * np.arange(n) * truck.dt / 60.0)[None, :, None]
    y = free_run(completed(truck), u, w, np.array([[0.0, 15.0]])).y[0]
    channels = {"acceleration": y[:, 0], "speed": y[:, 1] + rng.normal(0.0, 0.003, n)}
    commands = {"engine_command": u[0, :, 0], "brake_command": u[0, :, 1], "grade": w[0, :, 0]}
    return Recording(name, truck.dt, {**channels, **commands}, INTERFACE)


class Lagging(MyTruck):
    """Its engine follows by a lag, which is lost where it starts anew. The state is (batch, 2)."""

    def reset(self, y0: Array) -> Array:
        return np.stack([y0[:, 1], np.zeros(len(y0))], axis=1)

    def step(self, state: Array, u: Array, w: Array) -> tuple[Array, Array]:
        engine = state[:, 1] + (u[:, 0] - state[:, 1]) * self.dt / 0.6
        after, y = super().step(state[:, 0], np.stack([engine, u[:, 1]], axis=1), w)
        return np.stack([after, engine], axis=1), y


def test_no_name_is_given_to_what_a_simulator_without_force_forgets() -> None:
    """Its own drives: nothing is missing, and a mass of 10 t was stated for 28."""
    drives = [drive(Lagging(), f"drive{k}", k) for k in range(3)]
    verdict = find_mismatch(Lagging(), drives[:2], drives[2:]).verdict
    assert verdict["verdict"] == "undetermined" and verdict["findings"] == []
    assert "Add force(state, y)" in verdict["advice"]["data"]["reason"]


def test_what_a_simulator_may_leave_out_is_added() -> None:
    minimal: MinimalSimulator = MyTruck()  # mypy holds this
    truck = completed(minimal)
    assert isinstance(truck, Simulator) and not isinstance(minimal, Simulator)
    assert truck.parameters() == {} and truck.inside(truck.reset(np.array([[0.0, 5.0]]))) == {}
    assert completed(truck) is truck
    rows = {row.about: row for row in protocol_check.examine(truck)}
    assert not protocol_check.missing(list(rows.values()))
    assert any(row.state == "note" and "it has no force" in row.says for row in rows.values())


def test_a_simulator_without_force_goes_on_from_recorded_responses() -> None:
    truck, n = completed(MyTruck()), 5
    u, w = np.zeros((2, n, 2)), np.zeros((2, n, 1))
    recorded = np.zeros((2, n, 2))
    recorded[..., 1] = [[20.0] * n, [10.0] * n]
    y = forced_run(truck, u, w, recorded).y
    first = free_run(truck, u, w, recorded[:, 0]).y[:, 1]
    assert np.allclose(y[:, 1:], first[:, None])  # each step begins at the recorded speed
    unknown = np.where(np.arange(n)[None, :, None] == 0, recorded, np.nan)
    assert np.array_equal(forced_run(truck, u, w, unknown).y, free_run(truck, u, w, recorded[:, 0]).y)


@pytest.mark.parametrize("member", ["interface", "dt", "reset", "step"])
def test_an_object_that_is_no_simulator_is_refused_by_what_it_lacks(member: str) -> None:
    parts: dict[str, Any] = {name: getattr(MyTruck(), name) for name in ("interface", "dt", "reset", "step")}
    wrong: Any = type("Half", (), {name: part for name, part in parts.items() if name != member})()
    with pytest.raises(InputError, match=rf"Half is no simulator: it has no {member}; add"):
        find_mismatch(wrong, [drive(MyTruck(), "a", 0, 30.0)])


def test_the_batch_of_single_trucks_in_the_docs_is_fit_for_use(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "ours.py").write_text(
        "class Truck:\n    v = 0.0\n    def step(self, pedal, brake, slope, dt):\n"
        "        self.v = max(self.v + (2 * pedal - 6 * brake - 9.81 * slope) * dt, 0.0)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    _, snippet = re.findall(r"^```python\n(.*?)^```", (DOCS / "simulators.md").read_text(), re.S | re.M)
    scope: dict[str, Any] = {}
    exec(snippet, scope)
    assert not protocol_check.missing(protocol_check.examine(completed(scope["make"]())))


@pytest.mark.long
def test_the_snippet_of_the_docs_runs_and_the_result_is_read_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, seed in (("monday", 1), ("friday", 2)):
        write_bag(Path("drives") / name, [drive(MyTruck(), name, seed)], interface=INTERFACE)
    snippet, _ = re.findall(r"^```python\n(.*?)^```", (DOCS / "simulators.md").read_text(), re.S | re.M)
    scope: dict[str, Any] = {"MyTruck": lambda: MyTruck(drag=0.0)}
    exec(snippet, scope)
    found, again = scope["found"], mismatch.read("found")
    assert again.to_json()["caveats"] == list(found.result.caveats)
    assert [f.effect for f in again.findings] == [f.effect for f in found.findings]
    with pytest.raises(InputError, match="holds a mismatch result already"):
        mismatch.write(found, "found")
