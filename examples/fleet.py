"""Trucks to try `deeptruck-model fleet` on: a folder of bags for each, and every third truck differs.

python examples/fleet.py --out drives
deeptruck-model fleet mismatch drives/*/ --simulator truck:trucksim --out found
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from deeptruck_model import trucks
from deeptruck_model.recordings import write_bag
from deeptruck_model.trucks import driving_cycles

FACTORS = ({"drag_area": 1.3}, {"brake_gain": 0.75}, {"mass": 1.25})
SPEED_NOISE = 0.003  # m/s


def main(
    out: Annotated[Path, typer.Option(help="New folder.")],
    trucks_: Annotated[int, typer.Option("--trucks", help="How many.", min=1)] = 6,
    drives: Annotated[int, typer.Option(help="Of each truck.", min=1)] = 4,
    seconds: Annotated[float, typer.Option(help="Of each drive.", min=60.0)] = 300.0,
) -> None:
    """Drive the trucks."""
    sound = trucks.load("trucksim")
    given = sound.parameters()
    for number in range(trucks_):
        factors = FACTORS[number // 3 % len(FACTORS)] if number % 3 == 1 else {}
        truck = sound.with_parameters({name: given[name] * f for name, f in factors.items()})
        for k in range(drives):
            seed = 100 * number + k
            drive = driving_cycles.drive(truck, seconds=seconds, seed=seed)
            drive.channels["speed"] += np.random.default_rng(seed).normal(0.0, SPEED_NOISE, len(drive))
            write_bag(out / f"truck{number}" / f"drive{k}", [drive], interface=drive.interface)
        print(f"{out}/truck{number}: {factors or 'as truck:trucksim'}")


if __name__ == "__main__":
    typer.run(main)
