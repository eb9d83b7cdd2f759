"""One formula, computed over stacked recordings for the search and step by step inside a simulator.

An Expression is a small tree over named signals. `rows(e)` evaluates it over an Evidence, (n,). `Stream`
evaluates several along a running simulation, batched; the nodes with memory keep their state there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from deeptruck_model.mismatch.evidence import Evidence

Array = NDArray[np.float64]
Number = float | int

FUNCTIONS: dict[str, Callable[..., Any]] = {
    "add": np.add,
    "mul": np.multiply,
    "div": np.divide,
    "max": np.maximum,
    "min": np.minimum,
    "exp": np.exp,
    "abs": np.abs,
    "tanh": np.tanh,
    "less": lambda a, b: np.less(a, b).astype(float),
    "pow": np.power,
}


class Expression:
    """Arithmetic on signals. Subclasses give `inputs`, `rows` and `advance`."""

    inputs: tuple[Expression, ...]

    def rows(self, e: Evidence) -> Array:
        """Values over stacked recordings, (n,); memory starts afresh with each recording."""
        return np.nan_to_num(self.over([x.rows(e) for x in self.inputs], e), posinf=1e9, neginf=-1e9)

    def over(self, values: Sequence[Array], e: Evidence) -> Array:
        """Values over stacked recordings, from the values of the inputs."""
        raise NotImplementedError

    def begin(self, batch: int) -> Any:
        """Memory at the start of a simulation."""
        return None

    def advance(
        self, values: Sequence[Array], memory: Any, now: Mapping[str, Array], dt: float
    ) -> tuple[Array, Any]:
        """One step: the value (batch,) and the new memory."""
        raise NotImplementedError

    def __add__(self, other: Expression | Number) -> Expression:
        return Apply("add", (self, lift(other)))

    def __sub__(self, other: Expression | Number) -> Expression:
        return Apply("add", (self, -lift(other)))

    def __rsub__(self, other: Expression | Number) -> Expression:
        return Apply("add", (lift(other), -self))

    def __mul__(self, other: Expression | Number) -> Expression:
        return Apply("mul", (self, lift(other)))

    def __truediv__(self, other: Expression | Number) -> Expression:
        return Apply("div", (self, lift(other)))

    def __rtruediv__(self, other: Expression | Number) -> Expression:
        return Apply("div", (lift(other), self))

    def __pow__(self, power: Number) -> Expression:
        return Apply("pow", (self, lift(power)))

    def __neg__(self) -> Expression:
        return Apply("mul", (self, lift(-1.0)))

    def __lt__(self, other: Expression | Number) -> Expression:
        return Apply("less", (self, lift(other)))

    def __gt__(self, other: Expression | Number) -> Expression:
        return Apply("less", (lift(other), self))

    __radd__ = __add__
    __rmul__ = __mul__


class Leaf(Expression):
    """An expression without inputs."""

    inputs = ()


def lift(x: Expression | Number) -> Expression:
    """A number as an expression."""
    return x if isinstance(x, Expression) else Constant(float(x))


def maximum(a: Expression | Number, b: Expression | Number) -> Expression:
    return Apply("max", (lift(a), lift(b)))


def minimum(a: Expression | Number, b: Expression | Number) -> Expression:
    return Apply("min", (lift(a), lift(b)))


def exp(a: Expression) -> Expression:
    return Apply("exp", (a,))


def absolute(a: Expression) -> Expression:
    return Apply("abs", (a,))


@dataclass(frozen=True, eq=False)
class Constant(Leaf):
    value: float

    def over(self, values: Sequence[Array], e: Evidence) -> Array:
        return np.full(len(e), self.value)

    def advance(
        self, values: Sequence[Array], memory: Any, now: Mapping[str, Array], dt: float
    ) -> tuple[Array, Any]:
        return np.float64(self.value), memory  # type: ignore[return-value]


@dataclass(frozen=True, eq=False)
class Signal(Leaf):
    """A named signal; where it is not known it counts as `missing`, in a simulation as `simulated`."""

    name: str
    missing: float = 0.0
    simulated: float | None = None

    def over(self, values: Sequence[Array], e: Evidence) -> Array:
        x = e.signals.get(self.name)
        return np.full(len(e), self.missing) if x is None else np.where(np.isfinite(x), x, self.missing)

    def advance(
        self, values: Sequence[Array], memory: Any, now: Mapping[str, Array], dt: float
    ) -> tuple[Array, Any]:
        x = now.get(self.name)
        if x is None:
            absent = self.missing if self.simulated is None else self.simulated
            return np.float64(absent), memory  # type: ignore[return-value]
        return np.where(np.isfinite(x), x, self.missing), memory


@dataclass(frozen=True, eq=False)
class Apply(Expression):
    """An elementwise function of its inputs."""

    function: str
    inputs: tuple[Expression, ...]

    def over(self, values: Sequence[Array], e: Evidence) -> Array:
        with np.errstate(all="ignore"):
            out: Array = FUNCTIONS[self.function](*values)
        return out

    def advance(
        self, values: Sequence[Array], memory: Any, now: Mapping[str, Array], dt: float
    ) -> tuple[Array, Any]:
        with np.errstate(all="ignore"):
            return FUNCTIONS[self.function](*values), memory


@dataclass(frozen=True, eq=False)
class Lag(Expression):
    """First-order lag. It starts at the first value of its input, or at zero where `cold`."""

    inputs: tuple[Expression, ...]
    tau_s: float
    cold: bool = False

    def over(self, values: Sequence[Array], e: Evidence) -> Array:
        return e.lag(values[0], self.tau_s, "zero" if self.cold else "first")

    def begin(self, batch: int) -> Any:
        return np.zeros(batch) if self.cold else None

    def advance(
        self, values: Sequence[Array], memory: Any, now: Mapping[str, Array], dt: float
    ) -> tuple[Array, Any]:
        keep = np.exp(-dt / self.tau_s)
        out = values[0] if memory is None else keep * memory + (1 - keep) * values[0]
        return out, out


@dataclass(frozen=True, eq=False)
class RisingLag(Expression):
    """A follower that falls at once and rises with tau: boost, for one."""

    inputs: tuple[Expression, ...]
    tau_s: float

    def over(self, values: Sequence[Array], e: Evidence) -> Array:
        x, keep = values[0], float(np.exp(-e.dt / self.tau_s))
        out = np.empty_like(x)
        for s in e.stretches:
            part = x[s.rows].tolist()
            held = part[0]
            for k, value in enumerate(part):
                held = min(value, keep * held + (1 - keep) * value)
                part[k] = held
            out[s.rows] = part
        return out

    def advance(
        self, values: Sequence[Array], memory: Any, now: Mapping[str, Array], dt: float
    ) -> tuple[Array, Any]:
        keep = np.exp(-dt / self.tau_s)
        x = values[0]
        out = x if memory is None else np.minimum(x, keep * memory + (1 - keep) * x)
        return out, out


@dataclass(frozen=True, eq=False)
class Since(Expression):
    """Seconds since the input was last above one half; `never` before the first time."""

    inputs: tuple[Expression, ...]
    never: float = 1e6

    def over(self, values: Sequence[Array], e: Evidence) -> Array:
        return np.minimum(e.since(values[0] > 0.5), self.never)

    def begin(self, batch: int) -> Any:
        return np.full(batch, self.never)

    def advance(
        self, values: Sequence[Array], memory: Any, now: Mapping[str, Array], dt: float
    ) -> tuple[Array, Any]:
        out = np.where(values[0] > 0.5, 0.0, np.minimum(memory + dt, self.never))
        return out, out


@dataclass(frozen=True, eq=False)
class Change(Expression):
    """Difference to the previous sample, per second."""

    inputs: tuple[Expression, ...]

    def over(self, values: Sequence[Array], e: Evidence) -> Array:
        return e.difference(values[0])

    def advance(
        self, values: Sequence[Array], memory: Any, now: Mapping[str, Array], dt: float
    ) -> tuple[Array, Any]:
        previous = values[0] if memory is None else memory
        return (values[0] - previous) / dt, values[0]


@dataclass(frozen=True, eq=False)
class Slosh(Expression):
    """Specific force on the truck of a unit mass share on a spring, excited by the input acceleration.

    x'' + 2 z w x' + w^2 x = -a; the share pushes back with w^2 x + 2 z w x' and its inertia a is taken off
    the truck.
    """

    inputs: tuple[Expression, ...]
    frequency_hz: float
    damping: float

    def _matrix(self, dt: float) -> tuple[Array, Array]:
        from scipy.linalg import expm

        w = 2 * np.pi * self.frequency_hz
        full = np.zeros((3, 3))
        full[:2] = [[0.0, 1.0, 0.0], [-(w**2), -2 * self.damping * w, -1.0]]
        step = expm(full * dt)
        return step[:2, :2], step[:2, 2]

    def _force(self, x: Array, a: Array) -> Array:
        w = 2 * np.pi * self.frequency_hz
        return w**2 * x[0] + 2 * self.damping * w * x[1] + a

    def over(self, values: Sequence[Array], e: Evidence) -> Array:
        A, b = self._matrix(e.dt)
        w = 2 * np.pi * self.frequency_hz
        # position and speed as two filters with the denominator of A
        den = np.array([1.0, -np.trace(A), np.linalg.det(A)])
        num = np.array(
            [[0.0, b[0], A[0, 1] * b[1] - A[1, 1] * b[0]], [0.0, b[1], A[1, 0] * b[0] - A[0, 0] * b[1]]]
        )
        out = np.empty(len(e))
        for s in e.stretches:
            a = values[0][s.rows]
            x, v = lfilter(num[0], den, a), lfilter(num[1], den, a)
            out[s.rows] = w**2 * x + 2 * self.damping * w * v + a
        return out

    def begin(self, batch: int) -> Any:
        return np.zeros((2, batch))

    def advance(
        self, values: Sequence[Array], memory: Any, now: Mapping[str, Array], dt: float
    ) -> tuple[Array, Any]:
        A, b = self._matrix(dt)
        a = np.broadcast_to(values[0], memory.shape[1:])
        return self._force(memory, a), A @ memory + b[:, None] * a


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

    def over(self, values: Sequence[Array], e: Evidence) -> Array:
        return e.rerun(self.path, self.amount)

    def advance(
        self, values: Sequence[Array], memory: Any, now: Mapping[str, Array], dt: float
    ) -> tuple[Array, Any]:
        return np.float64(0.0), memory  # type: ignore[return-value]


class Stream:
    """Expressions evaluated together along a simulation; memory is a plain list, so states can be copied."""

    def __init__(self, expressions: Sequence[Expression]) -> None:
        self._order: list[Expression] = []
        self._index: dict[int, int] = {}
        self._outputs = [self._visit(x) for x in expressions]

    def _visit(self, x: Expression) -> int:
        if id(x) not in self._index:
            for part in x.inputs:
                self._visit(part)
            self._index[id(x)] = len(self._order)
            self._order.append(x)
        return self._index[id(x)]

    def begin(self, batch: int) -> list[Any]:
        """Memory of every node at the start."""
        return [x.begin(batch) for x in self._order]

    def step(self, memory: list[Any], now: Mapping[str, Array], dt: float) -> tuple[list[Array], list[Any]]:
        """Values of the expressions now, and the memory for the next step."""
        values: list[Array] = []
        after: list[Any] = []
        for x, m in zip(self._order, memory, strict=True):
            value, m = x.advance([values[self._index[id(i)]] for i in x.inputs], m, now, dt)
            values.append(value)
            after.append(m)
        return [values[i] for i in self._outputs], after
