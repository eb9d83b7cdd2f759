"""The library: one record for each mechanism that the tool can name, in tables by subject."""

from deeptruck_model.mismatch.mechanisms import (
    air_tyres_road,
    brakes,
    commands,
    driveline,
    engine,
    engine_drag,
    load,
)
from deeptruck_model.mismatch.mechanisms.own import Library
from deeptruck_model.mismatch.mechanisms.record import Column, Curve, Form, Mechanism, Variant, variant
from deeptruck_model.mismatch.mechanisms.terms import (
    CandidateTerm,
    build,
    candidate_term,
    candidate_terms,
    confined,
    every_variant,
    merge,
)

LIBRARY = Library(
    m
    for table in (brakes, air_tyres_road, engine, engine_drag, driveline, load, commands)
    for m in table.MECHANISMS
)

__all__ = [
    "LIBRARY",
    "CandidateTerm",
    "Column",
    "Curve",
    "Form",
    "Mechanism",
    "Variant",
    "build",
    "candidate_term",
    "candidate_terms",
    "confined",
    "every_variant",
    "merge",
    "variant",
]
