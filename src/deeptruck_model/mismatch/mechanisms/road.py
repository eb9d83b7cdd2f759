"""The road: slope and surface, as profiles along the distance driven."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from deeptruck_model.mismatch.evidence import GRAVITY, Evidence
from deeptruck_model.mismatch.expression import InRecording, Tent
from deeptruck_model.mismatch.mechanisms.base import DISTANCE, Column, Mechanism, Settings, share_out

MOST_KNOTS = 80


def _settings(e: Evidence) -> Iterator[Settings]:
    lengths = [float(np.ptp(e["distance"][s.rows])) for s in e.stretches]
    for knot_m in (100.0, 250.0, 600.0):
        yield {"knot_m": knot_m, "knots": share_out(lengths, knot_m, MOST_KNOTS)}


def _profile(s: Settings) -> Iterator[tuple[str, InRecording, Tent]]:
    for i, count in enumerate(s["knots"]):
        for k in range(count):
            yield (
                f"[{i}, {k * s['knot_m']:.0f} m]",
                InRecording(i),
                Tent((DISTANCE,), k * s["knot_m"], s["knot_m"]),
            )


def _grade(s: Settings) -> list[Column]:
    return [
        Column(-(here * tent) * GRAVITY, 0.02, f"grade{at}", "ratio", sign=0)
        for at, here, tent in _profile(s)
    ]


def _surface(s: Settings) -> list[Column]:
    return [Column(-(here * tent), 0.04, f"force{at}", "N", per_mass=True) for at, here, tent in _profile(s)]


MECHANISMS = (
    Mechanism(
        "road_grade",
        "F = -m g s(x)",
        "the road has a slope the simulator does not know",
        ("distance",),
        ("distance along the road",),
        "definition of grade",
        "drive the same stretch in both directions",
        _settings,
        _grade,
        hidden=True,
        unlikely_with="grade",
    ),
    Mechanism(
        "road_surface",
        "F = -m c(x), c >= 0",
        "stretches of the road roll harder, whichever way they are driven",
        ("distance",),
        ("distance along the road",),
        "rolling resistance of road textures: MIRIAM project",
        "drive the same stretch in both directions",
        _settings,
        _surface,
        hidden=True,
        prior=0.05,  # without a second pass it is any drag that comes and goes
    ),
)
