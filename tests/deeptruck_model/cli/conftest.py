"""Bags of a truck."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from deeptruck_model import trucks
from deeptruck_model.recordings import write_bag
from deeptruck_model.trucks import driving_cycles


@pytest.fixture(scope="session")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """bag(name, seconds, seed=) -> a bag of a drive of `trucksim`."""

    def _bag(name: str, seconds: float, seed: int = 0) -> Path:
        drive = driving_cycles.drive(trucks.load("trucksim"), seconds=seconds, seed=seed, name=name)
        return write_bag(tmp_path_factory.mktemp("bags") / name, [drive], interface=drive.interface)

    return _bag
