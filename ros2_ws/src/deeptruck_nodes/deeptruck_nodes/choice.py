"""Parser of one-line descriptions of leaders and roads: KIND or KIND:name=value,name=value."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any, TypeVar

from deeptruck_core.errors import InputError

T = TypeVar("T")


def parse(text: str, kinds: Mapping[str, type[T]], what: str) -> T:
    """Build the dataclass described by `text`, KIND:NAME=VALUE,NAME=VALUE...; tuples of numbers are written
    A/B/C.

    Raises InputError for an unknown kind or name, a value that is not a number, or one that the dataclass
    refuses.
    """
    kind, _, rest = text.partition(":")
    if kind not in kinds:
        raise InputError(f"{what} '{text}': there is no '{kind}'; known: {', '.join(kinds)}")
    fields = {field.name: field for field in dataclasses.fields(kinds[kind])}  # type: ignore[arg-type]
    values: dict[str, Any] = {}
    for part in filter(None, rest.split(",")):
        name, equals, value = part.partition("=")
        if not equals or name not in fields:
            raise InputError(
                f"{what} '{text}': '{part}' is not one of {', '.join(f'{n}=' for n in fields) or 'none'}"
            )
        values[name] = _value(text, what, name, value, str(fields[name].type))
    try:
        return kinds[kind](**values)
    except TypeError:
        missing = [n for n, f in fields.items() if f.default is dataclasses.MISSING and n not in values]
        raise InputError(f"{what} '{text}' needs {', '.join(f'{n}=' for n in missing)}") from None


def _value(text: str, what: str, name: str, value: str, kind: str) -> Any:
    if kind == "str":
        return value
    try:
        if kind == "int":
            return int(value)
        numbers = tuple(float(part) for part in value.split("/"))
    except ValueError:
        raise InputError(f"{what} '{text}': {name}={value} is not a number") from None
    if not all(math.isfinite(number) for number in numbers) or (kind == "float" and len(numbers) != 1):
        raise InputError(f"{what} '{text}': {name}={value} is not a finite number")
    return numbers[0] if kind == "float" else numbers


def require(condition: bool, what: str) -> None:
    """Raise InputError with `what` unless the condition holds."""
    if not condition:
        raise InputError(what)
