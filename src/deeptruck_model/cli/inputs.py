"""Inputs of the commands for deep trucks: bags, and a simulator directory."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_model.recordings.bag_facts import Clock

if TYPE_CHECKING:
    from deeptruck_core.account import Account, Aside
    from deeptruck_model.deep import DeepTruck
    from deeptruck_model.recordings import Recording

Overwrite = Annotated[
    bool,
    typer.Option("--overwrite", help=files.OVERWRITE_HELP),
]
SIMULATOR = (
    "Simulator directory, truck:NAME[:overrides.yaml], truck:FILE.yaml, "
    "python:MODULE:FACTORY[:arguments.yaml] or fmu:MODEL.fmu[:mapping.yaml]."
)
Bags = Annotated[list[Path], typer.Argument(metavar="BAG...", help="Bags (folders) of one truck.")]
TopicMap = Annotated[
    Path | None,
    typer.Option(
        help="YAML that says which of your topics is which channel; 'suggest' proposes one.", metavar="FILE"
    ),
]
Units = Annotated[
    str, typer.Option("--units", help="Unit in which speeds are shown: m/s, km/h or mph.", metavar="UNIT")
]
ClockOption = Annotated[
    Clock | None,
    typer.Option(
        "--clock", help="Time every topic by header stamps or by log times, where their clocks differ."
    ),
]
MessageFiles = Annotated[
    list[Path] | None,
    typer.Option("--msg", help=".msg files of messages whose definition the bags lack.", metavar="FILE"),
]


def deep_truck(simulator: str) -> DeepTruck:
    """The deep truck in a simulator directory. Raises InputError for any other simulator."""
    from deeptruck_model import simulator_facts as facts
    from deeptruck_model import simulators

    if facts.simulator(simulator).kind != "deep":
        raise InputError(f"{simulator} is no deep truck; train one with 'deeptruck-model train'")
    truck = simulators.load(simulator)
    if TYPE_CHECKING:
        assert isinstance(truck, DeepTruck)
    return truck


def read(
    bags: list[Path],
    topic_map: Path | None = None,
    clock: Clock | None = None,
    msg: list[Path] | None = None,
) -> list[Recording]:
    """The recordings of all bags, in the order of the bags; prints their accounts. Raises InputError as
    `read` does."""
    from deeptruck_model.recordings import read_all

    recordings = read_all(bags, topic_map=topic_map, clock=clock, msg=msg or ())
    show_accounts(recordings)
    return recordings


def show_accounts(recordings: Iterable[Recording]) -> None:
    """Print omitted samples and remarks of the readers on stderr, once for each source; what was only set
    aside in one line a reason for all of them."""
    found: dict[str, list[tuple[Account, Aside]]] = {}
    for account in {id(r.account): r.account for r in recordings if r.account is not None}.values():
        if account.remarks or any(account.channel_lines()):
            print("\n".join(account.lines()), file=sys.stderr)
            continue
        for reason, entry in account.total.aside.items():
            found.setdefault(reason, []).append((account, entry))
    for reason, parts in found.items():
        names = ", ".join(dict.fromkeys(account.source for account, _ in parts))
        count, read = (sum(x) for x in zip(*((e.count, a.total.read) for a, e in parts), strict=True))
        first = f", first {parts[0][1].first}" if parts[0][1].first else ""
        print(f"{names}: {count} of {read} {parts[0][0].items} set aside, {reason}{first}", file=sys.stderr)
