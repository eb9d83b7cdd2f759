"""The ideal follower: which speed suits a gap behind this leader."""

from __future__ import annotations

from typing import Any


def approach(far: Any, time_gap: Any, rate: float) -> tuple[Any, Any]:
    """Speed above the leader's (m/s) that suits a gap `far` (m) longer than the leader's speed asks for, and
    how it grows with `far` (1/s).

    Near the right gap it is far / time_gap, with which the time gap itself is right, whatever the leader
    does. Further off it is the speed that `rate` (m/s^2) takes back on the way that is left: following the
    time gap alone would brake to a stand behind a vehicle that cuts in. Where both meet they have one slope.
    numpy arrays and torch tensors alike.
    """
    knee = rate * time_gap**2
    most = (2 * rate * abs(far).clip(min=knee) - (rate * time_gap) ** 2) ** 0.5
    return most * (far / knee).clip(-1.0, 1.0), rate / most
