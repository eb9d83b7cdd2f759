"""Regimes of driving to which an effect may be confined: only uphill, only at speed, only under load.

Every border of every signal is tried for every mechanism. That is cheap as a gain needs sums of products
alone: they are added up once over narrow bins of each signal, and a regime is a run of bins.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.mechanisms.base import GATES, CandidateTerm, build
from deeptruck_model.mismatch.mechanisms.variants import Gate, Gated
from deeptruck_model.mismatch.residual.effective_mass import acceleration_of
from deeptruck_model.mismatch.residual.evidence import Evidence

Array = NDArray[np.float64]

BINS = 10
SIDES: tuple[Literal["below", "above"], ...] = ("below", "above")


@dataclass(frozen=True)
class Products:
    """Of whitened columns C (m, k) with themselves, the residual y (m,) and the columns X (m, p) beside them;
    of several C one after the other along the first axis."""

    CtC: Array
    Cty: Array
    XtC: Array

    @staticmethod
    def of(C: Array, y: Array, X: Array) -> Products:
        return Products(C.T @ C, C.T @ y, X.T @ C)

    @staticmethod
    def stacked(parts: Sequence[Products]) -> Products:
        return Products(*(np.stack([getattr(p, f) for p in parts]) for f in ("CtC", "Cty", "XtC")))

    @staticmethod
    def joined(parts: Sequence[Products]) -> Products:
        return Products(*(np.concatenate([getattr(p, f) for p in parts]) for f in ("CtC", "Cty", "XtC")))

    def below_and_above(self) -> Products:
        """Of the bins up to each border, then of those beyond it, where these are of bins in order."""
        sums = [np.cumsum(x, axis=0) for x in (self.CtC, self.Cty, self.XtC)]
        return Products(*(np.concatenate([x[:-1], x[-1] - x[:-1]]) for x in sums))


def between_gears(edges: Array, gears: Sequence[float]) -> Array:
    """The borders (at most as many) between gears (rad/m, ascending) that are next above the edges: through a
    gear itself none runs, where noise alone would decide the side."""
    at = np.asarray(gears)
    between = np.sqrt(at[1:] * at[:-1])
    above = np.searchsorted(between, edges)
    out: Array = between[np.unique(above[above < len(between)])]
    return out


@dataclass(frozen=True)
class Regimes:
    """Borders of each of the `signals` (n,), and for each the rows that count in every bin between them."""

    borders: dict[str, Array]
    rows: dict[str, list[NDArray[np.intp]]]
    signals: dict[str, Array]
    _known: dict[int, tuple[CandidateTerm, list[tuple[Array, Callable[[Array], Array]]]]] = field(
        default_factory=dict
    )

    @staticmethod
    def of(e: Evidence, use: NDArray[np.bool_]) -> Regimes:
        """Borders at quantiles of every signal that was recorded; `use` (n,) are the rows that count."""
        borders, rows, signals = {}, {}, {}
        for name, (signal, needs) in GATES.items():
            if not e.has(*needs) or not use.any():
                continue
            x = signals[name] = signal.rows(e)
            edges = np.unique(np.quantile(x[use], np.linspace(0.0, 1.0, BINS + 1)[1:-1]))
            edges = between_gears(edges, e.gears) if name == "lever" else edges
            bins = np.searchsorted(edges, x[use], side="left")
            borders[name] = edges
            rows[name] = [np.flatnonzero(bins == b) for b in range(len(edges) + 1)]
        return Regimes(borders, rows, signals)

    @property
    def count(self) -> int:
        """How many gates there are."""
        return 2 * sum(len(edges) for edges in self.borders.values())

    def products(self, C: Array, y: Array, X: Array) -> tuple[list[Gate], Products]:
        """Every gate, and products of C as if it acted on that side of a border alone.

        C (m, k), y (m,) and X (m, p) are whitened, over the rows that count.
        """
        gates: list[Gate] = []
        parts = []
        for name, edges in self.borders.items():
            bins = Products.stacked([Products.of(C[r], y[r], X[r]) for r in self.rows[name]])
            gates += [Gate(name, side, float(edge)) for side in SIDES for edge in edges]
            parts.append(bins.below_and_above())
        return gates, Products.joined(parts) if parts else Products(*([np.zeros((0, 0, 0))] * 3))

    def inside(self, gate: Gate) -> NDArray[np.bool_]:
        """Rows (n,) on the gate's side of its border."""
        x = self.signals[gate.signal]
        return x > gate.at if gate.side == "above" else x <= gate.at

    def gated(self, term: CandidateTerm, gate: Gate, e: Evidence) -> CandidateTerm:
        """The candidate term confined to one side of a border. What brakes make up for begins anew at the
        border, so it is the force that is confined."""
        variant = Gated(term.variant, gate)
        parts = tuple(build(term.mechanism, variant))
        inside = self.inside(gate).astype(float)
        columns = np.stack([force(x * inside) for x, force in self._forces(term, e)], axis=1)
        return replace(term, variant=variant, parts=parts, columns=columns, trials=term.trials * self.count)

    def _forces(self, term: CandidateTerm, e: Evidence) -> list[tuple[Array, Callable[[Array], Array]]]:
        """The force of each column (n,), and what makes an acceleration of it; computed once for a term."""
        if id(term) not in self._known:
            plain = zip(term.parts, term.columns.T, strict=True)
            forces = [acceleration_of(p.expression, column, e) for p, column in plain]
            self._known[id(term)] = (term, forces)  # which keeps the term, and so its id
        return self._known[id(term)][1]
