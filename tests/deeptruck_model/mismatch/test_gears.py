from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from deeptruck_model.mismatch.gears import other_gear
from deeptruck_model.recordings import Recording
from deeptruck_model.signals import TruckInterface

N, DT = 400, 0.1
SPEED = np.full(N, 15.0)


def drive(**channels: np.ndarray[Any, Any]) -> Any:
    """As much of a prepared recording as is looked at."""
    whole = Recording("drive", DT, {"speed": SPEED, **channels}, TruckInterface("truck", "N m"))
    return SimpleNamespace(recording=whole, y=np.stack([np.zeros(N), SPEED], axis=1), dt=DT)


def run(gear: np.ndarray[Any, Any], engine_speed: np.ndarray[Any, Any]) -> Any:
    return SimpleNamespace(inside={"gear": gear[None], "engine_speed": engine_speed[None]})


GEAR = np.where(np.arange(N) < 250, 7.0, 8.0)
ENGINE_SPEED = np.where(np.arange(N) < 250, 150.0, 115.0)
LATER = np.where(np.arange(N) < 300, 7.0, 8.0)
FASTER = np.where(np.arange(N) < 300, 150.0, 115.0)


@pytest.mark.parametrize("recorded", [{"gear": GEAR + 1.0}, {"engine_speed": ENGINE_SPEED}])
def test_where_the_simulator_shifts_later(recorded: dict[str, np.ndarray[Any, Any]]) -> None:
    """Gears numbered from another one on are the same gears."""
    ((marked,), _) = other_gear([drive(**recorded)], [run(LATER, FASTER)])
    assert marked[250:300].all() and not marked[:244].any() and not marked[306:].any()


@pytest.mark.parametrize("recorded", [{"gear": GEAR}, {"engine_speed": ENGINE_SPEED}, {}])
def test_nothing_is_marked_where_gears_agree_or_nothing_tells(
    recorded: dict[str, np.ndarray[Any, Any]],
) -> None:
    ((marked,), _) = other_gear([drive(**recorded)], [run(GEAR, ENGINE_SPEED)])
    assert not marked.any()


def test_a_truck_with_other_ratios_is_not_rejected_as_a_whole() -> None:
    ((marked,), _) = other_gear([drive(engine_speed=2.0 * ENGINE_SPEED)], [run(GEAR, ENGINE_SPEED)])
    assert not marked.any()
