"""`deeptruck-model`: the console script. The modules in this folder hold its commands."""

from __future__ import annotations

import deeptruck_core.terminal.script_start  # noqa: F401 - Ctrl-C during the imports that follow

# isort: split
import functools
import sys
from itertools import pairwise

import typer

from deeptruck_core.terminal import console

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
    help="Turn recordings of a truck into a simulator, and find the physics the simulator leaves out.",
)


SEVERAL = ("--recordings", "--held-out")  # options that take a list: --recordings A B C


def spread(arguments: list[str]) -> list[str]:
    """`--recordings A B` and `--recordings=A B` as `--recordings=A --recordings=B`, which the parser
    understands.

    An option without a value stays without one, so that the parser refuses it.
    """
    out: list[str] = []
    current = ""
    for word, after in pairwise((*arguments, "-")):
        if word.startswith("-"):
            current = next((name for name in SEVERAL if word.split("=")[0] == name), "")
            if word != current:
                out.append(word)
            elif after.startswith("-"):
                out.append(f"{word}=")
        elif current:
            out.append(f"{current}={word}")
        else:
            out.append(word)
    return out


@functools.cache
def whole() -> typer.Typer:
    """`app` with all commands, registered only once per process."""
    from deeptruck_model.cli import data, deep, fleet, mismatch, new, simulators

    for module in (data, deep, simulators, new, mismatch, fleet):
        module.register(app)
    return app


PROGRAMS = {
    "deeptruck-model": "recordings to a simulator, and what it leaves out: import, train, mismatch",
    "deeptruck-cacc": "a following policy: train, evaluate, export",
    "truck-bridge": "J1939 logs and buses: decode, check, record, replay, convert",
    "deeptruck-simulation": "the node graph with a simulated truck",
    "deeptruck-vehicle": "the node graph over CAN",
    "deeptruck-replay": "a recording through the node graph",
}


def overview() -> None:
    """Entry point of `deeptruck`: the programs, each with what it does."""
    print("Usage: deeptruck lists the programs, each with --help:")
    print("\n".join(f"  {name:22} {says}" for name, says in PROGRAMS.items()))


def main() -> None:
    """Entry point."""
    console.run(whole(), "deeptruck-model", spread(sys.argv[1:]))
