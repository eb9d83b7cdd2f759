"""Nodes with memory: lags, times since events, differences, oscillators and plays; and their `Stream`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from typing import Any

import numpy as np
from scipy.signal import lfilter

from deeptruck_core.arrays import Array
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.expression.nodes import Expression, Signals, Step, Values
from deeptruck_model.trucks.compiled import entry


@dataclass(frozen=True, eq=False)
class Lag(Expression):
    """First-order lag. It starts at the first value of its input, or at zero if `cold`."""

    inputs: tuple[Expression, ...]
    tau_s: float
    cold: bool = False

    def over(self, values: Values, e: Evidence) -> Array:
        return e.lag(values[0], self.tau_s, "zero" if self.cold else "first")

    def begin(self, batch: int) -> Any:
        return np.zeros(batch) if self.cold else None

    def advance(self, values: Values, memory: Any, now: Signals, dt: float) -> Step:
        keep = np.exp(-dt / self.tau_s)
        out = values[0] if memory is None else keep * memory + (1 - keep) * values[0]
        return out, out


@entry
def _rising(x: Array, keep: float) -> Array:
    out = x.copy()
    for k in range(1, len(x)):
        out[k] = min(x[k], keep * out[k - 1] + (1 - keep) * x[k])
    return out


@dataclass(frozen=True, eq=False)
class RisingLag(Expression):
    """First-order lag of rising values only, as for boost pressure; falling values pass at once."""

    inputs: tuple[Expression, ...]
    tau_s: float

    def over(self, values: Values, e: Evidence) -> Array:
        x, keep = values[0], float(np.exp(-e.dt / self.tau_s))
        out = np.empty_like(x)
        for s in e.drives:
            out[s.rows] = _rising(x[s.rows], keep)
        return out

    def advance(self, values: Values, memory: Any, now: Signals, dt: float) -> Step:
        keep = np.exp(-dt / self.tau_s)
        x = values[0]
        out = x if memory is None else np.minimum(x, keep * memory + (1 - keep) * x)
        return out, out


@dataclass(frozen=True, eq=False)
class Since(Expression):
    """Seconds since the input last exceeded one half; `never` before the first time."""

    inputs: tuple[Expression, ...]
    never: float = 1e6

    def over(self, values: Values, e: Evidence) -> Array:
        return np.minimum(e.since(values[0] > 0.5), self.never)

    def begin(self, batch: int) -> Any:
        return np.full(batch, self.never)

    def advance(self, values: Values, memory: Any, now: Signals, dt: float) -> Step:
        out = np.where(values[0] > 0.5, 0.0, np.minimum(memory + dt, self.never))
        return out, out


@dataclass(frozen=True, eq=False)
class Integral(Expression):
    """Integral of the input over time since the start of a recording or simulation."""

    inputs: tuple[Expression, ...]

    def over(self, values: Values, e: Evidence) -> Array:
        return e.integral(values[0])

    def begin(self, batch: int) -> Any:
        return np.zeros(batch)

    def advance(self, values: Values, memory: Any, now: Signals, dt: float) -> Step:
        out = memory + values[0] * dt
        return out, out


@dataclass(frozen=True, eq=False)
class Change(Expression):
    """Difference to the previous sample, per second."""

    inputs: tuple[Expression, ...]

    def over(self, values: Values, e: Evidence) -> Array:
        return e.difference(values[0])

    def advance(self, values: Values, memory: Any, now: Signals, dt: float) -> Step:
        previous = values[0] if memory is None else memory
        return (values[0] - previous) / dt, values[0]


@cache
def _spring(frequency_hz: float, damping: float, dt: float) -> tuple[Array, Array]:
    """Discrete state of a mass on a spring: position and speed after a step are A (2, 2) times them, plus b
    (2,) times the acceleration, which is constant in the step."""
    from scipy.linalg import expm

    w = 2 * np.pi * frequency_hz
    full = np.zeros((3, 3))
    full[:2] = [[0.0, 1.0, 0.0], [-(w**2), -2 * damping * w, -1.0]]
    step = expm(full * dt)
    return step[:2, :2], step[:2, 2]


@dataclass(frozen=True, eq=False)
class Slosh(Expression):
    """Specific force on the truck of a unit mass share on a spring, excited by the input acceleration.

    x'' + 2 z w x' + w^2 x = -a; the share reacts with w^2 x + 2 z w x', and its inertial force a is removed
    from the truck.
    """

    inputs: tuple[Expression, ...]
    frequency_hz: float
    damping: float

    def _force(self, x: Array, a: Array) -> Array:
        w = 2 * np.pi * self.frequency_hz
        return w**2 * x[0] + 2 * self.damping * w * x[1] + a

    def over(self, values: Values, e: Evidence) -> Array:
        A, b = _spring(self.frequency_hz, self.damping, e.dt)
        w = 2 * np.pi * self.frequency_hz
        # position and speed as two filters with the denominator of A
        den = np.array([1.0, -np.trace(A), np.linalg.det(A)])
        num = np.array(
            [[0.0, b[0], A[0, 1] * b[1] - A[1, 1] * b[0]], [0.0, b[1], A[1, 0] * b[0] - A[0, 0] * b[1]]]
        )
        out = np.empty(len(e))
        for s in e.drives:
            a = values[0][s.rows]
            x, v = lfilter(num[0], den, a), lfilter(num[1], den, a)
            out[s.rows] = w**2 * x + 2 * self.damping * w * v + a
        return out

    def begin(self, batch: int) -> Any:
        return np.zeros((2, batch))

    def advance(self, values: Values, memory: Any, now: Signals, dt: float) -> Step:
        A, b = _spring(self.frequency_hz, self.damping, dt)
        a = np.broadcast_to(values[0], memory.shape[1:])
        return self._force(memory, a), A @ memory + b[:, None] * a


class Stepped(Expression):
    """A node that is computed step by step also along recordings, with all recordings in parallel."""

    def over(self, values: Values, e: Evidence) -> Array:
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

    def advance(self, values: Values, memory: Any, now: Signals, dt: float) -> Step:
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
