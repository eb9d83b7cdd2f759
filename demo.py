#!/usr/bin/env python3
"""The whole loop in minutes: drive, record, learn, follow, drive over CAN, find what is missing."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from deeptruck_core.terminal import console
from examples.demo.runner import StepError, run
from examples.demo.steps import DEMO, Settings, plan


def main(
    out: Annotated[Path, typer.Option(help="Folder for everything; an older demo there is replaced.")] = Path(
        "demo"
    ),
    quick: Annotated[
        bool, typer.Option("--quick", help="The least of everything; its figures mean nothing.")
    ] = False,
) -> None:
    """Run the demo."""
    began = time.monotonic()
    out = out.absolute()
    steps = plan(out, Settings.quick() if quick else Settings())
    with DEMO.in_place(out):
        took = run(out, steps)
        from examples.demo import page  # draws: imported once there is something to draw

        written = page.write(out, steps, took, time.monotonic() - began)
    print(f"{time.monotonic() - began:.0f} s; open {os.path.relpath(written)}")


def _guarded() -> None:
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    app.command()(main)
    try:
        console.run(app, "demo")
    except StepError as error:
        print(f"demo: {error}", file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    _guarded()
