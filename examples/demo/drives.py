"""The drives the demo starts from: the paper's cycle, a test drive, a leader, and another truck's."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
import yaml

from deeptruck_core import files
from deeptruck_core.terminal import console
from deeptruck_model import trucks
from deeptruck_model.mismatch.correction.fit_result import acts
from deeptruck_model.recordings import write_bag
from deeptruck_model.trucks import driving_cycles

DRIVES = files.Result("a folder of the demo's drives")
BRAKES = 6  # of a three-axle truck, all alike
LETS_GO_S = 20.0  # chosen, as no figure is published; brakes in order have 0.55 s (FMVSS 121, S5.3.4)
NOISE = {"speed": 0.03, "acceleration": 0.05, "grade": 0.001}  # standard deviation of the sensors, SI


class _Log(list[tuple[float, float]]):
    """(time s, force N) of a drive; the copies of a truck's state share it."""

    def __deepcopy__(self, memo: object) -> _Log:
        return self


class StickingBrake:
    """One brake of six presses with the others, but comes off slowly: its return spring is weak."""

    effect = "dragging_brake"
    says = (
        f"one of {BRAKES} brakes does not let go when it is released: the force it holds falls with a "
        f"time constant of {LETS_GO_S:g} s"
    )

    def __init__(self) -> None:
        self.log = _Log()

    def reset(self, batch: int) -> None:
        """Released."""
        self.held = np.zeros(batch)

    def force(self, view: trucks.View, dt: float) -> np.ndarray:
        """N at the road: what the brake holds beyond its share of the truck's braking; none at rest."""
        pressed = np.abs(view.brake_force) / BRAKES
        self.held = np.maximum(pressed, self.held * (1.0 - dt / LETS_GO_S))
        force = (pressed - self.held) * (view.speed > 0.5)
        self.log.append((view.time, float(force[0])))
        return force


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
    np.savetxt(out / "leader.csv", rows, "%.3f", ",", header="time,speed", comments="")


def other_truck(out: Path, seconds: float, seed: int = 20) -> None:
    """Bags other/a .. other/d of a truck that differs from the simulator.

    What differs is in hidden.yaml, its force (N) over each drive's time (s) in hidden.csv.
    """
    rng = np.random.default_rng(seed)
    (out / "other").mkdir(exist_ok=True)
    hidden: dict[str, np.ndarray] = {}
    for k, name in enumerate("abcd"):
        brake = StickingBrake()
        truck = trucks.load("trucksim").with_forces([brake])
        drive = driving_cycles.drive(truck, seconds=seconds, seed=10 + k, name=name)
        noisy = {c: drive.channels[c] + rng.normal(0.0, sd, len(drive)) for c, sd in NOISE.items()}
        measured = replace(drive, channels={**drive.channels, **noisy})
        write_bag(out / "other" / name, [measured], interface=truck.interface)
        times, force = np.array(brake.log).T
        hidden |= {
            "time": drive.time - drive.start_s,
            name: np.interp(drive.time - drive.start_s, times, force),
        }
    np.savetxt(
        out / "hidden.csv", np.stack(list(hidden.values()), axis=1), "%.2f", ",",
        header=",".join(hidden), comments="",
    )  # fmt: skip
    (out / "hidden.yaml").write_text(yaml.safe_dump(_description(hidden)))


def _description(hidden: dict[str, np.ndarray]) -> dict[str, Any]:
    """What was hidden, by the effect's name, in words, and as its mean while it acts on the drives a to c."""
    force = np.concatenate([hidden[drive] for drive in "abc"])
    acting = acts(force, np.ones(len(force), dtype=bool), float(hidden["time"][1] - hidden["time"][0]))
    return {
        "effect": StickingBrake.effect,
        "says": StickingBrake.says,
        "mean_force_n": float(force[acting].mean()) if acting.any() else 0.0,
        "share_of_time": float(acting.mean()),
    }


def main(
    out: Annotated[Path, typer.Option(help="Folder for the bags.")],
    hours: Annotated[float, typer.Option(help="Of the driving cycle, h.")],
    mismatch_s: Annotated[float, typer.Option(help="Of each drive of the other truck, s.")],
    overwrite: Annotated[bool, typer.Option("--overwrite", help=files.OVERWRITE_HELP)] = False,
) -> None:
    """Write the bags, all or none."""
    with DRIVES.replacing(out, overwrite=overwrite) as draft:
        print(f"driving {hours:g} h", flush=True)
        cycle_drives(draft, hours)
        leader(draft)
        print("driving another truck", flush=True)
        other_truck(draft, mismatch_s)


if __name__ == "__main__":
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    app.command()(main)
    console.run(app, "drives")
