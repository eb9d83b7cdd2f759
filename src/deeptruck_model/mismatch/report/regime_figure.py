"""Under which conditions it happens: the map of the residual, and the shape of an unknown force."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from deeptruck_model.mismatch.posterior import modelled
from deeptruck_model.mismatch.posterior.free_law import features
from deeptruck_model.mismatch.report.drawing import BLUE, GREY, drawn, figure, label, tidy

if TYPE_CHECKING:
    from deeptruck_model.mismatch.posterior.causes import Explanation
    from deeptruck_model.mismatch.residual.evidence import Evidence

Array = NDArray[np.float64]

BINS = 14
LEAST_S = 3.0  # of driving in a cell that is drawn
PREFER_SPEED = 0.9  # of the best pair's explained variance: engineers read maps over speed


def regime_map(e: Evidence) -> Figure | None:
    """Mean residual force and share of squared error over the two signals that tell most; None if no data."""
    y, columns, _ = modelled.averaged(e, e.residual + modelled.retuned(e), list(features(e)))
    if len(y) < 60:
        return None
    a, b = telling_pair(y, columns)
    made = figure(10.0, 4.0)
    left = made.add_axes((0.07, 0.14, 0.42, 0.76))
    right = made.add_axes((0.57, 0.14, 0.42, 0.76))
    force, unit = drawn(e, y)
    _mean_map(left, columns[a], columns[b], force, unit)
    _share_map(right, columns[a], columns[b], y)
    for ax in (left, right):
        ax.set_xlabel(label(a, e.command_units), fontsize=9)
        ax.set_ylabel(label(b, e.command_units), fontsize=9)
    return made


def shape(e: Evidence, x: Explanation, equation: str) -> Figure | None:
    """What no name explains against the one or two signals it varies with most, with its formula as title."""
    names = modelled.drivers(x, 2)
    y, columns, _ = modelled.averaged(e, e.residual - modelled.explained(e, x), names)
    if not names or len(y) < 60:
        return None
    force, unit = drawn(e, y)
    panels = len(names) + (len(names) == 2)
    made = figure(10.0, 3.9)
    width = 0.86 / panels
    for k, name in enumerate(names):
        ax = made.add_axes((0.07 + k * width, 0.15, width - 0.075, 0.68))
        _binned(ax, columns[name], force)
        ax.set_xlabel(label(name, e.command_units), fontsize=9)
        ax.set_ylabel(f"unexplained force, {unit}", fontsize=9)
    if panels == 3:
        ax = made.add_axes((0.07 + 2 * width, 0.15, width + 0.05, 0.68))
        _mean_map(ax, columns[names[0]], columns[names[1]], force, unit)
        ax.set_xlabel(label(names[0], e.command_units), fontsize=9)
        ax.set_ylabel(label(names[1], e.command_units), fontsize=9)
    made.suptitle(equation if len(equation) < 120 else f"{equation[:117]}...", fontsize=10)
    return made


def telling_pair(y: Array, columns: dict[str, Array]) -> tuple[str, str]:
    """The two signals whose cell means explain most of the variance of y, with a penalty for each cell."""
    places = {n: place(c, edges(c)) for n, c in columns.items() if len(edges(c)) > 2}
    scores = {(a, b): _adjusted_r2(y, places[a] * 64 + places[b]) for a, b in combinations(places, 2)}
    best = max(scores, key=lambda k: scores[k])
    with_speed = max((k for k in scores if "speed" in k), key=lambda k: scores[k], default=best)
    chosen = with_speed if scores[with_speed] >= PREFER_SPEED * scores[best] else best
    return (chosen[1], chosen[0]) if chosen[1] == "speed" else chosen


def _adjusted_r2(y: Array, cell: NDArray[np.intp]) -> float:
    _, index = np.unique(cell, return_inverse=True)
    counts = np.bincount(index)
    means = np.bincount(index, weights=y) / counts
    left = float(np.sum((y - means[index]) ** 2)) / max(len(y) - len(counts), 1)
    return 1.0 - left / max(float(np.var(y, ddof=1)), 1e-12)


def edges(x: Array) -> Array:
    """Bin edges: one bin a value where there are few (gears), else even ones over what is driven."""
    values = np.unique(x)
    if len(values) <= BINS + 4 or np.mean(x == np.round(x)) > 0.8:
        whole = np.unique(np.round(values))
        if 2 <= len(whole) <= BINS + 4:
            return np.append(whole - 0.5, whole[-1] + 0.5)
    low, high = np.quantile(x, [0.005, 0.995])
    return np.linspace(low, high, BINS + 1) if high > low else np.array([low, low + 1.0])


def place(x: Array, ends: Array) -> NDArray[np.intp]:
    """The bin of each value, (n,); what lies beyond the ends is in the outermost."""
    return np.clip(np.searchsorted(ends, x, side="right") - 1, 0, len(ends) - 2)


def _sums(a: Array, b: Array, weights: Array) -> tuple[Array, Array, Array, Array]:
    """Edges of both signals, seconds in each cell and sum of weights in it, (cells of b, cells of a)."""
    x, z = edges(a), edges(b)
    size = (len(z) - 1, len(x) - 1)
    flat = place(b, z) * size[1] + place(a, x)
    count = np.bincount(flat, minlength=size[0] * size[1]).reshape(size).astype(float)
    total: Array = np.bincount(flat, weights=weights, minlength=size[0] * size[1]).reshape(size).astype(float)
    return x, z, count * modelled.PERIOD_S, total


def _mean_map(ax: Axes, a: Array, b: Array, force: Array, unit: str) -> None:
    x, z, seconds, total = _sums(a, b, force)
    mean = np.where(seconds >= LEAST_S, total / np.maximum(seconds / modelled.PERIOD_S, 1.0), np.nan)
    reach = max(float(np.nanmax(np.abs(mean), initial=0.0)), 1e-3)
    mesh = ax.pcolormesh(x, z, mean, cmap="RdBu_r", vmin=-reach, vmax=reach)
    _bar(ax, mesh, f"mean residual force, {unit}")


def _share_map(ax: Axes, a: Array, b: Array, y: Array) -> None:
    x, z, seconds, total = _sums(a, b, y**2)
    share = np.where(seconds >= LEAST_S, 100 * total / max(float(total.sum()), 1e-12), np.nan)
    mesh = ax.pcolormesh(x, z, share, cmap="YlOrBr", vmin=0)
    _bar(ax, mesh, "share of the squared error, %")


def _bar(ax: Axes, mesh: object, text: str) -> None:
    tidy(ax)
    ax.set_facecolor("#f4f4f4")
    bar = ax.figure.colorbar(mesh, ax=ax, pad=0.02, aspect=30)  # type: ignore[arg-type]
    bar.outline.set_visible(False)
    bar.ax.tick_params(labelsize=8)
    ax.set_title(text, fontsize=9, loc="left")


def _binned(ax: Axes, x: Array, force: Array) -> None:
    """Means with two standard errors."""
    tidy(ax)
    bins = place(x, edges(x))
    ax.axhline(0, color=GREY, lw=0.8)
    for k in np.unique(bins):
        own = force[bins == k]
        if len(own) * modelled.PERIOD_S >= LEAST_S:
            at = float(x[bins == k].mean())
            error = 2 * float(own.std(ddof=1)) / np.sqrt(len(own))
            ax.errorbar(at, own.mean(), error, fmt="o", color=BLUE, ms=4, lw=1.2, capsize=2)
