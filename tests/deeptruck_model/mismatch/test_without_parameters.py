"""A simulator that has nothing to refit but reports its forces is no learned one: what lasts is seen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from deeptruck_core.constants import GRAVITY
from deeptruck_model import trucks
from deeptruck_model.mismatch import find_mismatch
from deeptruck_model.mismatch.verdict.result import Conclusion
from deeptruck_model.mismatch.verdict.wording import COUNTS_AS_LEARNED
from deeptruck_model.simulators import Run
from deeptruck_model.trucks import PhysicsTruck, driving_cycles

CLIMB = 0.02


class Climb:
    """All the way."""

    def reset(self, batch: int) -> None: ...

    def force(self, view: Any, dt: float) -> np.ndarray:
        return np.asarray(-view.mass * GRAVITY * CLIMB)


class NothingToRefit:
    """A truck whose parameters are its own business."""

    def __init__(self, truck: PhysicsTruck) -> None:
        self._truck = truck

    def __getattr__(self, name: str) -> Any:
        return getattr(self._truck, name)

    def parameters(self) -> dict[str, float]:
        return {}

    def with_parameters(self, values: Mapping[str, float]) -> NothingToRefit:
        return self


class ReportsNothing(NothingToRefit):
    """Nor what acts inside it."""

    def inside(self, state: Any) -> dict[str, np.ndarray]:
        return {}

    def rollout(self, *given: Any, **more: Any) -> Run:
        return replace(self._truck.rollout(*given, **more), inside={})


def test_what_neither_parameters_nor_forces_cost_is_said() -> None:
    plain = trucks.load("trucksim")
    drives = [driving_cycles.drive(plain, seconds=120, seed=k) for k in range(2)]
    result = find_mismatch(ReportsNothing(plain), drives[:1], drives[1:]).result  # type: ignore[arg-type]
    assert COUNTS_AS_LEARNED in result.caveats and result.kind is Conclusion.NOTHING


@pytest.mark.long
def test_a_steady_climb_is_no_case_of_nothing_missing() -> None:
    plain = trucks.load("trucksim")
    blind = PhysicsTruck(
        replace(plain.specification, interface=replace(plain.interface, grade=False, fuel=False))
    )
    flat = driving_cycles.CycleSettings(road=driving_cycles.RoadSettings(limit=0.0))
    drives = []
    for k in range(4):
        drive = driving_cycles.drive(blind.with_forces([Climb()], []), seconds=240, seed=k, settings=flat)
        drive.channels["speed"] += np.random.default_rng(k).normal(0.0, 0.005, len(drive))
        drives.append(drive)
    result = find_mismatch(NothingToRefit(blind), drives[:3], drives[3:]).result  # type: ignore[arg-type]
    assert result.kind is Conclusion.PHYSICS
    first = result.findings[0]  # a steady climb resembles any steady drag: only its size is known
    assert first.strength.value == pytest.approx(-blind.parameters()["mass"] * GRAVITY * CLIMB, rel=0.1)
    # 0.10 or 0.25 with nearly the same draws: slopes with knots of 17 or 41 fit the mean force alike
    assert result.fit.errors.after.speed < 0.3 * result.fit.errors.before.speed
