"""Converts variants to JSON values and back, to store the terms of a corrected simulator."""

from __future__ import annotations

import math
from typing import Any

from deeptruck_core import json_data
from deeptruck_model.mismatch.mechanisms.courses import ALWAYS, COURSES, Course
from deeptruck_model.mismatch.mechanisms.record import Curve, Mechanism, Variant

CURVE = {"at": tuple, "scale": float}
RETIRED = ("moments", "alternatives")  # of courses, which earlier versions saved


def to_json(v: Variant) -> dict[str, Any]:
    """A variant as JSON values."""
    course = (
        {}
        if v.course == ALWAYS
        else {"course": {"kind": type(v.course).__name__, **json_data.to_json(v.course)}}
    )
    return {"form": v.form, "constants": dict(v.constants), **course}


def variant_of(mechanism: Mechanism, saved: Any) -> Variant:
    """The variant of a mechanism from its JSON values. Raises ValueError, TypeError or KeyError if they are
    invalid."""
    form = mechanism.forms[saved["form"]]
    words = {} if isinstance(form, Curve) else form.words
    constants = {name: _tuple(x) for name, x in saved["constants"].items()}
    for name, x in constants.items():
        if not (x in words[name] if name in words else _is_number(x)):
            raise ValueError(f"{x!r} is no {name} of {mechanism.effect}")
    if isinstance(form, Curve):
        if {name: type(x) for name, x in constants.items()} != CURVE or constants["scale"] <= 0:
            raise ValueError(f"{constants} are no knots of a curve")
    else:
        form.made(constants)
    course = _course(saved["course"]) if "course" in saved else ALWAYS
    return Variant(saved["form"], tuple(constants.items()), course)


def _course(saved: dict[str, Any]) -> Course:
    kind, saved = COURSES[saved["kind"]], {name: x for name, x in saved.items() if name not in RETIRED}
    course = json_data.from_json(kind, saved)
    if saved.keys() != {"kind", *vars(course)} or any(x != x for x in vars(course).values()):
        raise ValueError(f"{saved} is no {kind.__name__}")
    return course


def _tuple(x: Any) -> Any:
    return tuple(_tuple(item) for item in x) if isinstance(x, list) else x


def _is_number(x: Any) -> bool:
    """Whether it is a finite number, or consists of such numbers."""
    if isinstance(x, tuple):
        return all(map(_is_number, x))
    return isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x)
