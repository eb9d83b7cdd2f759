"""The cells in which time is counted: speed x acceleration x grade."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SPEED_EDGES: Array = np.linspace(0.0, 40.0, 21)  # m/s
ACCELERATION_EDGES: Array = np.linspace(-10.0, 3.0, 53)  # m/s^2; no tyre of a truck brakes harder
GRADE_EDGES: Array = np.linspace(-0.10, 0.10, 21)  # ratio


class Counted(Protocol):
    """What is drawn: `seconds` (speed, acceleration, grade), the last grade cell without a grade; a summary
    of each recording; and their length together, s."""

    @property
    def seconds(self) -> Array: ...
    @property
    def recordings(self) -> Sequence[dict[str, Any]]: ...
    @property
    def duration_s(self) -> float: ...
