"""A force that comes and goes without a law: what every name for such a force has to be better than."""

from __future__ import annotations

from collections.abc import Iterator

from deeptruck_model.mismatch.expression import lift
from deeptruck_model.mismatch.mechanisms.base import (
    Column,
    Mechanism,
    Settings,
)
from deeptruck_model.mismatch.mechanisms.over_time import (
    slow_columns,
    slow_settings,
)
from deeptruck_model.mismatch.residual.evidence import Evidence

ANY, LARGEST = lift(1.0), 0.5  # m/s^2


def _settings(e: Evidence) -> Iterator[Settings]:
    for along in ("elapsed", "distance"):
        yield from slow_settings(e, ANY, LARGEST, along)


def _columns(s: Settings) -> list[Column]:
    return slow_columns(s, ANY, "force", "N", sign=0, per_mass=True)


UNNAMED = Mechanism(
    "unknown",
    "F = f(t)",
    "a force comes and goes as none of the known ones does",
    (),
    ("time", "distance along the road"),
    "",
    "drive the same stretch twice in either direction, at two speeds",
    _settings,
    _columns,
)
