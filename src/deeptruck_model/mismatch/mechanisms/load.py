"""Load: mass that changes, and mass that moves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from deeptruck_model.mismatch.expression import Signal, Slosh
from deeptruck_model.mismatch.mechanisms.base import (
    Column,
    Mechanism,
    Settings,
)
from deeptruck_model.mismatch.mechanisms.over_time import (
    each_recording,
    from_then_on,
    in_each,
    slow_columns,
    slow_settings,
)
from deeptruck_model.mismatch.mechanisms.symbols import (
    SIMULATED,
)
from deeptruck_model.mismatch.residual.evidence import Evidence

MASS = Signal("sensitivity:mass")
MOST_OF_MASS = 2.0  # to first order: a laden truck that is unloaded loses less


def _payload_settings(e: Evidence) -> Iterator[Settings]:
    """A load changes at a standstill or between recordings."""
    slow = e["speed"] < 1.0
    entering = np.flatnonzero(np.diff(slow.astype(int)) > 0) + 1
    points = sorted({s.start for s in e.stretches} | set(entering.tolist()))
    points = [p for p in points if 0.04 * len(e) < p < 0.96 * len(e)]
    points = points[:: max(1, len(points) // 24)]
    record, elapsed = e.record, e["elapsed"]
    for p in points:
        first, after = int(record[p]), float(elapsed[p])
        yield {"first": first, "after_s": after, "count": len(e.stretches), "trials": len(points)}
    if 2 < len(e.stretches) <= 40:
        yield each_recording(e)
    yield from slow_settings(e, MASS, 0.5, quick=False)  # sprayed, spread or discharged on the way


def _payload(s: Settings) -> list[Column]:
    if "each" in s:
        return [
            Column(MASS * here, 0.3, f"change[{name}]", "kg", per_mass=True, sign=0, most=MOST_OF_MASS)
            for name, here in in_each(s)
        ]
    if "knots" in s:
        return slow_columns(s, MASS, "change", "kg", sign=0, per_mass=True)
    return [Column(MASS * from_then_on(s), 0.4, "change", "kg", per_mass=True, sign=0, most=MOST_OF_MASS)]


def _slosh_settings(e: Evidence) -> Iterator[Settings]:
    for frequency_hz in (0.15, 0.2, 0.3, 0.4, 0.55, 0.75):
        for damping in (0.04, 0.12, 0.3):  # free surface to well baffled
            yield {"frequency_hz": frequency_hz, "damping": damping}
    yield {"modes_hz": [0.15, 0.25, 0.4, 0.6, 0.9, 1.3], "damping": 0.1}  # a bore that runs to and fro


def _slosh(s: Settings) -> list[Column]:
    if "modes_hz" in s:
        return [
            Column(Slosh((SIMULATED,), hz, s["damping"]), 0.2, f"mass_share_at_{hz:g}_Hz")
            for hz in s["modes_hz"]
        ]
    return [Column(Slosh((SIMULATED,), s["frequency_hz"], s["damping"]), 0.3, "mass_share")]


MECHANISMS = (
    Mechanism(
        "payload_change",
        "m -> m + dm from one standstill or recording on, or dm(t) as it is discharged on the way",
        "the truck's mass changed between or within the recordings",
        ("sensitivity:mass",),
        ("recording", "time"),
        "definition; mass enters as in Gillespie eq. 2-9b",
        "accelerate with the same torque before and after loading",
        _payload_settings,
        _payload,
        hidden=True,
    ),
    Mechanism(
        "load_slosh",
        "x'' + 2 z w x' + w^2 x = -a;  F = m_s (w^2 x + 2 z w x' + a)",
        "a liquid or swinging load moves along the truck",
        ("simulated",),
        ("acceleration history",),
        "Abramson, NASA SP-106",
        "brake to a stop, and wait at constant speed afterwards",
        _slosh_settings,
        _slosh,
        prior=0.3,
    ),
)
