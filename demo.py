#!/usr/bin/env python3
"""The whole loop in minutes: drive, record, learn, follow, drive over CAN, find what is missing."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from deeptruck_core.errors import InputError
from deeptruck_core.terminal import console
from examples.demo.display import Display
from examples.demo.runner import Runner, StepError
from examples.demo.steps import Settings, chosen, plan, real_data

MARK = ".deeptruck-demo"
WRITTEN = ("logs", "figures")  # beside the folders of the steps
EXAMPLES = """
Examples:\n
  python demo.py --out demo\n
  python demo.py --out /tmp/look --quick --only evaluate
"""


def main(
    out: Annotated[Path, typer.Option(help="Folder for everything; what is done there is kept.")] = Path(
        "demo"
    ),
    quick: Annotated[
        bool, typer.Option("--quick", help="The least of everything; its figures mean nothing.")
    ] = False,
    only: Annotated[
        list[str] | None, typer.Option(help="Only this step and those it needs; may be repeated.")
    ] = None,
    again: Annotated[
        list[str] | None, typer.Option(help="Do this step again, and those after it; may be repeated.")
    ] = None,
) -> None:
    """Run the demo, or go on with it."""
    began = time.monotonic()
    out = out.absolute()
    steps = chosen(plan(out, Settings.quick() if quick else Settings(), real_data()), only)
    chosen(steps, again)  # raises where one is unknown
    _claim(out)
    if only is None and real_data() is None:
        print("no real recordings at hand (DEEPTRUCK_REAL_DATA): the real truck is left out", flush=True)
    with Display() as display:
        runner = Runner(out, steps, display.show)
        runner.forget(again or [])
        try:
            runner.run()
        except KeyboardInterrupt:
            raise StepError("interrupted; run again to go on from here") from None
    from examples.demo import page  # draws: imported once there is something to draw

    written = page.write(out, list(runner.progress.values()), time.monotonic() - began)
    for remark in page.remarks(out, runner.progress):
        print(remark)
    print(f"{time.monotonic() - began:.0f} s; open {os.path.relpath(written)}")


def _claim(out: Path) -> None:
    """Use a folder that is new, empty or a demo's. Raises InputError for one that is not or is read-only."""
    try:
        if out.exists() and not (out / MARK).exists() and any(out.iterdir()):
            raise InputError(f"{out} exists and is no demo; choose another --out")
        own = (out / MARK, out / "index.html", *(p for d in WRITTEN for p in (out / d, *(out / d).glob("*"))))
        if link := next((path for path in own if path.is_symlink()), None):
            raise InputError(f"{link} is a symbolic link, which is not written through; move it")
        out.mkdir(parents=True, exist_ok=True)
        (out / MARK).touch()
    except OSError as error:
        raise InputError(f"cannot write to {out}: {error.strerror}; choose another --out") from None


def _guarded() -> None:
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    app.command(epilog=EXAMPLES)(main)
    try:
        console.run(app, "demo")
    except StepError as error:
        print(f"demo: {error}", file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    _guarded()
