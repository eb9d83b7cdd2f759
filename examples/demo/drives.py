"""The drives the demo starts from: the paper's cycle, a test drive, a leader, and those of another truck."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
import yaml

from deeptruck_model import driving_cycles, files, trucks
from deeptruck_model.recordings import write_bag

OTHER_TRUCK = {"mass": 26_000.0, "brake_gain": 0.75}  # six tonnes of payload and worn brakes ...
WIND = 6.0  # ... against a wind that no sensor sees, m/s
AIR_DENSITY = 1.2
DRAG_AREA = 6.0  # m^2
NOISE = {"speed": 0.03, "acceleration": 0.05, "grade": 0.001}  # standard deviation of the sensors, SI


class Headwind:
    """What a steady wind adds to the drag the truck knows."""

    def reset(self, batch: int) -> None:
        """It remembers nothing."""

    def force(self, view: trucks.View, dt: float) -> np.ndarray:
        """N at the road; zero at rest, where nobody would feel it."""
        added = (view.speed + WIND) ** 2 - view.speed**2
        return -0.5 * AIR_DENSITY * DRAG_AREA * added * (view.speed > 0.5)


def cycle_drives(out: Path, hours: float) -> None:
    """Bags `cycle` and `test`, from different seeds, so that the test drive is another road and traffic."""
    truck = trucks.load("trucksim")
    for name, length, seed in (("cycle", hours, 1), ("test", max(0.1, hours / 2), 2)):
        drive = driving_cycles.drive(truck, hours=length, seed=seed, name=name)
        write_bag(out / name, [drive], interface=truck.interface)


def leader(out: Path, seconds: float = 3600.0) -> None:
    """A speed profile of the same generator as CSV, for the truck to follow in the node graph."""
    speed = driving_cycles.speed_profile(seconds, seed=3)
    rows = np.stack([0.1 * np.arange(len(speed)), speed], axis=1)
    with files.new_file(out / "leader.csv") as draft:
        np.savetxt(draft, rows, "%.3f", ",", header="time,speed", comments="")


def other_truck(out: Path, seconds: float) -> None:
    """Bags heavy/a .. heavy/d of a truck that differs from the simulator, and what differs, as YAML."""
    truck = trucks.load("trucksim").with_parameters(OTHER_TRUCK).with_forces([Headwind()])
    rng = np.random.default_rng(20)
    (out / "heavy").mkdir(exist_ok=True)
    for k, name in enumerate("abcd"):
        drive = driving_cycles.drive(truck, seconds=seconds, seed=10 + k, name=name)
        noisy = {c: drive.channels[c] + rng.normal(0.0, sd, len(drive)) for c, sd in NOISE.items()}
        measured = replace(drive, channels={**drive.channels, **noisy})
        write_bag(out / "heavy" / name, [measured], interface=truck.interface)
    with files.new_file(out / "heavy.yaml") as draft:
        draft.write_text(yaml.safe_dump({**OTHER_TRUCK, "headwind_m_per_s": WIND}))


def main(
    out: Annotated[Path, typer.Option(help="Folder for the bags.")],
    hours: Annotated[float, typer.Option(help="Of the driving cycle, h.")],
    mismatch_s: Annotated[float, typer.Option(help="Of each drive of the other truck, s.")],
) -> None:
    """Write the bags."""
    out.mkdir(parents=True, exist_ok=True)
    print(f"driving {hours:g} h", flush=True)
    cycle_drives(out, hours)
    leader(out)
    print("driving another truck", flush=True)
    other_truck(out, mismatch_s)


if __name__ == "__main__":
    typer.run(main)
