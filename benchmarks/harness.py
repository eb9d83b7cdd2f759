"""What every benchmark needs: options, repeated measurements, tables, and writing its section of a page.

A measurement is the least (or a quantile) of some repeats in CPU time, which other work on the machine does
not change. What is compared is measured in one process or in turn, and given as a ratio.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "docs" / "results"
DATA = Path(os.environ.get("DEEPTRUCK_REAL_DATA", ROOT.parent / "shared" / "data"))  # real recordings


def options(text: str | None, defaults: Mapping[str, Any]) -> argparse.Namespace:
    """The command line, described by a module's docstring. `defaults` maps each option to its default, or to
    that and its help: a list takes several values, False is a switch, a type an option without a default."""
    parser = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, given in defaults.items():
        default, says = given if isinstance(given, tuple) else (given, None)
        if default is False:
            parser.add_argument(name, action="store_true", help=says)
        elif isinstance(default, list):
            parser.add_argument(name, nargs="+", type=type(default[0]), default=default, help=says)
        elif isinstance(default, type):
            parser.add_argument(name, type=default, help=says)
        else:
            parser.add_argument(name, type=type(default), default=default, help=says)
    return parser.parse_args()


def skip(reason: str) -> NoReturn:
    """End the program without an error, so that `make bench` continues with the next one."""
    print(f"skipped: {reason}", file=sys.stderr)
    sys.exit(0)


def check_data(path: Path) -> None:
    """Skip the benchmark if a real recording is missing."""
    if not path.exists():
        skip(f"{path} is not here; docs/recordings.md says where to get it")


def cpu_s(
    work: Callable[[], object], repeats: int = 3, clock: Callable[[], float] = time.process_time
) -> NDArray[np.float64]:
    """CPU seconds of each repeat, after one repeat to warm up."""
    work()
    times = np.empty(repeats)
    for k in range(repeats):
        began = clock()
        work()
        times[k] = clock() - began
    return times


def table(heads: str, rows: Iterable[str], *, right: bool = False) -> list[str]:
    """Lines of a table; head and rows are written as `a | b | c`; `right` aligns all columns but the first to
    the right."""
    rule = "|---" + ("|---:" if right else "|---") * heads.count(" | ") + "|"
    return [f"| {heads} |", rule, *(f"| {row} |" for row in rows)]


def command() -> str:
    """The command line of this benchmark, as a page quotes it."""
    return " ".join(["python", f"benchmarks/{Path(sys.argv[0]).name}", *sys.argv[1:]])


def heading(title: str, facts: str = "") -> list[str]:
    """The first lines of a section: title, command, and notes on the measurement."""
    return [f"# {title}", "", f"`{command()}`{facts}", ""]


def store(page: str, lines: Iterable[str]) -> None:
    """Print a section, which begins with its heading (`# ...`), and write it to docs/results/PAGE.md (as
    `##`).

    It replaces the section of this heading, or is appended; the headings in it are one level lower there.
    """
    text = "\n".join(lines).strip()
    print(text)
    section = re.sub(r"^#", "##", text, flags=re.M)
    path = RESULTS / f"{page}.md"
    parts = [p.strip() for p in re.split(r"^(?=## )", path.read_text(encoding="utf-8"), flags=re.M)]
    headings = [part.partition("\n")[0] for part in parts]
    heading = section.partition("\n")[0]
    at = headings.index(heading) if heading in headings else len(parts)
    parts[at : at + 1] = [section]
    path.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
