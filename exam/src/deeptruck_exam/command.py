"""`prove`, and `python -m deeptruck_exam.command one|list` for development.

Development seeds are 0 to 9999; a report uses seeds from 100000, run once.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from deeptruck_core.errors import InputError
from deeptruck_exam.cases.case import make_case
from deeptruck_exam.cases.levels import LEVELS
from deeptruck_exam.cases.plan import MINUTES
from deeptruck_exam.folder import PROOF
from deeptruck_exam.jobs import Job, run_jobs
from deeptruck_exam.laws import EFFECTS
from deeptruck_exam.run import examine
from deeptruck_exam.scoring.page import write_page

REPORT_SEED = 100_000
NULL_FACTOR = 5  # nulls need numbers: a false alarm in fifty cannot be seen in forty
SIMULATORS = ("physics", "deep")

app = typer.Typer(no_args_is_help=True, pretty_exceptions_enable=False)


def prove(
    out: Path,
    levels: Sequence[str] = LEVELS,
    cases_per_level: int = 40,
    jobs: int = 1,
    seed: int = REPORT_SEED,
    simulators: Sequence[str] = SIMULATORS,
    resume: bool = True,
    minutes: float = MINUTES,
) -> dict[str, Any]:
    """Examine the tool and write proof.md, scoreboard.json and figures into `out`; returns the scoreboard.

    One folder per case, with recordings of `minutes` each; scored cases are skipped if `resume`, otherwise
    `out` must not exist. Level nothing_missing gets NULL_FACTOR times the cases, unless there is a single
    one. Raises InputError for unknown levels or simulators, or an `out` in use.
    """
    _known("level", levels, LEVELS)
    _known("simulator", simulators, SIMULATORS)
    if out.exists() and not resume:
        raise InputError(f"{out} exists already; resume it, choose another folder or remove it")
    factor = NULL_FACTOR if cases_per_level > 1 else 1
    wanted = [
        Job(level, seed + k, simulator, minutes)
        for simulator in simulators
        for level in levels
        for k in range(cases_per_level * (factor if level == "nothing_missing" else 1))
    ]
    with PROOF.in_place(out):
        results = run_jobs(out / "cases", wanted, jobs=jobs)
        command = f"deeptruck-model prove --out proof --cases {cases_per_level} --seed {seed}"
        return write_page(results, out, command)


def _known(option: str, given: Sequence[str], known: Sequence[str]) -> None:
    for name in given:
        if name not in known:
            raise InputError(f"--{option}: there is no '{name}'; choose from {', '.join(known)}")


@app.command()
def one(
    out: Annotated[Path, typer.Option(help="New folder for the case.")],
    level: Annotated[str, typer.Option(help=", ".join(LEVELS))] = "noise",
    effect: Annotated[str | None, typer.Option(help="Key or name of a hidden law.")] = None,
    seed: Annotated[int, typer.Option(help="Development: 0 to 9999.", min=0)] = 0,
    simulator: Annotated[str, typer.Option(help="physics or deep")] = "physics",
    minutes: Annotated[float, typer.Option(help="Length of each recording.")] = MINUTES,
    rivals: Annotated[
        bool, typer.Option(help="Compare held-out errors with a parameter refit and an oracle.")
    ] = True,
    generate_only: Annotated[bool, typer.Option(help="Do not run the tool.")] = False,
) -> None:
    """Make one case, run the tool on it, open the truth and score."""
    if generate_only:
        case = make_case(out, level, seed, effect, simulator, minutes)
        print(f"truth {case.sha256}\nsimulator {case.simulator}")
        print(f"recordings {' '.join(map(str, case.paths(case.fit)))}")
        print(f"held out {' '.join(map(str, case.paths(case.held_out)))}")
        return
    result = examine(out, level, seed, effect, simulator, minutes, with_rivals=rivals, keep=True)
    print(json.dumps(result, indent=1))


@app.command("list")
def list_laws() -> None:
    """Keys, names and sources of the laws."""
    table = Table("key", "name", "kind", "source")
    for effect in EFFECTS.values():
        table.add_row(effect.key, effect.name, effect.kind, effect.source)
    Console().print(table)


def main() -> None:
    try:
        app()
    except InputError as error:
        raise SystemExit(f"proof: {error}") from None


if __name__ == "__main__":
    main()
