"""What the experiments have in common: the drives of the reference trucks, and training for one of them."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from deeptruck_model import trucks
from deeptruck_model.deep.arguments import Arguments
from deeptruck_model.deep.network import TruckNetwork
from deeptruck_model.deep.training import train
from deeptruck_model.deep.truck import DeepTruck
from deeptruck_model.driving_cycles import CycleSettings, drive
from deeptruck_model.recordings import Recording

# Seeds of the drives: settings were chosen on the validation drives, the test drives are only ever read.
TRAIN_SEED, VALIDATION_SEED, TEST_SEED, OTHER_SEED, LOOK_ALIKE_SEED, FLEET_SEED = 1, 2, 3, 4, 5, 7


def chosen(seeds: int, updates: int, mode: Any = "default") -> Arguments:
    """The settings of an experiment."""
    return Arguments(members=seeds, updates=updates, mode=mode)


def drive_of(name: str, minutes: float, seed: int, cycle: CycleSettings | None = None) -> Recording:
    """`minutes` of a reference truck."""
    return drive(trucks.load(name), seconds=60 * minutes, seed=seed, settings=cycle)


def trained(
    drives: list[Recording],
    arguments: Arguments,
    observe: Callable[[int, TruckNetwork], None] | None = None,
) -> DeepTruck:
    """A truck trained on `drives`; nothing is left on the disk."""
    with tempfile.TemporaryDirectory() as folder:
        return train(drives, Path(folder) / "truck", arguments, observe=observe)
