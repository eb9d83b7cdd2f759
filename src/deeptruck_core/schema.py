"""JSON Schemas of the files that users write: checked on loading by jsonschema, and used by editors.

`description` says what a key means, `errorMessage` how to mend what does not fit; editors show both.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from deeptruck_core.errors import InputError
from deeptruck_core.reading import near, plain

Schema = dict[str, Any]
DRAFT = "http://json-schema.org/draft-07/schema#"  # the one that editors know best
TEXT: Schema = {"type": "string"}
SWITCH: Schema = {"type": "boolean"}
NAME: Schema = {"type": ["string", "number"]}  # of a column, as YAML reads it
LONGEST = 500  # characters of a message, which may quote what a damaged file holds


def number(low: float, high: float) -> Schema:
    return {"type": "number", "minimum": low, "maximum": high}


def whole(low: int, high: int) -> Schema:
    return {"type": "integer", "minimum": low, "maximum": high}


def keys(needed: Schema, optional: Schema | None = None, cure: str = "") -> Schema:
    """A mapping of these keys and no others."""
    found = {"type": "object", "properties": {**needed, **(optional or {})}, "additionalProperties": False}
    return found | ({"required": [*needed]} if needed else {}) | ({"errorMessage": cure} if cure else {})


def mapping(value: Schema) -> Schema:
    """A mapping of any names."""
    return {"type": "object", "additionalProperties": value}


def array(item: Schema) -> Schema:
    return {"type": "array", "items": item}


def means(description: str, schema: Schema, cure: str = "") -> Schema:
    """A schema with what it means, and how to mend what does not fit it."""
    return {**schema, "description": description} | ({"errorMessage": cure} if cure else {})


def check(data: Any, schema: Schema, where: str) -> None:
    """Raises InputError, naming `where` and the key, if `data` does not fit the schema."""
    # a misspelt key is also a missing one: the misspelling comes first
    found = min(_misfits(_validator()(schema).iter_errors(data)), default=None)
    if found is not None:
        raise InputError(plain(": ".join(filter(None, (where, *found[1:]))), LONGEST))


@functools.cache
def _validator() -> Any:
    from jsonschema import Draft7Validator, validators

    checker = Draft7Validator.TYPE_CHECKER.redefine_many(
        {
            "number": lambda _, x: (
                isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x)
            ),
            "object": lambda _, x: isinstance(x, Mapping),
        }
    )
    return validators.extend(Draft7Validator, type_checker=checker)


def _misfits(errors: Iterable[Any]) -> Iterator[tuple[int, str, str]]:
    """Rank, place and text of each error."""
    for error in errors:
        cure, unknown = error.schema.get("errorMessage"), error.validator == "additionalProperties"
        if error.validator == "anyOf" and cure is None:  # the first form is the usual one
            yield from _misfits(one for one in error.context if one.schema_path[0] == 0)
            continue
        text = str(error.message)
        if unknown:
            known = [*error.schema["properties"]]
            key = next(str(key) for key in error.instance if key not in known)
            text = f"unknown key '{key}'; {near(key, known)}"
        elif error.validator == "required":
            key = next(key for key in error.validator_value if key not in error.instance)
            text = f"'{key}' is missing"
            cure = cure or error.schema.get("properties", {}).get(key, {}).get("errorMessage")
        elif error.validator == "type" and error.instance is None:
            text = "is empty"
        elif error.validator in ("anyOf", "not"):
            text = f"{plain(repr(error.instance), 80)} does not fit"
        place = ".".join(map(str, error.absolute_path))
        yield 1 - unknown, place, "; ".join(filter(None, (text, cure)))
