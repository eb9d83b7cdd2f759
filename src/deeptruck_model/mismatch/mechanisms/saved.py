"""Variants of candidate terms as plain JSON values, and back: how a corrected simulator keeps its terms.

Each dataclass becomes a dictionary of its fields, with its class under "kind".
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import fields
from functools import cache
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from deeptruck_model.mismatch.mechanisms.variants import Constants, Variant

KIND = "kind"
Saved = Variant | Constants


def to_json(x: Saved) -> dict[str, Any]:
    """A variant or its constants as plain values."""
    return {KIND: type(x).__name__} | {f.name: _plain(getattr(x, f.name)) for f in fields(x)}  # type: ignore[arg-type]


def variant_of(saved: Any) -> Variant:
    """The variant that was saved. Raises ValueError, TypeError or KeyError for what `to_json` never wrote."""
    made = _made(saved)
    if not isinstance(made, Variant):
        raise ValueError(f"a {type(made).__name__} is no variant of a term")
    return made


def _plain(x: Any) -> Any:
    if isinstance(x, Saved):
        return to_json(x)
    return [_plain(item) for item in x] if isinstance(x, tuple) else x


def _made(saved: dict[str, Any]) -> Any:
    kind = _kinds()[saved[KIND]]
    values = {name: _value(x) for name, x in saved.items() if name != KIND}
    hints = _hints(saved[KIND])
    for name, x in values.items():
        if not _fits(x, hints[name]):
            raise ValueError(f"{x!r} is no {name} of a {kind.__name__}")
    return kind(**values)


def _value(x: Any) -> Any:
    if isinstance(x, dict):
        return _made(x)
    return tuple(_value(item) for item in x) if isinstance(x, list) else x


@cache
def _kinds() -> dict[str, type[Any]]:
    return {kind.__name__: kind for kind in (*_below(Variant), *_below(Constants), Constants)}


@cache
def _hints(kind: str) -> dict[str, Any]:
    return get_type_hints(_kinds()[kind])


def _below(kind: type[Any]) -> Iterator[type[Any]]:
    for each in kind.__subclasses__():
        yield each
        yield from _below(each)


def _fits(x: Any, hint: Any) -> bool:
    """Whether a value is of a type; numbers are finite."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return any(_fits(x, each) for each in inner)
    if origin is Literal:
        return x in inner
    if origin is tuple:
        if not isinstance(x, tuple):
            return False
        of = inner[:1] * len(x) if inner[1:] == (...,) else inner
        return len(x) == len(of) and all(map(_fits, x, of))
    if hint in (int, float) and isinstance(x, bool):
        return False
    if hint is float:
        return isinstance(x, int | float) and math.isfinite(x)
    return isinstance(x, hint)
