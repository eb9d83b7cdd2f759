"""How strong a force is where it acts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOSTLY = 0.6  # of the time, beyond which a force is no event


def acts(force: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Where a force (n,) acts: a third of nearly its largest, or more."""
    large = np.abs(force)
    return large > 0.3 * float(np.quantile(large, 0.995)) + 1e-9


@dataclass(frozen=True)
class Strength:
    """The mean of a force in `unit` while it acts, or its rms where it goes forward and back."""

    value: float
    unit: str
    one_way: bool
    share_of_time: float

    @property
    def mostly(self) -> bool:
        """Whether it acts so much of the time that it is no event."""
        return self.share_of_time > MOSTLY

    def to_json(self) -> dict[str, Any]:
        """`strength` of an entry of `findings`."""
        rounded = {"value": float(f"{self.value:.4g}"), "share_of_time": round(self.share_of_time, 3)}
        return vars(self) | rounded

    @staticmethod
    def read(entry: Mapping[str, Any] | None) -> Strength | None:
        """From verdict.json; None where a finding has none."""
        return None if entry is None else Strength(**entry)
