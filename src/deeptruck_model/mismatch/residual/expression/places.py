"""Nodes that are stepped in time, functions of one input, factors of single recordings, and command paths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.expression.nodes import Expression, Leaf


class Stepped(Expression):
    """A node that is computed step by step also along recordings, with all recordings in parallel."""

    def over(self, values: Sequence[Array], e: Evidence) -> Array:
        longest = max(s.stop - s.start for s in e.drives)
        rows = np.zeros((longest, len(e.drives)))
        for k, s in enumerate(e.drives):
            rows[: s.stop - s.start, k] = values[0][s.rows]
        memory = self.begin(len(e.drives))
        for k, x in enumerate(rows):
            rows[k], memory = self.advance([x], memory, {}, e.dt)
        return np.concatenate([rows[: s.stop - s.start, k] for k, s in enumerate(e.drives)])


@dataclass(frozen=True, eq=False)
class Play(Stepped):
    """Reduces a force while it turns the driveline through its play.

    The force moves the play against friction from one end to the other, `reach` (force times s) apart; at an
    end the whole force is transmitted. A soft spring in the play transmits up to `holds` before.
    """

    inputs: tuple[Expression, ...]
    reach: float
    holds: float = 0.0

    def begin(self, batch: int) -> Any:
        return np.zeros(batch)  # from the middle

    def advance(
        self, values: Sequence[Array], memory: Any, now: Mapping[str, Array], dt: float
    ) -> tuple[Array, Any]:
        half = 0.5 * self.reach
        stiff = self.holds / half
        # towards where the spring holds all of it, exactly; the spring may be far quicker than a step
        share = (1.0 - np.exp(-stiff * dt)) / stiff if stiff > 0.0 else dt
        after = np.clip(memory + share * (values[0] - stiff * memory), -half, half)
        return (after - memory) / dt, after


class Stream:
    """Expressions evaluated together along a simulation; memory is a plain list, so states can be copied.

    Shared nodes, such as the signal of several knots, are computed once.
    """

    def __init__(self, expressions: Sequence[Expression]) -> None:
        self._order: list[tuple[Expression, tuple[int, ...]]] = []  # and the places of its inputs
        self._places: dict[tuple[object, ...], int] = {}
        self.outputs = [self._visit(x) for x in expressions]  # the place of each; equal ones share theirs

    def _visit(self, x: Expression) -> int:
        inputs = tuple(self._visit(part) for part in x.inputs)
        own = tuple(repr(getattr(x, f.name)) for f in fields(x) if f.name != "inputs")  # type: ignore[arg-type]
        alike = (type(x), inputs, own)
        if alike not in self._places:
            self._places[alike] = len(self._order)
            self._order.append((x, inputs))
        return self._places[alike]

    def begin(self, batch: int) -> list[Any]:
        """Memory of every node at the start."""
        return [x.begin(batch) for x, _ in self._order]

    def step(self, memory: list[Any], now: Mapping[str, Array], dt: float) -> tuple[list[Array], list[Any]]:
        """Values of the expressions now, and the memory for the next step."""
        values: list[Array] = []
        after: list[Any] = []
        with np.errstate(all="ignore"):
            for (x, inputs), m in zip(self._order, memory, strict=True):
                value, m = x.advance([values[k] for k in inputs], m, now, dt)
                values.append(value)
                after.append(m)
        return [values[k] for k in self.outputs], after


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
    """Piecewise-linear function of the input through points (`at`, `values`), constant beyond them."""

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
    """A Tent in one recording; in a simulation its value is `elsewhere`."""

    inputs: tuple[Expression, ...]
    index: int
    knot: float
    width: float
    elsewhere: float

    def over(self, values: Sequence[Array], e: Evidence) -> Array:
        tent = np.maximum(1.0 - np.abs(values[0] - self.knot) / self.width, 0.0)
        return np.where(e.record == self.index, tent, 0.0)

    def advance(
        self, values: Sequence[Array], memory: Any, now: Mapping[str, Array], dt: float
    ) -> tuple[Array, Any]:
        return np.float64(self.elsewhere), memory  # type: ignore[return-value]


@dataclass(frozen=True, eq=False)
class AtPlace(Expression):
    """A Tent over the road position; `elsewhere` if the position is unknown, which an input below
    zero means."""

    inputs: tuple[Expression, ...]
    knot: float
    width: float
    elsewhere: float

    def over(self, values: Sequence[Array], e: Evidence) -> Array:
        return self._at(values[0])

    def advance(
        self, values: Sequence[Array], memory: Any, now: Mapping[str, Array], dt: float
    ) -> tuple[Array, Any]:
        return self._at(values[0]), memory

    def _at(self, place: Array) -> Array:
        tent = np.maximum(1.0 - np.abs(place - self.knot) / self.width, 0.0)
        return np.where(place < 0.0, self.elsewhere, tent)


@dataclass(frozen=True, eq=False)
class InRecording(Leaf):
    """One in the named recording (from `from_s` on), zero in others; in a simulation its value is
    `elsewhere`."""

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
class Rerun(Leaf):
    """Change of the simulated acceleration if commands take another path; in a simulation CommandPath
    computes it."""

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
