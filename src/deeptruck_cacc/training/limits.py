"""What settings of a training may be: refused before anything is driven or written."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from deeptruck_model.errors import InputError

Limits = Mapping[str, tuple[float, float]]
MOST_RATE = 1e30  # beyond, the optimiser's own numbers overflow


def check(config: Any, limits: Limits) -> None:
    """Raises InputError for a setting outside its (least, most)."""
    for name, (least, most) in limits.items():
        value = getattr(config, name)
        if not least <= value <= most:  # nor NaN
            reach = f"at least {least:g}" if math.isinf(most) else f"{least:g} to {most:g}"
            raise InputError(f"{name} is {value:g}; it must be {reach}")
