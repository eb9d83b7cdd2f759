"""compare.html and compare.json: one page that opens offline, and the numbers for programs."""

from __future__ import annotations

import base64
import json
from dataclasses import asdict, dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, StrictUndefined
from numpy.typing import NDArray

from deeptruck_core import pages
from deeptruck_core.signals import channel_of, printed, speed_unit
from deeptruck_model.compare.alignment import By, Road
from deeptruck_model.compare.comparison import Compared, Comparison
from deeptruck_model.compare.naming import ONE_RUN
from deeptruck_model.compare.sides import Side
from deeptruck_model.compare.statistics import APART, NAMES

PAGE, NUMBERS = "compare.html", "compare.json"
PANELS = ("speed", "acceleration", "engine_command", "brake_command", "gap")
SECONDS = 1.0  # of a point that is drawn, at least
MOST_POINTS = 40000  # of all sides together
MOST_VALUES = 3_000_000  # of all channels at their native rate, 16 MB of page; beyond, means of several
DIGITS = 5


@dataclass(frozen=True)
class _Speeds:
    """The unit in which speeds are shown, and the number of units in 1 m/s."""

    unit: str
    per: float

    def factor(self, unit: str) -> float:
        """The factor from a value of `unit` to the displayed value."""
        return self.per if unit == "m/s" else 1.0

    def of(self, unit: str) -> str:
        """The unit in which values of `unit` are displayed."""
        return self.unit if unit == "m/s" else unit


def write(comparison: Comparison, out: Path, units: str = "m/s") -> None:
    """Write PAGE and NUMBERS into the existing folder `out`; the page shows speeds in `units`, one of
    signals.SPEED_UNITS. Raises OSError if writing fails, and InputError for another unit."""
    numbers = json.dumps(comparison.to_json(), indent=1, allow_nan=False)
    (out / NUMBERS).write_text(numbers + "\n", encoding="utf-8")
    (out / PAGE).write_text(page(comparison, units), encoding="utf-8")


def page(comparison: Comparison, units: str = "m/s") -> str:
    """The page as HTML, with speeds in `units`. It fetches nothing from elsewhere."""
    shown = _Speeds(units, speed_unit(units))
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    data = json.dumps(_drawn(comparison, shown), allow_nan=False, separators=(",", ":"))
    return environment.from_string(_file("compare.html.jinja")).render(
        style=pages.shared(pages.STYLE, pages.DARK, pages.CHART_STYLE) + _file("compare.css"),
        script=pages.shared(*pages.CHARTS) + _file("compare.js"),
        names=[c.side.name for c in comparison.compared],
        rows=_rows(comparison, shown),
        apart=_apart(comparison, shown),
        sides=[_to_dict(c, shown) for c in comparison.compared[1:]],
        channels=[_panel(name, comparison, shown) for name in _channels(comparison)],
        thinned=_thinned(comparison),
        one_run=ONE_RUN if any(c.side.simulated for c in comparison.compared) else "",
        drawn=data.replace("<", "\\u003c"),
    )


def _file(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


def _off(c: Compared, shown: _Speeds) -> str:
    """The error of a side, as a part of the first sentence."""
    if c.difference is None:
        return f"{c.side.name} has no time together with it"
    d = c.difference
    off = f"{shown.per * d.speed_rms_m_s:.2g} {shown.unit}"
    return f"{c.side.name} is {off} off (rms over {d.shared_s:.0f} s)"


HOW = {
    By.LEADER: "where the speeds of their leaders agree best, with a correlation of {:.2f}",
    By.SPEED: "where the speeds agree best, with a correlation of {:.2f}",
    By.GIVEN: "as given; correlation of the speeds {:.2f}",
    By.ONE_BAG: "on the clock of one bag; correlation of the speeds {:.2f}",
    By.NOTHING: "begun together, as no offset was significant (the best had a correlation of {:.2f})",
}


def _to_dict(c: Compared, shown: _Speeds) -> dict[str, Any]:
    return {
        "name": c.side.name,
        "offset": f"{c.offset.seconds:g}",
        "off": _off(c, shown),
        "how": HOW[c.offset.by].format(c.offset.correlation),
        "road": f"{c.road.shared_m:.0f} m of shared road, known by {c.road.by}"
        if isinstance(c.road, Road)
        else str(c.road),
        "shared": isinstance(c.road, Road),
    }


def _apart(comparison: Comparison, shown: _Speeds) -> list[dict[str, Any]]:
    """The table of differences from the first side, one row for each number that any side has."""
    out = []
    for name, (words, unit) in APART.items():
        numbers = [None if c.difference is None else asdict(c.difference)[name] for c in comparison.compared]
        if any(x is not None for x in numbers):
            cells = ["" if x is None else f"{shown.factor(unit) * x:.4g}" for x in numbers[1:]]
            out.append({"key": name, "name": words, "unit": shown.of(unit), "cells": cells})
    return out


def _rows(comparison: Comparison, shown: _Speeds) -> list[dict[str, Any]]:
    """The table of statistics, one row for each number that any side has."""
    all_numbers = [asdict(c.statistics) for c in comparison.compared]
    out = []
    for name, (words, unit) in NAMES.items():
        if any(numbers[name] is not None for numbers in all_numbers):
            factor = 100.0 if unit == "%" else shown.factor(unit)
            cells = ["" if n[name] is None else f"{factor * n[name]:.4g}" for n in all_numbers]
            out.append({"name": words, "unit": shown.of(unit), "cells": cells})
    return out


def _drawn(comparison: Comparison, shown: _Speeds) -> dict[str, Any]:
    """The data for the script: every side as means over `step_s`."""
    step_s, thinned = comparison.compared[0].side.step_s, _thinned(comparison)
    points = sum(len(c.side) for c in comparison.compared)
    per = max(int(np.ceil(SECONDS / step_s)), int(np.ceil(points / MOST_POINTS)))
    return {
        "step_s": per * step_s,
        "speed_unit": shown.unit,
        "per_m_s": shown.per,
        "panels": [
            _panel(name, comparison, shown)
            for name in PANELS
            if any(name in c.side.columns for c in comparison.compared)
        ],
        "channels": [_panel(name, comparison, shown) for name in _channels(comparison)],
        "sides": [
            {**_side(c, per, shown), "native": _native(c.side, thinned, shown)} for c in comparison.compared
        ],
    }


def _channels(comparison: Comparison) -> list[str]:
    return list(dict.fromkeys(name for c in comparison.compared for name in c.side.native))


def _thinned(comparison: Comparison) -> int:
    """Number of native samples averaged per plotted sample."""
    values = sum(len(x) for c in comparison.compared for x in c.side.native.values())
    return max(1, int(np.ceil(values / MOST_VALUES)))


def _native(side: Side, per: int, shown: _Speeds) -> dict[str, Any]:
    """Every channel as base64 of little-endian float32, NaN where unknown."""
    columns = {}
    for name, values in side.native.items():
        means = values if per == 1 else np.array(_means(values, per), dtype=np.float64)
        means = shown.factor(side.units[name]) * means
        columns[name] = base64.b64encode(means.astype("<f4").tobytes()).decode()
    return {"step_s": per * side.native_step_s, "begin_s": side.begin_s, "columns": columns}


def _panel(name: str, comparison: Comparison, shown: _Speeds) -> dict[str, str]:
    units = sorted({c.side.units[name] for c in comparison.compared if name in c.side.units})
    unit = " or ".join(printed(shown.of(u)) for u in units if u not in ("", "1"))
    words = name.replace("_", " ")
    sides = ", ".join(c.side.name for c in comparison.compared if name in c.side.native)
    meaning = channel_of(name).meaning
    label = f"{words}, {unit}" if unit else words
    return {"name": name, "label": label, "unit": unit, "meaning": meaning, "sides": sides}


def _side(c: Compared, per: int, shown: _Speeds) -> dict[str, Any]:
    units = c.side.units
    columns = {n: _means(shown.factor(units[n]) * x, per) for n, x in c.side.columns.items() if n in PANELS}
    place = _means(c.road.place, per) if isinstance(c.road, Road) else None
    return {"name": c.side.name, "offset_s": c.offset.seconds, "columns": columns, "place": place}


def _means(values: NDArray[np.float64], per: int) -> list[float | None]:
    """Means of `per` consecutive values, None if none of them is known."""
    whole = np.full(-(-len(values) // per) * per, np.nan)
    whole[: len(values)] = values
    blocks = whole.reshape(-1, per)
    known = np.isfinite(blocks)
    number = known.sum(axis=1)
    means = np.where(known, blocks, 0.0).sum(axis=1) / np.maximum(number, 1)
    return [float(f"{m:.{DIGITS}g}") if n else None for m, n in zip(means, number, strict=True)]
