"""`deeptruck-model mismatch`, `apply` and `prove`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from deeptruck_model.errors import InputError

Bags = Annotated[
    list[Path], typer.Option(help="Recordings (bags) to explain; repeat the option or list several.")
]


def mismatch(
    simulator: Annotated[str, typer.Option(help="Simulator directory, or truck:NAME[:overrides.yaml].")],
    recordings: Bags,
    out: Annotated[Path, typer.Option(help="Folder for verdict.json, report.html and simulator/.")],
    held_out: Annotated[list[Path] | None, typer.Option(help="Recordings used only to judge.")] = None,
    more: Annotated[list[Path] | None, typer.Argument(hidden=True)] = None,
    seed: Annotated[int, typer.Option(help="Seed of the input noise the simulator is tried with.")] = 0,
) -> None:
    """Find what a simulator leaves out when recordings differ from it.

    Example: deeptruck-model mismatch --simulator truck:trucksim --recordings a b c --held-out d --out found
    """
    from rich.console import Console

    from deeptruck_model import recordings as rec
    from deeptruck_model import simulators
    from deeptruck_model.mismatch import find_mismatch, write

    console = Console(stderr=True)
    with console.status("reading") as status:
        truck = simulators.load(simulator)
        rate = 1.0 / truck.dt
        fit = [r for bag in recordings for r in rec.read(bag, rate_hz=rate)]
        held = [r for bag in held_out or [] for r in rec.read(bag, rate_hz=rate)]
        found = find_mismatch(truck, fit, held, seed=seed, say=status.update)
        status.update("writing the report")
        write(found, out)
    print(f"{found.verdict['verdict']}: see {out / 'report.html'}")
    for f in found.verdict["findings"]:
        print(f"  {f['effect']}: {f['says']}")


def apply(
    directory: Annotated[Path, typer.Argument(help="Folder that 'mismatch' wrote.")],
    out: Annotated[Path, typer.Option(help="New simulator directory.")],
) -> None:
    """Take over the corrected simulator. Refuses where the held-out error did not improve."""
    from deeptruck_model.mismatch import apply as apply_correction

    apply_correction(directory, out)
    print(f"corrected simulator in {out}")


def register(app: typer.Typer) -> None:
    """Add this room's commands to the console script."""
    app.command()(mismatch)
    app.command()(apply)


__all__ = ["InputError", "register"]
