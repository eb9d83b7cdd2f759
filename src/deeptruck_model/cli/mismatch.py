"""`deeptruck-model mismatch`, `apply` and `prove`."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from deeptruck_core.errors import InputError
from deeptruck_core.signals import speed_unit
from deeptruck_core.terminal import console
from deeptruck_core.terminal.progress import progress
from deeptruck_model import calls
from deeptruck_model.cli.inputs import (
    SIMULATOR,
    ClockOption,
    MessageFiles,
    Overwrite,
    TopicMap,
    Units,
    show_accounts,
)
from deeptruck_model.mismatch import folders
from deeptruck_model.results import FOUND, apart

if TYPE_CHECKING:
    from deeptruck_model.mismatch import Mismatch
    from deeptruck_model.mismatch.mechanisms import Mechanism

SPOKEN_S = 20.0  # between two lines of a log while one step lasts
Bags = Annotated[
    list[Path], typer.Option(help="Recordings (bags) to explain; repeat the option or list several.")
]


def mismatch(
    simulator: Annotated[str, typer.Option(help=SIMULATOR)],
    recordings: Bags,
    out: Annotated[Path, typer.Option(help="Folder for verdict.json, report.html and simulator/.")],
    held_out: Annotated[list[Path] | None, typer.Option(help="Recordings used only to judge.")] = None,
    seed: Annotated[int, typer.Option(help="Seed of the noise put on the simulator's inputs.", min=0)] = 0,
    mass_kg: Annotated[
        float | None,
        typer.Option(help="Mass of the truck, kg, where the simulator does not state it: forces in newtons."),
    ] = None,
    no_vehicle_ahead: Annotated[
        bool,
        typer.Option(
            "--no-vehicle-ahead",
            help="State that no vehicle was near enough ahead for its wake to matter: no gap is needed.",
        ),
    ] = False,
    topic_map: TopicMap = None,
    clock: ClockOption = None,
    msg: MessageFiles = None,
    exclude: Annotated[
        list[str] | None,
        typer.Option(metavar="EFFECT", help="Leave this effect out of the library; repeat for more."),
    ] = None,
    mechanisms: Annotated[
        Path | None,
        typer.Option(help="Python file with MECHANISMS of your own, compared beside the library."),
    ] = None,
    without: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME:FROM:TO",
            help="Leave rows of a recording out, seconds from the start of its bag; repeat for more.",
        ),
    ] = None,
    units: Units = "m/s",
    overwrite: Overwrite = False,
) -> None:
    """Find what a simulator leaves out when recordings differ from it.

    Example: deeptruck-model mismatch --simulator truck:trucksim --recordings a b c --held-out d --out found
    """
    held_out = held_out or []
    left_out = _spans(without or [])
    FOUND.check(out, overwrite=overwrite)
    apart(out, Path(simulator), *recordings, *held_out)
    calls.mass(mass_kg)
    speed_unit(units)
    if exclude:  # before long recordings are read
        from deeptruck_model.mismatch.mechanisms.families import check_excluded

        check_excluded(exclude)
    user_mechanisms: tuple[Mechanism, ...] = ()
    if mechanisms is not None:
        from deeptruck_model.mismatch import LIBRARY

        user_mechanisms = LIBRARY.read(mechanisms)
    from deeptruck_model.recordings.several import check, check_paths_apart

    check_paths_apart(recordings, held_out)
    check([*recordings, *held_out], topic_map)
    with FOUND.replacing(out, overwrite=overwrite) as draft, progress("loading", SPOKEN_S) as say:
        from deeptruck_model import recordings as rec
        from deeptruck_model import simulators

        truck = simulators.load(simulator)
        say("reading the recordings")
        rate = 1.0 / truck.dt
        fit, held = (
            rec.read_all(bags, topic_map=topic_map, rate_hz=rate, among=others, clock=clock, msg=msg or ())
            for bags, others in ((recordings, held_out), (held_out, recordings))
        )
        if no_vehicle_ahead:
            fit, held = ([replace(r, no_vehicle_ahead=True) for r in part] for part in (fit, held))
        show_accounts([*fit, *held])
        # these take seconds to import: a bag that cannot be read is refused before
        say("loading the comparison")
        from deeptruck_model.mismatch import Span, find_mismatch
        from deeptruck_model.mismatch.output import fill

        spans = [Span(*span) for span in left_out]
        found = find_mismatch(
            truck, fit, held, seed=seed, exclude=exclude or (), without=spans, say=say, mass_kg=mass_kg,
            mechanisms=user_mechanisms,
        )  # fmt: skip
        say("writing the report")
        fill(draft, found, folders.apply_command(out), units)
    _show(found, out, units)


def _show(found: Mismatch, out: Path, units: str) -> None:
    """Print the verdict's first sentences, speeds in `units`."""
    from deeptruck_model.mismatch import summary

    said = summary(found, units)
    print(*said, sep="\n")
    print(f"report: {out / 'report.html'}")
    if found.result.validated and not found.result.data.doubts:
        print(f"    {folders.apply_command(out)}")
    for caveat in found.result.caveats:
        if not any(caveat in line for line in said):
            print(f"note: {caveat}")


def _spans(texts: list[str]) -> list[tuple[str, float, float]]:
    """Parse rows given as NAME:FROM:TO. Raises InputError for other text."""
    out = []
    for text in texts:
        name, *ends = text.rsplit(":", 2)
        try:
            begin, end = map(float, ends)
        except ValueError:
            begin = end = 0.0
        if not name or not begin < end:
            raise InputError(
                f"--without '{text}' is not understood; write NAME:FROM:TO, in seconds: monday:78:143"
            )
        out.append((name, begin, end))
    return out


def apply(
    directory: Annotated[Path, typer.Argument(help="Folder that 'mismatch' wrote.")],
    out: Annotated[Path, typer.Option(help="New simulator directory.")],
    refit: Annotated[
        bool,
        typer.Option("--refit", help="Take over refitted parameters alone, without added forces."),
    ] = False,
    overwrite: Overwrite = False,
) -> None:
    """Take over the simulator that drives held-out recordings best: corrected, or with parameters refitted
    alone. Refuses where neither is better than the one as given.

    Example: deeptruck-model apply found --out better
    """
    folders.APPLIED.check(out, overwrite=overwrite)
    apart(out, directory)
    folders.applicable(directory, refit=refit)
    from deeptruck_model.mismatch import apply as apply_correction
    from deeptruck_model.mismatch import read
    from deeptruck_model.mismatch.report.lines import contains
    from deeptruck_model.mismatch.verdict.result import Answer

    apply_correction(directory, out, refit=refit, overwrite=overwrite)
    verdict = read(directory)
    print(f"simulator in {out}", *contains(verdict, refit=refit), sep="\n")
    if (advice := verdict.advice.get("apply")) is not None and advice.answer is not Answer.YES:
        print(f"note: the report does not advise it: {advice.reason}", file=sys.stderr)


LEVEL_CASES, PLANT_CASES = 40, 5


def prove(
    out: Annotated[Path, typer.Option(help="Folder for the cases, proof.md, scoreboard.json and figures.")],
    level: Annotated[
        list[str] | None, typer.Option(help="Level to prove; repeat for several. Default: all.")
    ] = None,
    cases: Annotated[
        int | None,
        typer.Option(
            help="Cases of each level, 40; 'nothing_missing' gets five times as many. Of a plant, 5.", min=1
        ),
    ] = None,
    simulator: Annotated[list[str] | None, typer.Option(help="physics, deep or both (default).")] = None,
    jobs: Annotated[int, typer.Option(help="Cases at once.", min=1)] = 2,
    seed: Annotated[
        int, typer.Option(help="First seed; those below 100000 are for development.", min=0)
    ] = 100000,
    real: Annotated[
        Path | None, typer.Option(help="Folder of real logs: examine these instead of made-up cases.")
    ] = None,
    plant: Annotated[
        str | None,
        typer.Option(help="Truck that others wrote, with one property hidden: fastsim."),
    ] = None,
) -> None:
    """Examine the mismatch tool on effects that are hidden from it; resumes where it stopped.

    Example: deeptruck-model prove --out proof --cases 5 --simulator physics
    Example: deeptruck-model prove --out real --real logs
    Example: deeptruck-model prove --plant fastsim --out foreign
    """
    try:
        from deeptruck_exam.folder import check, check_plant, check_real
    except ImportError:
        raise InputError(
            "the exam is a distribution of its own: pip install 'deeptruck[exam]', of a checkout ./exam"
        ) from None

    if plant is not None:
        check_plant(plant, out)
        from deeptruck_exam.plants.prove import prove_plant

        prove_plant(out, range(seed, seed + (cases or PLANT_CASES)), jobs)
        print(f"table in {out / 'plant.md'}")
        return
    if real is not None:
        check_real(real, out)
        from deeptruck_exam.real.fleets import examine_real

        examine_real(real, out)
        print(f"table in {out / 'real.md'}")
        return
    check(out)
    from deeptruck_exam.cases.levels import LEVELS
    from deeptruck_exam.command import prove as run

    kinds = tuple(simulator or ("physics", "deep"))
    run(out, tuple(level or LEVELS), cases or LEVEL_CASES, jobs, seed, kinds)
    print(f"scoreboard in {out / 'proof.md'}")


def register(app: typer.Typer) -> None:
    """Add this room's commands to the console script."""
    app.command()(mismatch)
    app.command()(apply)
    app.command()(prove)
    console.moved(
        app, "adapt", "'mismatch' on the bag of the drive: the report gives the mass to set for each drive"
    )
    console.moved(app, "road", "'import', which derives a grade from an accelerometer or an elevation")
    console.moved(
        app, "compare", "'Where it is off' in the report of 'mismatch'; for bags PlotJuggler or Foxglove"
    )


__all__ = ["InputError", "register"]
