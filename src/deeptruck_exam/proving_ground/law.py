"""What the seventh forms share: how they are registered, and a state that begins with the same numbers."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden

law = partial(hidden, forms="seventh")
unnamed = partial(law, name="unknown")


class Law(Hidden):
    """Each variable of the state at rest is said beside the class's name, in its unit."""

    rest: Mapping[str, float] = {}

    def __init_subclass__(cls, **rest: float) -> None:
        super().__init_subclass__()
        cls.rest = rest

    def start(self, batch: int) -> dict[str, Array]:
        return {name: np.full(batch, value) for name, value in self.rest.items()}
