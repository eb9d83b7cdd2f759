"""The drives the demo starts from: the paper's cycle, a test drive, a leader, and those of another truck."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
import yaml

from deeptruck_model import driving_cycles, trucks
from deeptruck_model.recordings import Recording, write_bag

OTHER_TRUCK = {"mass": 26_000.0}  # what the simulator does not know: six tonnes of payload ...
DRAGGING_SHARE = 0.10  # ... and one brake that keeps a share of its last force
RELEASE_S = 30.0


class DraggingBrake:
    """A worn return spring: one brake keeps a share of its last force, and lets go over half a minute."""

    def reset(self, batch: int) -> None:
        """Nothing is held at the start."""
        self.held = np.zeros(batch)

    def force(self, view: trucks.View, dt: float) -> np.ndarray:
        """N at the road, against the motion."""
        pressed = DRAGGING_SHARE * np.abs(view.brake_force)
        self.held = np.maximum(pressed, self.held * (1.0 - dt / RELEASE_S))
        return -self.held * np.sign(view.speed)


def cycle_drives(out: Path, hours: float) -> None:
    """Bags `cycle` and `test`, from different seeds, so that the test drive is another road and traffic."""
    truck = trucks.load("trucksim")
    for name, length, seed in (("cycle", hours, 1), ("test", max(0.1, hours / 6), 2)):
        drive = driving_cycles.drive(truck, hours=length, seed=seed, name=name)
        write_bag(out / name, [drive], interface=truck.interface)


def leader(out: Path, seconds: float = 3600.0) -> None:
    """A speed profile of the same generator as CSV, for the truck to follow in the node graph."""
    speed = driving_cycles.speed_profile(seconds, seed=3)
    rows = np.stack([0.1 * np.arange(len(speed)), speed], axis=1)
    np.savetxt(out / "leader.csv", rows, "%.3f", ",", header="time,speed", comments="")


def other_truck(out: Path, seconds: float) -> None:
    """Bags heavy/a .. heavy/d of a truck that differs from the simulator, and what differs, as YAML."""
    truck = trucks.load("trucksim").with_parameters(OTHER_TRUCK).with_forces([DraggingBrake()])
    (out / "heavy").mkdir(exist_ok=True)
    for k, name in enumerate("abcd"):
        drive: Recording = driving_cycles.drive(truck, seconds=seconds, seed=10 + k, name=name)
        write_bag(out / "heavy" / name, [drive], interface=truck.interface)
    truth = {**OTHER_TRUCK, "dragging_brake": {"share": DRAGGING_SHARE, "release_s": RELEASE_S}}
    (out / "heavy.yaml").write_text(yaml.safe_dump(truth))


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
