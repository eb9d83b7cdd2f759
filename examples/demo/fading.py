"""Four hilly drives of a truck whose brakes fade, to find that by hand in the page of a mismatch."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from deeptruck_model import console, driving_cycles, files, trucks
from deeptruck_model.driving_cycles import CycleSettings, RoadSettings
from deeptruck_model.recordings import write_bag
from deeptruck_model.results import BAG_FILES

DRIVES = files.Result(
    "a folder of drives with fading brakes",
    tuple(f"{bag}/{name}" for bag in "abcd" for name in (*BAG_FILES, files.LEDGER)),
)
# chosen, not measured: so large that it is seen by eye
HEATS_J_PER_K = 250e3
COOLS_S = 180.0
LOSS_PER_K, MOST_LOST = 0.004, 0.6
HILLS = CycleSettings(road=RoadSettings(limit=0.06, step=0.003), braking_share=0.12)
NOISE_M_S = 0.01


class FadingBrakes:
    """Braking heats the drums, and hot drums brake less; cold ones brake as the simulator's do."""

    def reset(self, batch: int) -> None:
        """Cold."""
        self.warmer_k = np.zeros(batch)

    def force(self, view: trucks.View, dt: float) -> np.ndarray:
        """N at the road: what is missing of the brakes' force; none at rest."""
        braking = np.abs(view.brake_force)
        self.warmer_k += dt * (braking * view.speed / HEATS_J_PER_K - self.warmer_k / COOLS_S)
        return np.minimum(MOST_LOST, LOSS_PER_K * self.warmer_k) * braking * (view.speed > 0.5)


def main(
    out: Annotated[Path, typer.Option(help="Folder for the bags a .. d.")],
    seconds: Annotated[float, typer.Option(help="Of each drive, s.", min=60.0)] = 900.0,
    overwrite: Annotated[bool, typer.Option("--overwrite", help=files.OVERWRITE_HELP)] = False,
) -> None:
    """Write the bags, all or none."""
    truck = trucks.load("trucksim").with_forces([FadingBrakes()])
    rng = np.random.default_rng(30)
    with DRIVES.replacing(out, overwrite=overwrite) as draft:
        for k, name in enumerate("abcd"):
            drive = driving_cycles.drive(truck, seconds=seconds, seed=40 + k, settings=HILLS, name=name)
            noisy = drive.channels["speed"] + rng.normal(0.0, NOISE_M_S, len(drive))
            measured = replace(drive, channels={**drive.channels, "speed": noisy})
            write_bag(draft / name, [measured], interface=truck.interface)


def _guarded() -> None:
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    app.command()(main)
    console.run(app, "fading")


if __name__ == "__main__":
    _guarded()
