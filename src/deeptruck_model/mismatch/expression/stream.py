"""Expressions along a running simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.expression.nodes import Expression

Array = NDArray[np.float64]


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
