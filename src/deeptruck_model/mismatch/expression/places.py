"""Functions of one input, what holds in some recordings alone, and what only a simulator can run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.expression.nodes import Expression, Leaf
from deeptruck_model.mismatch.residual.evidence import Evidence

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Tent(Expression):
    """A linear B-spline at `knot`: one at the knot, zero `width` away on either side."""

    inputs: tuple[Expression, ...]
    knot: float
    width: float

    def over(self, values: Sequence[Array], e: Evidence) -> Array:
        return np.maximum(1.0 - np.abs(values[0] - self.knot) / self.width, 0.0)

    def advance(
        self, values: Sequence[Array], memory: Any, now: Mapping[str, Array], dt: float
    ) -> tuple[Array, Any]:
        return np.maximum(1.0 - np.abs(values[0] - self.knot) / self.width, 0.0), memory


@dataclass(frozen=True, eq=False)
class Interpolated(Expression):
    """A function of the input by straight lines between points (`at`, `values`), level beyond them."""

    inputs: tuple[Expression, ...]
    at: tuple[float, ...]
    values: tuple[float, ...]

    def over(self, values: Sequence[Array], e: Evidence) -> Array:
        return np.interp(values[0], self.at, self.values)

    def advance(
        self, values: Sequence[Array], memory: Any, now: Mapping[str, Array], dt: float
    ) -> tuple[Array, Any]:
        return np.interp(values[0], self.at, self.values), memory


@dataclass(frozen=True, eq=False)
class Knot(Expression):
    """A Tent in one recording (in all where `index` is negative); a simulation is left with `elsewhere`."""

    inputs: tuple[Expression, ...]
    index: int
    knot: float
    width: float
    elsewhere: float

    def over(self, values: Sequence[Array], e: Evidence) -> Array:
        tent = np.maximum(1.0 - np.abs(values[0] - self.knot) / self.width, 0.0)
        return np.where((self.index < 0) | (e.record == self.index), tent, 0.0)

    def advance(
        self, values: Sequence[Array], memory: Any, now: Mapping[str, Array], dt: float
    ) -> tuple[Array, Any]:
        return np.float64(self.elsewhere), memory  # type: ignore[return-value]


@dataclass(frozen=True, eq=False)
class InRecording(Leaf):
    """One in the named recording (from `from_s` on), zero elsewhere; in a simulation it is `elsewhere`."""

    index: int
    from_s: float = 0.0
    elsewhere: float = 0.0

    def over(self, values: Sequence[Array], e: Evidence) -> Array:
        return ((e.record == self.index) & (e["elapsed"] >= self.from_s)).astype(float)

    def advance(
        self, values: Sequence[Array], memory: Any, now: Mapping[str, Array], dt: float
    ) -> tuple[Array, Any]:
        return np.float64(self.elsewhere), memory  # type: ignore[return-value]


@dataclass(frozen=True, eq=False)
class During(Expression):
    """The input within spans (recording, from and to in s), zero elsewhere and in a simulation."""

    inputs: tuple[Expression, ...]
    spans: Sequence[Sequence[float]]

    def over(self, values: Sequence[Array], e: Evidence) -> Array:
        inside = np.zeros(len(e), dtype=bool)
        for i, first, last in self.spans:
            inside |= (e.record == i) & (e["elapsed"] >= first) & (e["elapsed"] <= last)
        return np.where(inside, values[0], 0.0)

    def advance(
        self, values: Sequence[Array], memory: Any, now: Mapping[str, Array], dt: float
    ) -> tuple[Array, Any]:
        return np.zeros_like(values[0]), memory


@dataclass(frozen=True, eq=False)
class Rerun(Leaf):
    """Change of the simulated acceleration when commands take another path; simulated by CommandPath."""

    path: str
    amount: float

    def signals(self) -> frozenset[str]:
        which = self.path.split("_")[1]
        return frozenset({"engine", "brake"} if which == "all" else {which})

    def over(self, values: Sequence[Array], e: Evidence) -> Array:
        return e.rerun(self.path, self.amount)

    def advance(
        self, values: Sequence[Array], memory: Any, now: Mapping[str, Array], dt: float
    ) -> tuple[Array, Any]:
        return np.float64(0.0), memory  # type: ignore[return-value]
