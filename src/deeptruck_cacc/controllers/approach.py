"""The speed with which an ideal follower closes a gap."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np


def approach(far: Any, time_gap: Any, rate: float) -> tuple[Any, Any]:
    """Speed above the leader's (m/s) for a gap that is `far` (m) too long, and its derivative with respect to
    `far` (1/s).

    Near the desired gap it is far / time_gap, which keeps the time gap whatever the leader does. Farther away
    it is the speed from which a deceleration of `rate` (m/s^2) stops closing at the desired gap: a law on the
    time gap alone would brake to a stop behind a vehicle that cuts in. The two parts join with equal slope.
    Accepts numpy arrays and torch tensors.
    """
    knee = rate * time_gap**2
    most = (2 * rate * abs(far).clip(min=knee) - (rate * time_gap) ** 2) ** 0.5
    return most * (far / knee).clip(-1.0, 1.0), rate / most


def cruise(seen: Mapping[str, Any], set_speed: float) -> dict[str, Any]:
    """The leader that a policy follows so as to drive no faster than `set_speed` (m/s).

    It is no faster than that, and no farther than the wanted gap is then. `seen` has leader_speed (m/s), gap
    (m) and target_time_gap (s), each (batch,).
    """
    return {
        "leader_speed": np.minimum(seen["leader_speed"], set_speed),
        "gap": np.minimum(seen["gap"], seen["target_time_gap"] * set_speed),
    }
