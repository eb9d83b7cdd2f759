"""Coverage of recordings: time driven over speed, acceleration and grade, with a judgement, figures and a
page.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.json_data import to_json
from deeptruck_core.pages.document import Folded, Picture, Table, document
from deeptruck_core.pages.style import MODELLED, WIDTH_IN, plain_log, png, styled
from deeptruck_core.signals import Said, Speed, printed, sensible, shown, speed_unit
from deeptruck_model.recordings.not_recorded import not_recorded, sentence
from deeptruck_model.recordings.recording import Recording
from deeptruck_model.recordings.several import Drives, drives
from deeptruck_model.recordings.splits import shared
from deeptruck_model.results import COVERAGE

SLOW, FAST = Speed(4.0, 3), Speed(16.0, 3)
SPEED_EDGES: Array = np.linspace(0.0, 40.0, 21)  # m/s
ACCELERATION_EDGES: Array = np.linspace(-10.0, 3.0, 53)  # m/s^2; no tyre of a truck brakes harder
GRADE_EDGES: Array = np.linspace(-0.10, 0.10, 21)  # ratio
ENOUGH_S = 1800.0  # of driving to train on; 15 min left some three times the error of 60 (three trucks, once)
ENOUGH_IN_CONDITION_S = 60.0  # chosen: some ten episodes of braking or launching
SHOWN_FROM = -5.0  # m/s^2, or lower where there was braking as hard
COLUMNS = 500  # of a channel's picture, each with the least and the most that was recorded there
SHOWS = "Time spent over speed, acceleration and slope. Cells without colour were not driven."
SHOWS_CHANNELS = (
    "Every channel over the recorded time, the pieces one after another. Gaps are invalid samples."
)
CONDITIONS = "Time driven in each condition"
SHOWN_IN = {"ratio": "%"}  # as the figure has slopes
CHANNELS_OF = "Channels of {name}, {seconds:.0f} s at {rate:g} Hz"


@dataclass(frozen=True)
class Condition:
    """A driving condition, made of cells of the coverage grid, and the time driven in it, s."""

    name: str
    driven_s: float

    @property
    def enough(self) -> bool:
        """Whether the time suffices to learn a model of the condition."""
        return self.driven_s >= ENOUGH_IN_CONDITION_S


def conditions(seconds: Array) -> tuple[Condition, ...]:
    """Driving conditions with their times, from the time `seconds` (speed, acceleration, grade) in
    each cell."""
    speed, acceleration = SPEED_EDGES[:-1], ACCELERATION_EDGES[:-1]
    by_speed, by_acceleration = seconds.sum(axis=(1, 2)), seconds.sum(axis=(0, 2))
    by_grade, grade = seconds[:, :, :-1].sum(axis=(0, 1)), GRADE_EDGES[:-1].round(6)
    parts = (
        (Said("below ", SLOW), by_speed[speed < SLOW.m_s]),
        (
            Said(SLOW._replace(with_unit=False), " to ", FAST),
            by_speed[(speed >= SLOW.m_s) & (speed < FAST.m_s)],
        ),
        (Said("above ", FAST), by_speed[speed >= FAST.m_s]),
        ("accelerating above 0.5 m/s²", by_acceleration[acceleration >= 0.5]),
        ("slowing by 0.5 to 2 m/s²", by_acceleration[(acceleration >= -2.0) & (acceleration < -0.5)]),
        ("slowing by more than 2 m/s²", by_acceleration[acceleration < -2.0]),
        ("uphill above 2 %", by_grade[grade >= 0.02]),
        ("downhill above 2 %", by_grade[grade < -0.02]),
    )
    return tuple(Condition(name, float(part.sum())) for name, part in parts)


def judgement(seconds: Array, duration_s: float, commanded: bool) -> str:
    """One sentence: whether the recordings suffice for training, and the conditions in which they do not.
    `commanded` says whether a valid engine command was recorded."""
    if not commanded:
        return "Enough to train: no, as no engine command is valid."
    if duration_s < ENOUGH_S:
        return (
            f"Enough to train: no, {_long(duration_s)} were driven, and {ENOUGH_S / 60:.0f} min are needed."
        )
    lacking = [Said(c.name, f": no ({_long(c.driven_s)})") for c in conditions(seconds) if not c.enough]
    return Said(Said.joined("; ", [f"Enough to train: yes ({_long(duration_s)})", *lacking]), ".")


def _long(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200.0 else f"{seconds / 3600:.1f} h"


def rows(seconds: Array, units: str = "m/s") -> tuple[tuple[str, ...], ...]:
    """Condition (speeds in `units`), time driven, and whether it suffices, as text."""
    return tuple(
        (shown(c.name, units), _long(c.driven_s), "yes" if c.enough else "no") for c in conditions(seconds)
    )


@styled()
def draw(found: Coverage, units: str = "m/s") -> bytes:
    """Three maps of the time driven over speed (in `units`), acceleration and grade, as PNG."""
    figure = Figure(figsize=(WIDTH_IN, 6.2))
    FigureCanvasAgg(figure)
    axes = figure.subplot_mosaic("AA;BC")
    with_grade, every = found.seconds[:, :, :-1], found.seconds
    speed, acceleration, grade = _axes(every.sum(axis=(0, 2)), units)
    _map(axes["A"], every.sum(axis=2), speed, acceleration)
    _map(axes["B"], with_grade.sum(axis=1), speed, grade)
    _map(axes["C"], with_grade.sum(axis=0), acceleration, grade)
    return png(figure)


class _Axis(NamedTuple):
    """An axis of the maps: the edges of its cells, and the smallest value drawn."""

    label: str
    edges: Array
    shown_from: float


def _axes(by_acceleration: Array, units: str) -> tuple[_Axis, _Axis, _Axis]:
    """Speed, acceleration and grade; the acceleration axis extends down to the hardest braking."""
    hardest = ACCELERATION_EDGES[np.flatnonzero(by_acceleration)[0]] if by_acceleration.any() else 0.0
    return (
        _Axis(f"speed [{units}]", speed_unit(units) * SPEED_EDGES, 0.0),
        _Axis("acceleration [m/s²]", ACCELERATION_EDGES, min(SHOWN_FROM, hardest)),
        _Axis("grade [%]", 100 * GRADE_EDGES, 100 * GRADE_EDGES[0]),
    )


def _map(ax: Axes, seconds: Array, x: _Axis, y: _Axis) -> None:
    ax.set_xlabel(x.label)
    ax.set_ylabel(y.label)
    ax.set_xlim(x.shown_from, x.edges[-1])
    ax.set_ylim(y.shown_from, y.edges[-1])
    if not seconds.any():
        ax.text(0.5, 0.5, "no grade recorded", transform=ax.transAxes, ha="center", va="center", color="0.4")
        return
    shown = np.where(seconds.T == 0.0, np.nan, seconds.T)
    norm = LogNorm(vmin=max(0.1, float(np.nanmin(shown))), vmax=max(1.0, float(np.nanmax(shown))))
    mesh = ax.pcolormesh(x.edges, y.edges, shown, norm=norm, cmap="viridis_r")
    plain_log(ax.figure.colorbar(mesh, ax=ax, label="time spent [s]").ax.yaxis)


@styled()
def draw_channels(recordings: Sequence[Recording], units: str = "m/s") -> bytes:
    """Every channel over the recorded time, one small panel each, as PNG, speeds in `units`; invalid samples
    are gaps."""
    names = list(dict.fromkeys(name for r in recordings for name in r.channels))
    figure = Figure(figsize=(WIDTH_IN, 0.6 + 0.75 * len(names)))
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    begin = 0.0
    for recording in recordings:
        minutes = begin + recording.dt * np.arange(len(recording)) / 60
        begin += recording.dt * len(recording) / 60
        for axis, name in zip(axes, names, strict=True):
            if name in recording.channels:
                per = speed_unit(units) if recording.interface.unit(name) == "m/s" else 1.0
                # in single precision, which hides the rounding noise of a constant
                values = (per * recording.channels[name]).astype(np.float32).astype(np.float64)
                _envelope(axis, minutes, values)
            if len(recordings) > 1:
                axis.axvline(begin, color="0.8", lw=0.6)
    for axis, name in zip(axes, names, strict=True):
        unit = next(r.interface.unit(name) for r in recordings if name in r.channels)
        unit = units if unit == "m/s" else unit
        said = "" if unit in ("", "1") else f"\n[{printed(unit)}]"
        axis.set_ylabel(f"{name.replace('_', ' ')}{said}", rotation=0, ha="right", va="center", fontsize=9)
        axis.tick_params(labelsize=9)
        axis.set_xlim(0.0, begin)
        axis.locator_params(axis="y", nbins=3)
    axes[-1].set_xlabel("recorded time [min]")
    return png(figure)


def _envelope(axis: Axes, minutes: Array, values: Array) -> None:
    """Minimum and maximum of the valid values in each of COLUMNS columns."""
    columns = max(1, len(values) // COLUMNS)
    whole = len(values) // columns * columns
    blocks, times = values[:whole].reshape(-1, columns), minutes[:whole:columns]
    valid = ~np.isnan(blocks)
    known = valid.any(axis=1)
    low = np.where(valid, blocks, np.inf).min(axis=1)
    high = np.where(valid, blocks, -np.inf).max(axis=1)
    low, high = np.where(known, low, np.nan), np.where(known, high, np.nan)
    axis.fill_between(times, low, high, color=MODELLED, alpha=0.4, lw=0)
    axis.plot(times, (low + high) / 2, color=MODELLED, lw=0.8)


def page(found: Mapping[str, Any], maps: bytes, channels: bytes, units: str = "m/s") -> str:
    """The HTML page of coverage.json and its two pictures (PNG), with speeds in `units`."""
    seconds = np.array(found["occupancy"]["seconds"])
    each = [Folded(table.says, (table,)) for table in (_table(r, units) for r in found["recordings"])]
    conditions = Table(CONDITIONS, ("condition", "driven", "enough to learn it"), rows(seconds, units))
    return document(
        shown(found["judgement"], units),
        [*(f"Not recorded: {sentence(missing)}" for missing in found["not_recorded"]), *found["warnings"]],
        [
            Picture(channels, SHOWS_CHANNELS),
            conditions,
            Picture(maps, SHOWS),
            *(Folded(table.says, (table,)) for table in map(_account, found["accounts"])),
            *([Folded(f"Channels of {len(each)} recordings", each)] if len(each) > 1 else each),
        ],
    )


def _account(account: dict[str, Any]) -> Table:
    """The account of one source: used and omitted samples, of the channels that it has."""
    recorded = [(what, tally) for what, tally in account["channels"].items() if tally["read"]]
    counted = [(account["items"], account), *recorded]
    rows = [(what, str(tally["read"]), str(tally["used"]), "", "") for what, tally in counted]
    asides = [
        (f"{what}: {reason}", "", "", str(entry["count"]), entry["first"])
        for what, tally in counted
        for reason, entry in tally["set_aside"].items()
    ]
    remarks = [(remark, "", "", "", "") for remark in account["remarks"]]
    says = f"What became of {account['source']}"
    return Table(says, ("", "read", "used", "set aside", "first"), (*rows, *asides, *remarks))


def _table(recording: dict[str, Any], units: str) -> Table:
    shown, per = {**SHOWN_IN, "m/s": units}, {"ratio": 100.0, "m/s": speed_unit(units)}
    rows = [
        (name, shown.get(facts["unit"], printed(facts["unit"])),
         *("" if (x := facts[key]) is None else sensible(per.get(facts["unit"], 1.0) * x)
           for key in ("min", "mean", "max")),
         f"{100 * facts['nan_share']:.1f}")
        for name, facts in recording["channels"].items()
    ]  # fmt: skip
    says = CHANNELS_OF.format(
        name=recording["name"], seconds=recording["duration_s"], rate=1 / recording["dt"]
    )
    return Table(says, ("channel", "unit", "least", "mean", "most", "invalid, %"), tuple(rows))


@dataclass(frozen=True)
class Coverage:
    """`seconds` (speed, acceleration, grade) is the time driven in each cell of the edges; the last grade
    cell holds samples without a grade. Samples outside the edges count in the outermost cells. `not_recorded`
    are the inputs that were not recorded, `accounts` the counts of samples used and omitted, `drives` the
    recordings."""

    seconds: Array
    recordings: list[dict[str, Any]]
    not_recorded: list[dict[str, Any]]
    accounts: list[dict[str, Any]]
    drives: Sequence[Recording]

    @property
    def duration_s(self) -> float:
        """Total length of all recordings, s."""
        return float(sum(r["duration_s"] for r in self.recordings))

    @cached_property
    def warnings(self) -> list[str]:
        """One line for each channel that is present but cannot be used, and for each drive that counts
        twice."""
        empty = [
            f"{name} of '{r['name']}' holds no valid sample"
            for r in self.recordings
            for name, channel in r["channels"].items()
            if channel["mean"] is None
        ]
        if not self._commanded:
            empty.append("no recording has a valid engine_command, without which none can be trained on")
        return [*empty, *shared(self.drives)]

    @property
    def _commanded(self) -> bool:
        commands = [r["channels"].get("engine_command") for r in self.recordings]
        return any(command and command["mean"] is not None for command in commands)

    @property
    def judgement(self) -> str:
        """One sentence: whether the recordings suffice for training, and in which conditions they do not."""
        return judgement(self.seconds, self.duration_s, self._commanded)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "judgement": self.judgement,
            "not_recorded": self.not_recorded,
            "duration_s": self.duration_s,
            "warnings": self.warnings,
            "accounts": self.accounts,
            "recordings": self.recordings,
            "occupancy": {
                "axes": ["speed", "acceleration", "grade"],
                "speed_edges": SPEED_EDGES.round(6).tolist(),
                "acceleration_edges": ACCELERATION_EDGES.round(6).tolist(),
                "grade_edges": GRADE_EDGES.round(6).tolist(),
                "without_grade": "last index of the grade axis",
                "seconds": self.seconds.round(6).tolist(),
            },
        }

    def _repr_png_(self) -> bytes:
        """The figure that `save` writes, for notebooks."""
        return draw(self)

    def save(self, folder: str | Path, *, overwrite: bool = False, units: str = "m/s") -> None:
        """Write the folder with coverage.json, and coverage.png and coverage.html with speeds in `units`; all
        files or none.

        Raises InputError if something else is there, or an older coverage without `overwrite`.
        """
        facts = self.to_dict()
        content = json.dumps(facts, indent=1, allow_nan=False)
        with COVERAGE.replacing(Path(folder), overwrite=overwrite) as draft:
            (draft / "coverage.json").write_text(content)
            picture = draw(self, units)
            (draft / "coverage.png").write_bytes(picture)
            (draft / "coverage.html").write_text(
                page(facts, picture, draw_channels(self.drives, units), units), encoding="utf-8"
            )


def coverage(recordings: Drives) -> Coverage:
    """Coverage of recordings, or of the bags at paths. Raises InputError if there are none."""
    recordings = drives(recordings)
    if not recordings:
        raise InputError("there is no recording to look at")
    shape = (len(SPEED_EDGES) - 1, len(ACCELERATION_EDGES) - 1, len(GRADE_EDGES))
    seconds = np.zeros(shape)
    for recording in recordings:
        seconds += _occupancy(recording, shape)
    accounts = {id(r.account): to_json(r.account) for r in recordings if r.account is not None}
    return Coverage(
        seconds,
        [_summary(r, before) for before, r in zip((None, *recordings), recordings, strict=False)],
        [missing.to_dict() for missing in not_recorded(recordings)],
        list(accounts.values()),
        recordings,
    )


def _occupancy(recording: Recording, shape: tuple[int, int, int]) -> Array:
    speed, acceleration = recording.channels["speed"], recording.channels["acceleration"]
    grade = recording.channels.get("grade", np.full(len(recording), np.nan))
    valid = ~(np.isnan(speed) | np.isnan(acceleration))
    cells = (
        _index(speed[valid], SPEED_EDGES),
        _index(acceleration[valid], ACCELERATION_EDGES),
        np.where(np.isnan(grade[valid]), shape[2] - 1, _index(np.nan_to_num(grade[valid]), GRADE_EDGES)),
    )
    flat = np.ravel_multi_index(cells, shape)
    samples = np.bincount(flat, minlength=int(np.prod(shape))).reshape(shape)
    return np.asarray(samples * recording.dt, dtype=np.float64)


def _index(values: Array, edges: Array) -> NDArray[np.int64]:
    return np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)


def _summary(recording: Recording, before: Recording | None) -> dict[str, Any]:
    gap = recording.gap_after(before)
    return {
        "name": recording.name,
        "start_s": recording.start_s,
        "dt": recording.dt,
        "samples": len(recording),
        "duration_s": round(len(recording) * recording.dt, 6),
        "gap_before_s": None if gap is None else round(gap, 6),
        "interface": recording.interface.to_dict(),
        "channels": {name: _range(recording, name) for name in recording.channels},
        "notes": list(recording.notes),
    }


def _range(recording: Recording, name: str) -> dict[str, Any]:
    values = recording.channels[name]
    valid = values[~np.isnan(values)]
    return {
        "unit": recording.interface.unit(name),
        "min": float(valid.min()) if len(valid) else None,
        "max": float(valid.max()) if len(valid) else None,
        "mean": float(valid.mean()) if len(valid) else None,
        "nan_share": round(1.0 - len(valid) / len(values), 6),
    }
