"""What acceleration a force gives on the reference trucks, and that hidden forces come back in their size."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_core.signals import ACCELERATION, SPEED
from deeptruck_exam.plants.fastsim_equations import LineHaul, make
from deeptruck_model import trucks
from deeptruck_model.mismatch.mechanisms import variant
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.prepare.prepared import prepare
from deeptruck_model.mismatch.residual import effective_mass, gather
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.expression import Signal, Stream
from deeptruck_model.mismatch.residual.expression.nodes import Constant
from deeptruck_model.mismatch.residual.noise import Prior, fit
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import Simulator, free_run, load
from deeptruck_model.trucks import driving_cycles


class Swinging:
    """A force that swings at 0.4 Hz, N."""

    def reset(self, batch: int) -> None: ...

    def force(self, view: trucks.View, dt: float) -> np.ndarray:
        return np.where(view.speed > 0.5, 2500.0 * np.sin(2.5 * view.time), 0.0)


class Pull:
    """A steady force against motion, N."""

    def __init__(self, newtons: float) -> None:
        self.newtons = newtons

    def reset(self, batch: int) -> None: ...

    def force(self, view: trucks.View, dt: float) -> np.ndarray:
        return np.where(view.speed > 0.5, -self.newtons, 0.0)


def drives(truck: trucks.PhysicsTruck, count: int = 3) -> list[Recording]:
    out = []
    for k in range(count):
        drive = driving_cycles.drive(truck, seconds=240, seed=k)
        drive.channels["speed"] += np.random.default_rng(k).normal(0.0, 0.003, len(drive))
        out.append(drive)
    return out


def evidence(truck: trucks.PhysicsTruck) -> Evidence:
    prepared = [prepare(d, True) for d in drives(truck)]
    return gather.gather(truck, prepared, [False] * len(prepared))


def test_rotating_masses_take_a_share_that_grows_with_the_turns_per_metre() -> None:
    e = evidence(trucks.load("volvo"))
    driving = e.valid & (e["brake_command"] == 0.0) & (e.since(e["brake_command"] > 0.0) > 2.0)
    high, low = (
        e["effective_mass_gain"][driving & in_gear]
        for in_gear in (e["overall_ratio"] < 8.0, e["overall_ratio"] > 20.0)
    )
    assert 0.85 < np.median(high) < 0.97
    assert np.quantile(low, 0.2) < np.median(high) - 0.03


def test_brakes_that_hold_a_deceleration_make_up_for_other_forces() -> None:
    e = evidence(trucks.load("volvo"))
    braking = e["brake_command"] > 0.05
    assert 0.02 < braking.mean() < 0.6
    assert abs(np.median(e["effective_mass_gain"][e.valid & braking & (e.since(~braking) > 2.0)])) < 0.1
    assert np.median(e["effective_mass_gain"][e.valid & ~braking]) > 0.8


def test_a_simulator_that_shows_nothing_is_taken_at_force_per_mass() -> None:
    truck = trucks.load("trucksim")
    assert effective_mass.free({"speed": np.ones(3)}) is None
    assert effective_mass.free({"effective_mass": np.ones(3)}) is None  # nothing to compare it with
    assert not effective_mass.holds(truck)
    assert isinstance(effective_mass.held(False), Constant)
    assert effective_mass.holding(False, {}, np.ones(3)) == {}  # perhaps braking was not recorded


def test_a_truck_at_its_greatest_rolling_resistance_is_asked_with_less(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    volvo = trucks.load("volvo")
    make = trucks.PhysicsTruck.with_parameters

    def bounded(truck: trucks.PhysicsTruck, values: Mapping[str, float]) -> trucks.PhysicsTruck:
        if values["rolling_resistance"] > truck.parameters()["rolling_resistance"]:
            raise InputError("the most it may have")
        return make(truck, values)

    monkeypatch.setattr(trucks.PhysicsTruck, "with_parameters", bounded)
    assert effective_mass.holds(volvo)


def test_whether_brakes_hold_what_is_commanded_is_asked_of_the_truck(shuttle: Path) -> None:
    assert effective_mass.holds(trucks.load("volvo"))
    truck = load(f"python:{shuttle.stem}:make")
    assert not effective_mass.holds(truck)
    shuttle.write_text(shuttle.read_text().replace('brake_unit="percent"', 'brake_unit="m/s^2"'))
    by_another_name = load(f"python:{shuttle.rename(shuttle.with_stem(f'other_{shuttle.stem}')).stem}:make")
    assert by_another_name.interface.brake_unit == "m/s^2" and not effective_mass.holds(by_another_name)


class WithoutParameters:
    """A truck that states no parameters, as a learned one."""

    def __init__(self, truck: Simulator) -> None:
        self.truck = truck

    def __getattr__(self, name: str) -> Any:
        return getattr(self.truck, name)

    def parameters(self) -> dict[str, float]:
        return {}


def test_one_without_parameters_is_asked_by_a_slope() -> None:
    """FASTSim's brakes are a force that is given per mass; the volvo's hold what is commanded."""
    volvo = trucks.load("volvo").with_grade_input()
    assert effective_mass.holds(cast(Simulator, WithoutParameters(volvo)))
    by_another_name = cast(Simulator, WithoutParameters(LineHaul()))
    assert by_another_name.interface.brake_unit == "m/s^2" and not effective_mass.holds(by_another_name)
    blind = cast(Simulator, WithoutParameters(make({"grade": False})))
    assert effective_mass.holds(blind), "what is commanded so is held on the road"


@pytest.mark.parametrize("name", ["trucksim", "volvo"])
def test_a_hidden_force_comes_back_in_newtons(name: str) -> None:
    believed = trucks.load(name)
    prepared = [prepare(d, True) for d in drives(believed.with_forces([Pull(2000.0)]))]
    e = gather.gather(believed, prepared, [False] * len(prepared))
    search = Regression(e)
    mechanism = next(m for m in search.library if m.effect == "dragging_brake")
    steady = next(s for s in search.candidate_terms(mechanism) if s.variants == (variant("constant"),))
    beside, prior = search.design()
    columns = np.concatenate([steady.columns, beside], axis=1)
    found = fit(search.series, columns, Prior.join(steady.prior, prior))
    assert found.b[0] * e.mass == pytest.approx(2000.0, rel=0.03)


def test_what_changes_while_brakes_hold_acts_until_they_have_made_up_for_it() -> None:
    believed = trucks.load("volvo")
    true, plain = (believed.with_forces(f) for f in ([Swinging()], []))
    u, w = np.zeros((1, 400, 2)), np.zeros((1, 400, len(believed.interface.w)))
    u[:, 150:, 1] = 0.5
    y0 = np.zeros((1, len(believed.interface.y)))
    y0[:, SPEED] = 27.0
    a, b = (free_run(truck, u, w, y0).y[0, :, ACCELERATION] for truck in (true, plain))
    force = 2500.0 / 30000.0 * np.sin(2.5 * 0.1 * np.arange(400))
    stream, memory, added = Stream([effective_mass.with_effective_mass(Signal("force"))]), None, []
    steady = Stream([effective_mass.held(effective_mass.holds(believed))])
    memory, braked = stream.begin(1), steady.begin(1)
    for k in range(400):
        now = {"force": force[k : k + 1], "brake_command": u[:, k, 1]}
        (left,), braked = steady.step(braked, now, 0.1)
        now |= {"effective_mass_gain": left} | effective_mass.holding(True, now, left)
        (value,), memory = stream.step(memory, now, 0.1)
        added.append(value[0])
    braking = slice(200, 400)
    left = (a - b)[braking] - np.array(added)[braking]
    assert np.std((a - b)[braking]) > 0.3 * np.std(force[braking])  # far from nothing, as a steady one gives
    assert np.std(left) < 0.5 * np.std((a - b)[braking])
