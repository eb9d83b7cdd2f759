"""The library: every mechanism the tool can name."""

from deeptruck_model.mismatch.mechanisms import (
    air_and_tyres,
    brakes,
    commands,
    driveline,
    engine,
    engine_drag,
    load,
    road,
)
from deeptruck_model.mismatch.mechanisms.base import (
    CandidateTerm,
    Column,
    Mechanism,
    build,
    candidate_term,
    candidate_terms,
    is_time_varying,
    merge,
)
from deeptruck_model.mismatch.mechanisms.own_forms import OWN
from deeptruck_model.mismatch.mechanisms.variants import Constants, Variant

LIBRARY: dict[str, Mechanism] = {
    m.effect: m
    for room in (brakes, air_and_tyres, road, engine, engine_drag, driveline, load, commands)
    for m in room.MECHANISMS
}

__all__ = [
    "LIBRARY",
    "OWN",
    "CandidateTerm",
    "Column",
    "Constants",
    "Mechanism",
    "Variant",
    "build",
    "candidate_term",
    "candidate_terms",
    "is_time_varying",
    "merge",
]
