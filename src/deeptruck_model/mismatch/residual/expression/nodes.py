"""Nodes for arithmetic on named signals, from which every formula is built."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_model.mismatch.residual.evidence import Evidence

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
        """Values over stacked recordings, (n,); memory is reset at the start of each recording."""
        return rows_of([self], e)[0]

    def over(self, values: Sequence[Array], e: Evidence) -> Array:
        """Values over stacked recordings, given the values of the inputs."""
        raise NotImplementedError

    def signals(self) -> frozenset[str]:
        """Names of all signals in it."""
        return frozenset[str]().union(*(x.signals() for x in self.inputs))

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
    """A named signal. Where it is not known, its value is `missing`, in a simulation `simulated`."""

    name: str
    missing: float = 0.0
    simulated: float | None = None

    def signals(self) -> frozenset[str]:
        return frozenset({self.name})

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
        return FUNCTIONS[self.function](*values), memory  # a stream ignores what is no number
