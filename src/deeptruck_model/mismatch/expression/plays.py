"""What has room to move before a force arrives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.expression.nodes import Expression
from deeptruck_model.mismatch.residual.evidence import Evidence

Array = NDArray[np.float64]


class Stepped(Expression):
    """A node that is computed step by step along recordings too, all of them side by side."""

    def over(self, values: Sequence[Array], e: Evidence) -> Array:
        longest = max(s.stop - s.start for s in e.stretches)
        rows = np.zeros((longest, len(e.stretches)))
        for k, s in enumerate(e.stretches):
            rows[: s.stop - s.start, k] = values[0][s.rows]
        memory = self.begin(len(e.stretches))
        for k, x in enumerate(rows):
            rows[k], memory = self.advance([x], memory, {}, e.dt)
        return np.concatenate([rows[: s.stop - s.start, k] for k, s in enumerate(e.stretches)])


@dataclass(frozen=True, eq=False)
class Play(Stepped):
    """The part of a force that turns a play instead of pulling: it drives the play against friction, from
    one end to the other, `reach` (force times s) apart, and all of it arrives at an end. A soft spring in it
    passes up to `holds` on before."""

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
