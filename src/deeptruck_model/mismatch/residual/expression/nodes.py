"""Nodes for arithmetic on named signals, from which every formula is built."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_model.mismatch.residual.evidence import Evidence

Number = float | int
Values = Sequence[Array]  # of the inputs
Signals = Mapping[str, Array]
Step = tuple[Array, Any]  # the value (batch,) and the new memory

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
        """Values over stacked recordings, (n,); memory is reset at the start of each recording."""
        return rows_of([self], e)[0]

    def over(self, values: Values, e: Evidence) -> Array:
        """Values over stacked recordings, given the values of the inputs."""
        raise NotImplementedError

    def signals(self) -> frozenset[str]:
        """Names of all signals in it."""
        return frozenset[str]().union(*(x.signals() for x in self.inputs))

    def begin(self, batch: int) -> Any:
        """Memory at the start of a simulation."""
        return None

    def advance(self, values: Values, memory: Any, now: Signals, dt: float) -> Step:
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


def rows_of(expressions: Iterable[Expression], e: Evidence) -> list[Array]:
    """The `rows` of several expressions, (n,) each; shared nodes are computed once."""
    known: dict[int, Array] = {}

    def value(x: Expression) -> Array:
        if id(x) not in known:
            out = x.over([value(part) for part in x.inputs], e)
            known[id(x)] = out if np.isfinite(out).all() else np.nan_to_num(out, posinf=1e9, neginf=-1e9)
        return known[id(x)]

    return [value(x) for x in expressions]


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


def tanh(a: Expression) -> Expression:
    return Apply("tanh", (a,))


def absolute(a: Expression) -> Expression:
    return Apply("abs", (a,))


class Pointwise(Expression):
    """An expression whose value in each row follows from its inputs in that row, by `at`."""

    def at(self, values: Values) -> Array:
        """The values, given those of the inputs."""
        raise NotImplementedError

    def over(self, values: Values, e: Evidence) -> Array:
        with np.errstate(all="ignore"):
            return self.at(values)

    def advance(self, values: Values, memory: Any, now: Signals, dt: float) -> Step:
        return self.at(values), memory  # a stream ignores what is no number


class OfRecordings(Expression):
    """An expression of single recordings; in a simulation its value is `elsewhere`."""

    elsewhere: float = 0.0

    def advance(self, values: Values, memory: Any, now: Signals, dt: float) -> Step:
        return np.float64(self.elsewhere), memory  # type: ignore[return-value]


@dataclass(frozen=True, eq=False)
class Constant(Leaf):
    value: float

    def over(self, values: Values, e: Evidence) -> Array:
        return np.full(len(e), self.value)

    def advance(self, values: Values, memory: Any, now: Signals, dt: float) -> Step:
        return np.float64(self.value), memory  # type: ignore[return-value]


@dataclass(frozen=True, eq=False)
class Signal(Leaf):
    """A named signal. Where it is not known, its value is `missing`, in a simulation `simulated`."""

    name: str
    missing: float = 0.0
    simulated: float | None = None

    def signals(self) -> frozenset[str]:
        return frozenset({self.name})

    def over(self, values: Values, e: Evidence) -> Array:
        x = e.signals.get(self.name)
        return np.full(len(e), self.missing) if x is None else np.where(np.isfinite(x), x, self.missing)

    def advance(self, values: Values, memory: Any, now: Signals, dt: float) -> Step:
        x = now.get(self.name)
        if x is None:
            absent = self.missing if self.simulated is None else self.simulated
            return np.float64(absent), memory  # type: ignore[return-value]
        return np.where(np.isfinite(x), x, self.missing), memory


@dataclass(frozen=True, eq=False)
class Apply(Pointwise):
    """An elementwise function of its inputs."""

    function: str
    inputs: tuple[Expression, ...]

    def at(self, values: Values) -> Array:
        return np.asarray(FUNCTIONS[self.function](*values))


@dataclass(frozen=True, eq=False)
class Tent(Pointwise):
    """A linear B-spline at `knot`: one at the knot, zero `width` away on either side."""

    inputs: tuple[Expression, ...]
    knot: float
    width: float

    def at(self, values: Values) -> Array:
        return np.maximum(1.0 - np.abs(values[0] - self.knot) / self.width, 0.0)


@dataclass(frozen=True, eq=False)
class AtPlace(Tent):
    """A Tent over the road position; `elsewhere` if the position is unknown, which an input below
    zero means."""

    elsewhere: float

    def at(self, values: Values) -> Array:
        return np.where(values[0] < 0.0, self.elsewhere, super().at(values))


@dataclass(frozen=True, eq=False)
class Interpolated(Pointwise):
    """Piecewise-linear function of the input through points (`knots`, `values`), constant beyond them."""

    inputs: tuple[Expression, ...]
    knots: tuple[float, ...]
    values: tuple[float, ...]

    def at(self, values: Values) -> Array:
        return np.interp(values[0], self.knots, self.values)


@dataclass(frozen=True, eq=False)
class Knot(OfRecordings):
    """A Tent in one recording."""

    inputs: tuple[Expression, ...]
    index: int
    knot: float
    width: float
    elsewhere: float

    def over(self, values: Values, e: Evidence) -> Array:
        tent = np.maximum(1.0 - np.abs(values[0] - self.knot) / self.width, 0.0)
        return np.where(e.record == self.index, tent, 0.0)


@dataclass(frozen=True, eq=False)
class InRecording(OfRecordings, Leaf):
    """One in the named recording (from `from_s` on), zero in others."""

    index: int
    from_s: float = 0.0
    elsewhere: float = 0.0

    def over(self, values: Values, e: Evidence) -> Array:
        return ((e.record == self.index) & (e["elapsed"] >= self.from_s)).astype(float)


@dataclass(frozen=True, eq=False)
class Rerun(OfRecordings, Leaf):
    """Change of the simulated acceleration if commands take another path; in a simulation CommandPath
    computes it."""

    path: str
    amount: float

    def signals(self) -> frozenset[str]:
        which = self.path.split("_")[1]
        return frozenset({"engine", "brake"} if which == "all" else {which})

    def over(self, values: Values, e: Evidence) -> Array:
        return e.rerun(self.path, self.amount)
