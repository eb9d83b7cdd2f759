"""`deeptruck-model mismatch`, `apply`, `road` and `prove`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from deeptruck_model.cli.inputs import present
from deeptruck_model.errors import InputError

FIND_FIRST = "; run 'deeptruck-model mismatch --out {}' first"
Bags = Annotated[
    list[Path], typer.Option(help="Recordings (bags) to explain; repeat the option or list several.")
]


def mismatch(
    simulator: Annotated[str, typer.Option(help="Simulator directory, or truck:NAME[:overrides.yaml].")],
    recordings: Bags,
    out: Annotated[Path, typer.Option(help="Folder for verdict.json, report.html and simulator/.")],
    held_out: Annotated[list[Path] | None, typer.Option(help="Recordings used only to judge.")] = None,
    more: Annotated[list[Path] | None, typer.Argument(hidden=True, metavar="BAG")] = None,
    seed: Annotated[int, typer.Option(help="Of the input noise the simulator is tried with.", min=0)] = 0,
    with_unnamed: Annotated[
        bool, typer.Option(help="Correct what has no name too, by laws of the recorded signals.")
    ] = False,
) -> None:
    """Find what a simulator leaves out when recordings differ from it.

    Example: deeptruck-model mismatch --simulator truck:trucksim --recordings a b c --held-out d --out found
    """
    present(*recordings, *(held_out or []))
    from rich.console import Console

    from deeptruck_model import recordings as rec
    from deeptruck_model import simulators
    from deeptruck_model.mismatch import find_mismatch, write
    from deeptruck_model.mismatch.output import reserved

    console = Console(stderr=True)
    with reserved(out) as replaced, console.status("reading") as status:
        truck = simulators.load(simulator)
        rate = 1.0 / truck.dt
        fit = [r for bag in recordings for r in rec.read(bag, rate_hz=rate)]
        held = [r for bag in held_out or [] for r in rec.read(bag, rate_hz=rate)]
        found = find_mismatch(truck, fit, held, seed=seed, with_unnamed=with_unnamed, say=status.update)
        status.update("writing the report")
        write(found, out)
    print(f"{found.verdict['verdict']}: see {out / 'report.html'}")
    if replaced:
        print(f"  note: the result that was in {out} is replaced")
    for f in found.verdict["findings"]:
        print(f"  {f['effect']}: {f['says']} ({_how_sure(f)})")
    if found.verdict["fit"].get("validated"):
        print(f"  {_improvement(found.verdict['fit'])}: deeptruck-model apply {out} --out better")
    for caveat in found.verdict["caveats"]:
        print(f"  note: {caveat}")


def _improvement(fit: dict[str, Any]) -> str:
    """What the correction is worth on drives it was not fitted to."""
    before, after = (fit[name]["speed_rmse"] for name in ("before", "after"))
    return f"corrected, the speed error of held-out free runs falls from {before:.3g} to {after:.3g} m/s"


def _how_sure(finding: dict[str, Any]) -> str:
    """Its probability, and what it may be instead."""
    from deeptruck_model.mismatch.page_words import percent

    alike = ", ".join(finding["cannot_be_told_from"])
    return f"probability {percent(finding['probability'])}" + (f"; or {alike}" if alike else "")


def apply(
    directory: Annotated[Path, typer.Argument(help="Folder that 'mismatch' wrote.")],
    out: Annotated[Path, typer.Option(help="New simulator directory.")],
) -> None:
    """Take over the corrected simulator. Refuses where the held-out error did not improve.

    Example: deeptruck-model apply found --out better
    """
    present(directory, cure=FIND_FIRST.format(directory))
    from deeptruck_model.mismatch import apply as apply_correction

    apply_correction(directory, out)
    print(f"corrected simulator in {out}")


def road(
    directory: Annotated[Path, typer.Argument(help="Folder that 'mismatch' wrote.")],
    recordings: Annotated[list[Path], typer.Argument(help="The bags it was run on, without a grade.")],
    out: Annotated[Path, typer.Option(help="New bag.")],
) -> None:
    """Write recordings again with the slope that was recovered as their grade, to train a truck on it.

    Example: deeptruck-model road found a b c --out with_road
    """
    present(directory, cure=FIND_FIRST.format(directory))
    present(*recordings)
    from deeptruck_model import recordings as rec
    from deeptruck_model.mismatch.recovered_road import Roads, with_road

    roads = Roads.read(directory)
    made, left_out = with_road(roads, [r for bag in recordings for r in rec.read(bag)])
    rec.write_bag(out, made, interface=made[0].interface)
    print(f"{len(made)} recordings with a grade in {out}")
    if left_out:
        print(f"  note: left out, as no slope was told of them: {', '.join(left_out)}")


def prove(
    out: Annotated[Path, typer.Option(help="Folder for the cases, proof.md, scoreboard.json and figures.")],
    level: Annotated[
        list[str] | None, typer.Option(help="Level to prove; repeat for several. Default: all.")
    ] = None,
    cases: Annotated[
        int, typer.Option(help="Cases of each level; 'nothing_missing' gets five times as many.", min=1)
    ] = 40,
    simulator: Annotated[list[str] | None, typer.Option(help="physics, deep or both (default).")] = None,
    jobs: Annotated[int, typer.Option(help="Cases at once.", min=1)] = 2,
    seed: Annotated[
        int, typer.Option(help="First seed; those below 100000 are for development.", min=0)
    ] = 100000,
    forms: Annotated[
        str,
        typer.Option(
            help="Family of effects to hide: 'all', one of the seven ('first' to 'seventh') or 'sealed'."
        ),
    ] = "all",
) -> None:
    """Examine the mismatch tool on hidden effects, sealed before it starts; resumes where it stopped.

    Example: deeptruck-model prove --out proof --cases 5 --simulator physics
    """
    from deeptruck_exam.command import prove as run
    from deeptruck_exam.plans import LEVELS

    run(out, tuple(level or LEVELS), cases, jobs, seed, tuple(simulator or ("physics", "deep")), forms=forms)
    print(f"scoreboard in {out / 'proof.md'}")


def register(app: typer.Typer) -> None:
    """Add this room's commands to the console script."""
    app.command()(mismatch)
    app.command()(apply)
    app.command()(road)
    app.command()(prove)


__all__ = ["InputError", "register"]
