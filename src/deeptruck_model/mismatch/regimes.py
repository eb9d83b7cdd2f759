"""Regimes of driving to which an effect may be confined: only uphill, only at speed, only under load.

Every border of every signal is tried for every mechanism. That is cheap as a gain needs sums of products
alone: they are added up once over narrow bins of each signal, and a regime is a run of bins.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.evidence import Evidence
from deeptruck_model.mismatch.mechanisms.base import GATES, Shape, build

Array = NDArray[np.float64]
Gate = tuple[str, str, float]  # signal, above or below, value

BINS = 10


@dataclass(frozen=True)
class Products:
    """Of whitened columns C (n, k) with themselves, the residual y and the columns X beside them."""

    CtC: Array
    Cty: Array
    XtC: Array


@dataclass(frozen=True)
class Regimes:
    """Borders of each signal, and for each the rows (of those that count) in every bin between them."""

    borders: dict[str, Array]
    rows: dict[str, list[NDArray[np.intp]]]

    @staticmethod
    def of(e: Evidence, use: NDArray[np.bool_]) -> Regimes:
        """Borders at quantiles of every signal that was recorded; `use` (n,) are the rows that count."""
        borders, rows = {}, {}
        for name, (signal, needs) in GATES.items():
            if not e.has(*needs) or not use.any():
                continue
            x = signal.rows(e)
            edges = np.unique(np.quantile(x[use], np.linspace(0.0, 1.0, BINS + 1)[1:-1]))
            bins = np.searchsorted(edges, x[use], side="left")
            borders[name] = edges
            rows[name] = [np.flatnonzero(bins == b) for b in range(len(edges) + 1)]
        return Regimes(borders, rows)

    @property
    def count(self) -> int:
        """How many gates there are."""
        return 2 * sum(len(edges) for edges in self.borders.values())

    def products(self, C: Array, y: Array, X: Array) -> Iterator[tuple[Gate, Products]]:
        """Products of C as if it acted on one side of a border alone, for every gate.

        C (m, k), y (m,) and X (m, p) are whitened, over the rows that count.
        """
        for name, edges in self.borders.items():
            each = [_products(C[r], y[r], X[r]) for r in self.rows[name]]
            total, below = _sum(each), _sum(each[:1])
            for k, edge in enumerate(edges):
                yield (name, "below", float(edge)), below
                yield (name, "above", float(edge)), _less(total, below)
                below = _sum([below, each[k + 1]])


def gated(shape: Shape, gate: Gate, e: Evidence, trials: int) -> Shape:
    """The shape confined to one side of a border."""
    settings = shape.settings | {"gate": list(gate)}
    parts = tuple(build(shape.mechanism, settings))
    columns = shape.columns * _inside(gate, e)[:, None]
    if "holds" in e.signals and e["holds"].any():  # what sets in at a border is felt for a while
        columns = np.stack([p.expression.rows(e) for p in parts], axis=1)
    return replace(shape, settings=settings, parts=parts, columns=columns, trials=shape.trials * trials)


def _inside(gate: Gate, e: Evidence) -> NDArray[np.bool_]:
    signal, side, at = gate
    x = GATES[signal][0].rows(e)
    return x > at if side == "above" else x <= at


def _products(C: Array, y: Array, X: Array) -> Products:
    return Products(C.T @ C, C.T @ y, X.T @ C)


def _sum(parts: list[Products]) -> Products:
    return Products(
        np.sum([p.CtC for p in parts], axis=0),
        np.sum([p.Cty for p in parts], axis=0),
        np.sum([p.XtC for p in parts], axis=0),
    )


def _less(whole: Products, part: Products) -> Products:
    return Products(whole.CtC - part.CtC, whole.Cty - part.Cty, whole.XtC - part.XtC)
