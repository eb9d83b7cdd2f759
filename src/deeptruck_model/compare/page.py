"""compare.html and compare.json: one page that opens offline, and the numbers for programs."""

from __future__ import annotations

import json
from dataclasses import asdict
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, StrictUndefined
from numpy.typing import NDArray

from deeptruck_model import pages
from deeptruck_model.compare.alignment import By, Road
from deeptruck_model.compare.comparison import Compared, Comparison
from deeptruck_model.compare.statistics import APART, NAMES
from deeptruck_model.signals import CHANNELS, printed

PAGE, NUMBERS = "compare.html", "compare.json"
PANELS = ("speed", "acceleration", "engine_command", "brake_command", "gap")
SECONDS = 1.0  # of a point that is drawn, at least
MOST_POINTS = 40000  # of all sides together
DIGITS = 5


def write(comparison: Comparison, out: Path) -> None:
    """Write PAGE and NUMBERS into the folder `out`, which exists. Raises OSError where it cannot."""
    numbers = json.dumps(comparison.to_json(), indent=1, allow_nan=False)
    (out / NUMBERS).write_text(numbers + "\n", encoding="utf-8")
    (out / PAGE).write_text(page(comparison), encoding="utf-8")


def page(comparison: Comparison) -> str:
    """The page as HTML. Nothing in it is fetched from elsewhere."""
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    drawn = json.dumps(_drawn(comparison), allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return environment.from_string(_file("compare.html.jinja")).render(
        style=pages.shared(pages.STYLE) + pages.shared(pages.DARK) + _file("compare.css"),
        script=pages.shared(pages.PLOT) + _file("compare.js"),
        names=[c.side.name for c in comparison.compared],
        rows=_rows(comparison),
        apart=_apart(comparison),
        sides=[_to_dict(c) for c in comparison.compared[1:]],
        drawn=drawn,
    )


def _file(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


def _off(c: Compared) -> str:
    """How far a side is off, as a part of the first sentence."""
    if c.difference is None:
        return f"{c.side.name} has no time together with it"
    d = c.difference
    return f"{c.side.name} is {d.speed_rms_m_s:.2g} m/s off (rms over {d.shared_s:.0f} s)"


HOW = {
    By.LEADER: "where the speeds of their leaders agree best, with a correlation of {:.2f}",
    By.SPEED: "where the speeds agree best, with a correlation of {:.2f}",
    By.GIVEN: "as given; correlation of the speeds {:.2f}",
    By.ONE_BAG: "on the clock of one bag; correlation of the speeds {:.2f}",
    By.NOTHING: "begun together, as no offset was significant (the best had a correlation of {:.2f})",
}


def _to_dict(c: Compared) -> dict[str, Any]:
    return {
        "name": c.side.name,
        "offset": f"{c.offset.seconds:g}",
        "off": _off(c),
        "how": HOW[c.offset.by].format(c.offset.correlation),
        "road": f"{c.road.shared_m:.0f} m of shared road, known by {c.road.by}"
        if isinstance(c.road, Road)
        else str(c.road),
        "shared": isinstance(c.road, Road),
    }


def _apart(comparison: Comparison) -> list[dict[str, Any]]:
    """The table of differences from the first side: a row for each number that any side has."""
    out = []
    for name, (words, unit) in APART.items():
        numbers = [None if c.difference is None else asdict(c.difference)[name] for c in comparison.compared]
        if any(x is not None for x in numbers):
            cells = ["" if x is None else f"{x:.4g}" for x in numbers[1:]]
            out.append({"key": name, "name": words, "unit": unit, "cells": cells})
    return out


def _rows(comparison: Comparison) -> list[dict[str, Any]]:
    """The table: a row for each number that any side has."""
    all_numbers = [asdict(c.statistics) for c in comparison.compared]
    out = []
    for name, (words, unit) in NAMES.items():
        if any(numbers[name] is not None for numbers in all_numbers):
            factor = 100.0 if unit == "%" else 1.0
            cells = ["" if n[name] is None else f"{factor * n[name]:.4g}" for n in all_numbers]
            out.append({"name": words, "unit": unit, "cells": cells})
    return out


def _drawn(comparison: Comparison) -> dict[str, Any]:
    """What the script reads: every side as means over `step_s`."""
    step_s = comparison.compared[0].side.step_s
    points = sum(len(c.side) for c in comparison.compared)
    per = max(int(np.ceil(SECONDS / step_s)), int(np.ceil(points / MOST_POINTS)))
    return {
        "step_s": per * step_s,
        "panels": [_panel(name, comparison) for name in PANELS if _has(name, comparison)],
        "sides": [_side(c, per) for c in comparison.compared],
    }


def _has(name: str, comparison: Comparison) -> bool:
    return any(name in c.side.columns for c in comparison.compared)


def _panel(name: str, comparison: Comparison) -> dict[str, str]:
    units = sorted({c.side.units[name] for c in comparison.compared if name in c.side.units})
    text = f"{name.replace('_', ' ')}, {' or '.join(map(printed, units))}"
    return {"name": name, "label": text, "meaning": CHANNELS[name].meaning}


def _side(c: Compared, per: int) -> dict[str, Any]:
    columns = {n: _means(x, per) for n, x in c.side.columns.items() if n in PANELS}
    place = _means(c.road.place, per) if isinstance(c.road, Road) else None
    return {"name": c.side.name, "offset_s": c.offset.seconds, "columns": columns, "place": place}


def _means(values: NDArray[np.float64], per: int) -> list[float | None]:
    """Means of `per` values in a row, None where none of them is known."""
    whole = np.full(-(-len(values) // per) * per, np.nan)
    whole[: len(values)] = values
    blocks = whole.reshape(-1, per)
    known = np.isfinite(blocks)
    number = known.sum(axis=1)
    means = np.where(known, blocks, 0.0).sum(axis=1) / np.maximum(number, 1)
    return [float(f"{m:.{DIGITS}g}") if n else None for m, n in zip(means, number, strict=True)]
