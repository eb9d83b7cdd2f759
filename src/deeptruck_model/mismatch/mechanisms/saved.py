"""Variants as plain JSON values, and back: how a corrected simulator keeps its terms."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any, get_args, get_origin, get_type_hints

from deeptruck_model.mismatch.mechanisms.courses import ALWAYS, COURSES, Course
from deeptruck_model.mismatch.mechanisms.record import Curve, Mechanism, Variant

CURVE = {"at": tuple, "scale": float}


def to_json(v: Variant) -> dict[str, Any]:
    """A variant as plain values."""
    course = {} if v.course == ALWAYS else {"course": {"kind": type(v.course).__name__, **asdict(v.course)}}
    return {"form": v.form, "constants": dict(v.constants), **course}


def variant_of(mechanism: Mechanism, saved: Any) -> Variant:
    """The variant of a mechanism that was saved. Raises ValueError, TypeError or KeyError for any other."""
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
    kind = COURSES[saved["kind"]]
    values = {name: _tuple(x) for name, x in saved.items() if name != "kind"}
    hints = get_type_hints(kind)
    for name, x in values.items():
        if not _fits(x, hints[name]):
            raise ValueError(f"{x!r} is no {name} of a {kind.__name__}")
    return kind(**values)


def _tuple(x: Any) -> Any:
    return tuple(_tuple(item) for item in x) if isinstance(x, list) else x


def _is_number(x: Any) -> bool:
    """Whether it is a finite number, or made of such."""
    if isinstance(x, tuple):
        return all(map(_is_number, x))
    return isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x)


def _fits(x: Any, hint: Any) -> bool:
    """Whether a value is of a type, as those of a course are; numbers are finite."""
    if get_origin(hint) is tuple:
        return isinstance(x, tuple) and all(_fits(item, get_args(hint)[0]) for item in x)
    if choices := get_args(hint):
        return x in choices or any(_fits(x, each) for each in choices if isinstance(each, type))
    if hint is float:
        return _is_number(x) and not isinstance(x, tuple)
    return isinstance(x, hint) and (hint is bool or not isinstance(x, bool))
