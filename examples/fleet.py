"""A fleet of small trucks to try `deeptruck-model fleet` on: one class, some of them with something wrong.

    python examples/fleet.py --out drives --trucks 12
    deeptruck-model fleet drives --layout '{truck}/{date}/*.mcap' --simulator truck:trucksim \
        --trucks drives/trucks.csv --out result

Every third truck from the second on is affected: more drag, a weak brake, or soft tyres. `truth.json` next to
the drives says which. With `--out s3://BUCKET/drives --endpoint http://127.0.0.1:9000` they are made there.
"""

from __future__ import annotations

from datetime import date, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import numpy as np
import typer

from deeptruck_model import trucks
from deeptruck_model.fleet.storage import place
from deeptruck_model.recordings import write_bag
from deeptruck_model.trucks import PhysicsTruck, driving_cycles

FAULTS = ({"drag_area": 1.25}, {"brake_gain": 0.8}, {"rolling_resistance": 1.3})
FIRST_DAY = date(2026, 3, 2)
SPEED_NOISE = 0.003  # m/s


def factors(number: int, every: int) -> dict[str, float]:
    """What is wrong with a truck, as factors of the simulator's parameters; nothing for most."""
    return FAULTS[number // every % len(FAULTS)] if number % every == 1 else {}


def drive_bag(truck: PhysicsTruck, folder: Path, seconds: float, seed: int) -> bytes:
    """One drive as the content of an MCAP file."""
    drive = driving_cycles.drive(truck, seconds=seconds, seed=seed)
    drive.channels["speed"] += np.random.default_rng(seed).normal(0.0, SPEED_NOISE, len(drive))
    bag = folder / f"drive{seed}"
    write_bag(bag, [drive], interface=drive.interface)
    return next(bag.glob("*.mcap")).read_bytes()


def main(
    out: Annotated[str, typer.Option(help="Folder, or s3:// address.")],
    trucks_: Annotated[int, typer.Option("--trucks", help="How many.", min=2)] = 12,
    drives: Annotated[int, typer.Option(help="Of each truck.", min=2)] = 6,
    seconds: Annotated[float, typer.Option(help="Of each drive.", min=60.0)] = 120.0,
    every: Annotated[int, typer.Option(help="One truck in so many is affected.", min=2)] = 3,
    endpoint: Annotated[str | None, typer.Option(help="Of an S3 server.")] = None,
) -> None:
    """Drive the trucks and write a file a drive."""
    target, sound = place(out, endpoint), trucks.load("trucksim")
    own, truth, rows = sound.parameters(), {}, ["truck,build,load"]
    with TemporaryDirectory() as temporary:
        for number in range(trucks_):
            name, wrong = f"truck{number:03d}", factors(number, every)
            truck = sound.with_parameters({p: own[p] * f for p, f in wrong.items()}) if wrong else sound
            truth[name] = wrong
            rows.append(f"{name},{2019 + number % 4},{'bulk' if number % 2 else 'parcels'}")
            for k in range(drives):
                day = FIRST_DAY + timedelta(days=3 * k)
                content = drive_bag(truck, Path(temporary), seconds, 1000 * number + k)
                target.write(f"{name}/{day}/drive{k}.mcap", content)
    target.write("trucks.csv", ("\n".join(rows) + "\n").encode())
    target.write_json("truth.json", truth)
    typer.echo(f"{trucks_} trucks of {drives} drives in {out}, {sum(map(bool, truth.values()))} affected")


if __name__ == "__main__":
    typer.run(main)
