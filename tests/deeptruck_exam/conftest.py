"""Drives along which laws are evaluated, and a single law in a synthetic scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from deeptruck_exam.cases.build import Built, accelerations, build
from deeptruck_exam.cases.plan import draw_plan
from deeptruck_exam.laws import EFFECTS
from deeptruck_exam.laws.law import Array, Setting
from deeptruck_exam.worlds import trucks
from deeptruck_model.trucks import PhysicsTruck


@cache
def truck_of(name: str) -> PhysicsTruck:
    return trucks.make(name, {})


@pytest.fixture(scope="session")
def built() -> Callable[..., Built]:
    """Four drives of 75 s without an effect, one of each kind, of a reference truck, with and without a
    leader."""

    @cache
    def made(truck: str, led: bool = False) -> Built:
        plan = draw_plan("nothing_missing", 3, None, "physics", 1.25)
        drives = ["highway", "suburban", "hills", "descent"]
        styles = ["acc" if led else "human"] * 4
        plan = replace(plan, truck=truck, values={}, simulator_values={}, drives=drives, styles=styles)
        return build(replace(plan, grade=True, headway_s=0.9))

    return made


@cache
def undisturbed(truck: str, led: bool, built: Callable[..., Built]) -> Array:
    """Acceleration (4, n) of a truck without a law along the drives, m/s^2."""
    return accelerations(truck_of(truck), built(truck, led).drives)


@pytest.fixture(scope="session")
def acted(built: Callable[..., Built]) -> Callable[[str], Array]:
    """Acceleration (4, n) by a law along the drives, at the upper end of its sizes, m/s^2."""

    @cache
    def act(key: str) -> Array:
        effect = EFFECTS[key]
        name = effect.trucks[-1]
        world = built(name, effect.leader)
        drives = world.drives
        along = Setting(
            world.truck,
            len(drives.u),
            drives.u.shape[1] * drives.dt,
            drives.dt,
            world.plan.effect_seed,
            world.roads.start_m,
            world.roads.direction,
            world.roads.route,
            world.leader_m,
        )
        sizes = SimpleNamespace(**effect.draw(np.random.default_rng(1), scale=4.0))
        planted = effect.build(along, sizes)
        other = truck_of(name).with_parameters(dict(planted.parameters))
        other = other.with_forces(list(planted.forces), list(planted.filters))
        return accelerations(other, drives) - undisturbed(name, effect.leader, built)

    return act


def setting(truck: PhysicsTruck, batch: int = 2) -> Setting:
    """One road that is driven in both directions alternately."""
    return Setting(
        trucks.namespace(truck),
        batch,
        60.0,
        0.1,
        5,
        9000.0 + 40.0 * np.arange(batch),
        np.where(np.arange(batch) % 2, -1.0, 1.0),
        np.zeros(batch, np.int64),
        np.full((batch, 600), np.nan),
    )


@pytest.fixture(scope="session")
def alone() -> Callable[..., Any]:
    """The force or filter of a law with sizes in the middle of their ranges, started for two trucks."""

    def make(key: str, **sizes: float) -> Any:
        effect = EFFECTS[key]
        truck = truck_of("trucksim" if "trucksim" in effect.trucks else effect.trucks[0])
        middle = {n: 0.5 * (low + high) for n, (low, high) in effect.ranges.items()}
        planted = effect.build(setting(truck), SimpleNamespace(**{**middle, **sizes}))
        (law,) = (*planted.forces, *planted.filters)
        law.reset(2)
        return law

    return make


BASE = {
    "acceleration": 0.0, "shifting": 0.0, "brake_force": 0.0, "grade": 0.0, "distance": 0.0, "speed": 15.0,
    "mass": 2e4, "gear": 8.0, "ratio": 6.0, "engine_speed": 140.0, "engine_torque": 700.0,
    "traction_force": 8000.0, "drag_force": 700.0, "u0": 600.0, "u1": 0.0, "brake_temperature": 80.0,
    "effective_mass": 2.1e4, "rolling_force": 1200.0, "grade_force": 0.0,
}  # fmt: skip


@pytest.fixture(scope="session")
def held() -> Callable[..., Array]:
    """The force of a law after `seconds` of one scene: two trucks at 15 m/s, half loaded."""

    def hold(law: Any, seconds: float, **given: float) -> Array:
        dt = 0.01 if seconds < 20.0 else 0.05
        values = {n: np.full(2, float(v)) for n, v in {**BASE, **given}.items()}
        u = np.stack([values.pop("u0"), values.pop("u1")], axis=1)
        view = SimpleNamespace(**values, u=u, time=0.0)
        for k in range(max(1, round(seconds / dt))):
            view.time = dt * k
            out = law.force(view, dt)
        return np.asarray(out)

    return hold
