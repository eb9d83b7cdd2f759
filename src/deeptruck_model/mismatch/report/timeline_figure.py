"""The recordings along time: what was driven, and where which finding acts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from deeptruck_model.mismatch.posterior import modelled
from deeptruck_model.mismatch.report.drawing import (
    BLUE,
    GREY,
    INK,
    MINT,
    VERMILION,
    WINE,
    colour,
    drawn,
    figure,
    tidy,
    usual_reach,
    words,
)
from deeptruck_model.mismatch.report.given import as_given
from deeptruck_model.mismatch.residual.evidence import Evidence, Stretch
from deeptruck_model.mismatch.result import Mismatch
from deeptruck_model.recordings import Recording
from deeptruck_model.signals import printed

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Span = tuple[float, float, int]

MOST_RECORDINGS = 12
POINTS = 1500  # a page is not wider
SMOOTH_S = 1.0
ROW_INCHES, HEAD_INCHES, WIDTH = 2.9, 0.5, 10.0
GAP_INCHES = 0.14  # between panels: the tick labels at their edges do not touch
RESIDUAL_WIDTH = 2.4  # wide, so that it is seen below what explains it
RESIDUAL = "residual force, mean over 1 s; a mark where it goes beyond"
PANELS = (1.0, 0.7, 1.0)  # speed and grade, commands, force


@dataclass(frozen=True)
class Track:
    """One recording as it is drawn, (n,) each; `spans` are seconds from, to, and the finding that acts."""

    title: str
    time: Array
    signals: dict[str, Array]
    force: Array | None  # in `unit`
    explained: Array | None
    spans: tuple[Span, ...]
    weight: float
    unit: str = "kN"


def tracks(m: Mismatch) -> list[Track]:
    """Every recording, on the evidence's clock where there is any."""
    if m.evidence is None or m.explanation is None:
        return [_raw(r) for r in as_given(m.prepared)]
    e = m.evidence
    moved = modelled.retuned(e)
    force = e.residual + moved
    stated = modelled.told(e, m.explanation)
    spans = [(s.start, s.stop, s.finding, s.energy) for s in m.result.segments]
    return [_track(e, s, force, stated if m.explanation.causes else None, spans) for s in e.stretches]


def _track(
    e: Evidence,
    s: Stretch,
    force: Array,
    stated: Array | None,
    spans: Sequence[tuple[int, int, int, float]],
) -> Track:
    own = [x for x in spans if s.start <= x[0] < s.stop]
    smooth = max(1, round(SMOOTH_S / e.dt))

    def smoothed(x: Array) -> Array:
        out = uniform_filter1d(np.nan_to_num(drawn(e, e.newtons(x) / e.mass)[0][s.rows]), smooth)
        return np.where(e.valid[s.rows], out, np.nan)

    seconds = [
        (s.start_s + (first - s.start) * e.dt, s.start_s + (last - s.start) * e.dt, f)
        for a, b, f, _ in own
        for first, last in _compared(e.valid, a, b)
    ]
    names = ("speed", "grade", "engine_command", "brake_command")
    return Track(
        s.name + (", held out" if s.held_out else ""),
        e["time"][s.rows],
        {n: e[n][s.rows] for n in names if e.has(n)},
        smoothed(force),
        None if stated is None else smoothed(stated),
        tuple(seconds),
        float(sum(x[3] for x in own)),
        drawn(e, force)[1],
    )


def _compared(valid: Mask, start: int, stop: int) -> list[tuple[int, int]]:
    """The runs of rows start..stop in which recording and simulator are compared at all."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], valid[start:stop].astype(int), [0]])))
    return [(start + int(a), start + int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _raw(r: Recording) -> Track:
    names = ("speed", "grade", "engine_command", "brake_command")
    signals = {n: r.channels[n] for n in names if n in r.channels}
    return Track(r.name, r.time, signals, None, None, (), 0.0)


def timeline(m: Mismatch) -> tuple[Figure, list[float], int]:
    """Speed, grade, commands, residual and explained force of each recording.

    Also where each recording ends (inches from the top), and how many are not drawn: those with the most to
    see are, in their order.
    """
    every = tracks(m)
    order = sorted(range(len(every)), key=lambda i: -every[i].weight)[:MOST_RECORDINGS]
    chosen = [every[i] for i in sorted(order)]
    heights = PANELS if m.evidence is not None else PANELS[:2]
    row = ROW_INCHES * (sum(heights) + 0.35) / (sum(PANELS) + 0.35)
    made = figure(WIDTH, HEAD_INCHES + row * len(chosen))
    forces = [t.force for t in chosen if t.force is not None]
    reach = usual_reach(forces, [t.explained for t in chosen if t.explained is not None])
    for k, track in enumerate(chosen):
        panels = _row(made, track, heights, HEAD_INCHES + row * k, row, _units(m))
        if track.force is not None:
            _forces(panels[2], track, reach)
    _legend(made, m)
    ends = [HEAD_INCHES + row * (k + 1) for k in range(len(chosen))]
    return made, ends, len(every) - len(chosen)


def _units(m: Mismatch) -> tuple[str, str]:
    interface = m.prepared[0].recording.interface
    return (
        printed(interface.unit("engine_command")),
        printed(interface.unit("brake_command")) if "brake_command" in interface.u else "",
    )


def _row(
    made: Figure, t: Track, heights: Sequence[float], top: float, row: float, units: tuple[str, str]
) -> list[Axes]:
    """The panels of one recording, speed and commands drawn."""
    total = made.get_size_inches()[1]
    unit = (row - 0.55) / sum(heights)
    panels, at = [], top + 0.22
    for h in heights:
        ax = made.add_axes((0.075, 1.0 - (at + h * unit) / total, 0.85, (h * unit - GAP_INCHES) / total))
        at += h * unit
        tidy(ax)
        for a, b, finding in t.spans:
            ax.axvspan(a, b, color=colour(finding), alpha=0.25, lw=0)
        ax.set_xlim(t.time[0], t.time[-1])
        panels.append(ax)
    for ax in panels[:-1]:
        ax.tick_params(labelbottom=False)
    panels[0].set_title(t.title, loc="left", fontsize=9, fontweight="bold", pad=3)
    panels[-1].set_xlabel("time, s", fontsize=8, labelpad=0)
    thin = slice(None, None, max(1, len(t.time) // POINTS))
    _driven(panels[0], t, thin)
    _commands(panels[1], t, thin, units)
    return panels


def _driven(ax: Axes, t: Track, thin: slice) -> None:
    ax.plot(t.time[thin], t.signals["speed"][thin], color=INK, lw=1)
    ax.set_ylabel("speed, m/s", fontsize=8)
    ax.set_ylim(bottom=0)
    if "grade" in t.signals:
        grade = _second(ax, "grade, %")
        grade.fill_between(t.time[thin], 0, 100 * t.signals["grade"][thin], color=GREY, alpha=0.35, lw=0)
        reach = max(2.0, 100 * float(np.nanmax(np.abs(t.signals["grade"]), initial=0.0)))
        grade.set_ylim(-1.05 * reach, 1.05 * reach)


def _commands(ax: Axes, t: Track, thin: slice, units: tuple[str, str]) -> None:
    if "engine_command" in t.signals:
        ax.plot(t.time[thin], t.signals["engine_command"][thin], color=BLUE, lw=0.9)
    ax.set_ylabel(f"engine,\n{units[0]}", fontsize=8)
    if "brake_command" in t.signals:
        brake = _second(ax, f"brake,\n{units[1]}")
        brake.plot(t.time[thin], t.signals["brake_command"][thin], color=VERMILION, lw=0.9)
        brake.set_ylim(bottom=0)


def _forces(ax: Axes, t: Track, reach: float) -> None:
    """What is beyond `reach` is cut off there, with a mark."""
    assert t.force is not None
    thin = slice(None, None, max(1, len(t.time) // POINTS))
    ax.axhline(0, color=GREY, lw=0.6)
    ax.plot(t.time[thin], t.force[thin], color=MINT, lw=RESIDUAL_WIDTH)
    if t.explained is not None:
        ax.plot(t.time[thin], t.explained[thin], color=WINE, lw=1.1)
    if reach > 0.0:
        ax.set_ylim(-reach, reach)
        for sign, mark in ((1.0, "^"), (-1.0, "v")):
            beyond = t.time[thin][np.nan_to_num(sign * t.force[thin]) > reach]
            ax.plot(beyond, np.full(len(beyond), 0.96 * sign * reach), mark, color=MINT, ms=3, mec="none")
    ax.set_ylabel(f"force, {t.unit}", fontsize=8)


def _second(ax: Axes, text: str) -> Axes:
    other: Axes = ax.twinx()
    other.spines[["top", "left", "right"]].set_visible(False)
    other.tick_params(labelsize=8, colors="#444444")
    other.set_ylabel(text, fontsize=8)
    return other


def _legend(made: Figure, m: Mismatch) -> None:
    entries: list[Line2D | Patch] = [
        Line2D([], [], color=INK, lw=1, label="speed"),
        Patch(color=GREY, alpha=0.35, label="grade"),
        Line2D([], [], color=BLUE, lw=1, label="engine command"),
        Line2D([], [], color=VERMILION, lw=1, label="brake command"),
    ]
    if m.evidence is not None:
        entries.append(Line2D([], [], color=MINT, lw=RESIDUAL_WIDTH, label=RESIDUAL))
    if m.explanation is not None and m.explanation.causes:
        entries.append(Line2D([], [], color=WINE, lw=1.1, label="as explained (same panel)"))
    for k, f in enumerate(m.result.findings):
        if f.cause is not None:
            entries.append(Patch(color=colour(k), alpha=0.35, label=f"{words(f.effect)} acts"))
    made.legend(handles=entries, loc="upper left", ncols=4, fontsize=8, frameon=False, borderaxespad=0.2)
