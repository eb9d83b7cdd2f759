"""Load: mass that changes, and mass that moves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from deeptruck_model.mismatch.expression import Signal, Slosh
from deeptruck_model.mismatch.mechanisms.base import (
    Column,
    Mechanism,
)
from deeptruck_model.mismatch.mechanisms.over_time import (
    each_recording,
    from_each,
    from_then_on,
    in_each,
    spline_columns,
    splines,
)
from deeptruck_model.mismatch.mechanisms.symbols import (
    SIMULATED,
)
from deeptruck_model.mismatch.mechanisms.variants import Constants, FromMoment, PerRecording, Simple, Static
from deeptruck_model.mismatch.residual.evidence import Evidence

MASS = Signal("sensitivity:mass")
MOST_OF_MASS = 2.0  # to first order: a laden truck that is unloaded loses less


def _payloads(e: Evidence) -> Iterator[Simple]:
    """A load changes at a standstill or between recordings."""
    slow = e["speed"] < 1.0
    entering = np.flatnonzero(np.diff(slow.astype(int)) > 0) + 1
    points = sorted({s.start for s in e.stretches} | set(entering.tolist()))
    points = [p for p in points if 0.04 * len(e) < p < 0.96 * len(e)]
    yield from from_each(points[:: max(1, len(points) // 24)], e)
    if 2 < len(e.stretches) <= 40:
        yield each_recording(e)
    yield from splines(e, MASS, 0.5, quick=False)  # sprayed, spread or discharged on the way


def _payload(v: Simple) -> list[Column]:
    match v:
        case PerRecording():
            return [
                Column(MASS * here, 0.3, f"change[{name}]", "kg", per_mass=True, sign=0, most=MOST_OF_MASS)
                for name, here in in_each(v)
            ]
        case FromMoment():
            later = MASS * from_then_on(v)
            return [Column(later, 0.4, "change", "kg", per_mass=True, sign=0, most=MOST_OF_MASS)]
    return spline_columns(v, MASS, "change", "kg", sign=0, per_mass=True)


@dataclass(frozen=True)
class Swing(Constants):
    """One swinging mass."""

    frequency_hz: float
    damping: float


@dataclass(frozen=True)
class Modes(Constants):
    """A bore that runs to and fro: several frequencies side by side."""

    modes_hz: tuple[float, ...]
    damping: float


def _sloshes(e: Evidence) -> Iterator[Static]:
    for frequency_hz in (0.15, 0.2, 0.3, 0.4, 0.55, 0.75):
        for damping in (0.04, 0.12, 0.3):  # free surface to well baffled
            yield Static(Swing(frequency_hz, damping))
    yield Static(Modes((0.15, 0.25, 0.4, 0.6, 0.9, 1.3), 0.1))


def _slosh(v: Simple) -> list[Column]:
    match v.constants:
        case Modes(modes_hz, damping):
            return [
                Column(Slosh((SIMULATED,), hz, damping), 0.2, f"mass_share_at_{hz:g}_Hz") for hz in modes_hz
            ]
        case Swing(frequency_hz, damping):
            return [Column(Slosh((SIMULATED,), frequency_hz, damping), 0.3, "mass_share")]
    raise TypeError(f"{v!r} is no slosh")


MECHANISMS = (
    Mechanism(
        "payload_change",
        "m -> m + dm from one standstill or recording on, or dm(t) as it is discharged on the way",
        "the truck's mass changed between or within the recordings",
        ("sensitivity:mass",),
        ("recording", "time"),
        "definition; mass enters as in Gillespie eq. 2-9b",
        "accelerate with the same torque before and after loading",
        _payloads,
        _payload,
    ),
    Mechanism(
        "load_slosh",
        "x'' + 2 z w x' + w^2 x = -a;  F = m_s (w^2 x + 2 z w x' + a)",
        "a liquid or swinging load moves along the truck",
        ("simulated",),
        ("acceleration history",),
        "Abramson, NASA SP-106",
        "brake to a stop, and wait at constant speed afterwards",
        _sloshes,
        _slosh,
        prior=0.3,
    ),
)
