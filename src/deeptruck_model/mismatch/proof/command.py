"""`prove` and, for the tool's author, `python -m deeptruck_model.mismatch.proof.command one|batch|list`.

Development seeds are 0 to 9999; the report uses seeds from 100000, run once.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from deeptruck_model.errors import InputError
from deeptruck_model.mismatch.proof.cases import Case, make_case, open_truth
from deeptruck_model.mismatch.proof.effects import EFFECTS
from deeptruck_model.mismatch.proof.plans import LEVELS
from deeptruck_model.mismatch.proof.tool import run_tool

app = typer.Typer(no_args_is_help=True, pretty_exceptions_enable=False)


@app.command()
def one(
    out: Annotated[Path, typer.Option(help="New folder for the case.")],
    level: Annotated[str, typer.Option(help=", ".join(LEVELS))] = "noise",
    effect: Annotated[str | None, typer.Option(help="Key or name of a hidden effect.")] = None,
    seed: Annotated[int, typer.Option(help="Development: 0 to 9999.")] = 0,
    simulator: Annotated[str, typer.Option(help="physics or deep")] = "physics",
    minutes: Annotated[float, typer.Option(help="Length of each recording.")] = 4.0,
    generate_only: Annotated[bool, typer.Option(help="Do not run the tool.")] = False,
) -> None:
    """Make one case, run the tool on it, open the truth and score."""
    case = make_case(out, level, seed, effect, simulator, minutes)
    print(f"sealed {case.sha256}")
    if generate_only:
        print(f"simulator {case.simulator}\nrecordings {' '.join(map(str, case.paths(case.fit)))}")
        print(f"held out {' '.join(map(str, case.paths(case.held_out)))}")
        return
    run = run_tool(case, out / "found")
    print(run.says)
    print(json.dumps(open_truth(case), indent=1))


@app.command("list")
def list_effects() -> None:
    """Keys, names and sources of the hidden effects."""
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

__all__ = ["Any", "Case", "app"]
