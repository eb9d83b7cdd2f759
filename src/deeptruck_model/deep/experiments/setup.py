"""What the experiments have in common: the drives of the reference trucks, and training for one of them."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from deeptruck_model import trucks
from deeptruck_model.deep.arguments import Arguments
from deeptruck_model.deep.experiments.paper_rules import LOOKS
from deeptruck_model.deep.network import TruckNetwork
from deeptruck_model.deep.training import train
from deeptruck_model.deep.truck import DeepTruck
from deeptruck_model.driving_cycles import FREEWAY, YARD, CycleSettings, drive
from deeptruck_model.recordings import Recording
from deeptruck_model.recordings.gated_brake import COMMAND, SWITCH, substituted

# Seeds of the drives: settings were chosen on the validation drives, the test drives are only ever read.
TRAIN_SEED, VALIDATION_SEED, TEST_SEED, OTHER_SEED, LOOK_ALIKE_SEED, FLEET_SEED = 1, 2, 3, 4, 5, 7


class Field(NamedTuple):
    """What the paper recorded of a truck in the field."""

    minutes: float
    cycle: CycleSettings
    gated_brake: bool = False  # its brake is a switch, and the deceleration stands for a command


FIELD = {"freightliner": Field(16, YARD), "volvo": Field(24, FREEWAY, gated_brake=True)}

PAPER = Arguments(mode="paper", rounds=LOOKS)
"""The paper's recipe, whose training passes PAPER_PASSES times over the data."""


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


def field_drives(name: str) -> tuple[Recording, Recording]:
    """The first 85 percent of a field truck's driving, and the rest, with the brake command of the paper."""
    whole = drive_of(name, FIELD[name].minutes, TRAIN_SEED, FIELD[name].cycle)
    if FIELD[name].gated_brake:
        on = (whole.channels[COMMAND] > trucks.load(name).parameters()["brake_gate"]).astype(float)
        whole = substituted(replace(whole, channels={**whole.channels, SWITCH: on, COMMAND: on}))
    edge = round(0.85 * len(whole))
    return whole.piece(0, edge), whole.piece(edge, len(whole))


def passes(truck: DeepTruck, updates: int) -> float:
    """How often `updates` gradient steps of its training saw every sample."""
    config, training = truck.details["config"], truck.details["training"]
    seen = updates * training["steps"] * config["sequences"] * truck.dt
    return float(seen / 3600 / training["hours"])
