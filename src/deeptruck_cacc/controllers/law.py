"""A law of following: from what is seen of leader and truck to the acceleration asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Seen:
    """What a law of following may use, each (batch,): SI; `integral` of the clipped gap error in m s."""

    leader_speed: Array
    speed: Array
    gap: Array
    target_gap: Array
    leader_acceleration: Array
    acceleration: Array
    integral: Array

    @property
    def gap_error(self) -> Array:
        """gap - v Tg, m."""
        return self.gap - self.target_gap


Law = Callable[[Seen], Array]
