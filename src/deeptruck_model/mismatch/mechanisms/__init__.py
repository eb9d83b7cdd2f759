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
    distinct,
    held_steady,
    is_time_varying,
    merge,
)
from deeptruck_model.mismatch.mechanisms.laws import LATE_SENSOR, LAW, acts_by, law_signal, laws, leans_on
from deeptruck_model.mismatch.mechanisms.over_time import UNNAMED
from deeptruck_model.mismatch.mechanisms.own_forms import OWN
from deeptruck_model.mismatch.mechanisms.variants import Constants, Variant

LIBRARY: dict[str, Mechanism] = {
    m.effect: m
    for room in (brakes, air_and_tyres, road, engine, engine_drag, driveline, load, commands)
    for m in room.MECHANISMS
}

KNOWN = LIBRARY | {LAW.effect: LAW}  # all that can be simulated

__all__ = [
    "KNOWN",
    "LATE_SENSOR",
    "LIBRARY",
    "OWN",
    "UNNAMED",
    "CandidateTerm",
    "Column",
    "Constants",
    "Mechanism",
    "Variant",
    "acts_by",
    "build",
    "candidate_term",
    "candidate_terms",
    "distinct",
    "held_steady",
    "is_time_varying",
    "law_signal",
    "laws",
    "leans_on",
    "merge",
]
