"""What lies on a road stays there, for all drives and both directions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from deeptruck_exam.effects.law import Array, Hidden
from deeptruck_model.trucks import View

CELL_M = 5.0
CELLS = 12400  # a little more than the longest road
MAP_CELL_M, MAP_CELLS = 10.0, 6000


class OnRoad(Hidden):
    """Rows (routes, cells) read at the truck's place, whichever way it drives; `road` is such rows."""

    road: Array

    def rows(self) -> int:
        return int(self.setting.route.max()) + 1

    def cell(self, view: View, cells: int = CELLS) -> NDArray[np.int64]:
        return (self.place(view) / CELL_M).astype(int) % cells

    def read(self, rows: Array, view: View) -> Array:
        return np.asarray(rows[self.setting.route, self.cell(view, rows.shape[1])])

    def between(self, rows: Array, view: View) -> Array:
        """Rows of cells of MAP_CELL_M, interpolated."""
        cell = self.place(view) / MAP_CELL_M
        low, route = cell.astype(int) % (MAP_CELLS - 1), self.setting.route
        share = cell - np.floor(cell)
        return np.asarray((1.0 - share) * rows[route, low] + share * rows[route, low + 1])


class Bends(OnRoad):
    """`bend` (routes, cells): curvature, 1/m, left positive; spirals at both ends of each arc."""

    def draw_bends(self, rng: np.random.Generator, tightest: float) -> Array:
        bend = np.zeros((self.rows(), CELLS))
        for row in bend:
            for first, last in stretches(rng, (60.0, 500.0), (60.0, 260.0)):
                arc = rng.choice([-1.0, 1.0]) * tightest * rng.uniform(0.35, 1.0)
                row[first:last] = arc * np.sin(np.pi * np.linspace(0.0, 1.0, last - first)) ** 0.5
        return bend


def smooth_stretches(
    rng: np.random.Generator, routes: int, gaps: tuple[float, float], lengths: tuple[float, float]
) -> Array:
    """(routes, 12000) from 0 to 1: raised cosines in stretches, over 60 km of road."""
    road = np.zeros((routes, 12000))
    for row in road:
        at = rng.uniform(*gaps)
        while at < 59000.0:
            length = rng.uniform(*lengths)
            low, high = int(at / CELL_M), int((at + length) / CELL_M)
            shape = np.sin(np.pi * (np.arange(high - low) + 0.5) / max(high - low, 1)) ** 2
            row[low:high] = rng.uniform(0.6, 1.0) * shape[: len(row) - low]
            at += length + rng.uniform(*gaps)
    return road


def sections(rng: np.random.Generator, rows: int, mean_m: float) -> NDArray[np.int64]:
    """(rows, 12000) numbers of the section a cell lies in; lengths are log-normal about `mean_m`."""
    out = np.zeros((rows, 12000), np.int64)
    for row in out:
        ends = np.cumsum(np.maximum(mean_m * rng.lognormal(-0.1, 0.45, len(row)), 60.0))
        row[:] = np.searchsorted(ends, (np.arange(len(row)) + 0.5) * CELL_M)
    return out


def windows(rng: np.random.Generator, rows: int, mean_m: float, share: float) -> Array:
    """(rows, MAP_CELLS) of 0 and 1: a Markov chain of stretches of `mean_m` over `share` of the road."""
    leave, enter = MAP_CELL_M / mean_m, MAP_CELL_M / mean_m * share / (1.0 - share)
    out = np.zeros((rows, MAP_CELLS))
    state = rng.random(rows) < share
    for k, chance in enumerate(rng.random((MAP_CELLS, rows))):
        state = np.where(state, chance > leave, chance < enter)
        out[:, k] = state
    return out


def stretches(
    rng: np.random.Generator, gaps: tuple[float, float], lengths: tuple[float, float]
) -> list[tuple[int, int]]:
    """First and last cell of stretches along one road; gaps and lengths are log-uniform, m."""
    out, at = [], rng.uniform(0.0, gaps[1])
    while at < CELL_M * CELLS:
        end = at + np.exp(rng.uniform(*np.log(lengths)))
        out.append((int(at / CELL_M), min(int(end / CELL_M) + 1, CELLS)))
        at = end + np.exp(rng.uniform(*np.log(gaps)))
    return out
