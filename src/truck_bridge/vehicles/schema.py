"""JSON Schema of vehicle files: what they are checked by on loading, and what editors know of them."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterator
from typing import Any

from truck_bridge.errors import InputError
from truck_bridge.j1939 import checksums, diagnostics

Schema = dict[str, Any]


def _number(low: float, high: float) -> Schema:
    return {"type": "number", "minimum": low, "maximum": high}


def _whole(low: int, high: int) -> Schema:
    return {"type": "integer", "minimum": low, "maximum": high}


def _keys(needed: Schema, optional: Schema | None = None) -> Schema:
    properties = {**needed, **(optional or {})}
    return {
        "type": "object", "properties": properties, "required": [*needed], "additionalProperties": False
    }  # fmt: skip


def _any(value: Schema) -> Schema:
    return {"type": "object", "additionalProperties": value}


def _list(item: Schema) -> Schema:
    return {"type": "array", "items": item}


TEXT, SWITCH = {"type": "string"}, {"type": "boolean"}
VALUE, POSITIVE, RATE = _number(-1e6, 1e6), _number(1e-6, 1e6), _number(1e-3, 1e6)
SECONDS, ADDRESS = _number(0.001, 60), _whole(0, 253)
CHECK = {"enum": [*checksums.KINDS]}

LIMITS = _keys(
    {
        **{name: _list(VALUE) for name in ("speed", "low", "high")},
        "rate": RATE,
        "fade": RATE,
        "jerk": _number(1e-3, 1e9),
    }
)
TRANSMIT = _keys(
    {
        **dict.fromkeys(("message", "to", "demand"), TEXT),
        "period": SECONDS,
        "phase": _number(0, 1),
        "check": CHECK,
        "active": _any(VALUE),
        "release": _any(VALUE),
        "limits": LIMITS,
    },
    {"idle_at_rest": SWITCH, "start_from": TEXT, "holds_beyond": VALUE},
)
DEMAND = _keys({"modes": _list({"enum": [1, 2, 3]}), "longest": SECONDS, "period": _list(SECONDS)})
RECEIVE = _keys(
    {"from": TEXT, "period": SECONDS, "timeout": SECONDS, "signals": _any(TEXT)},
    {
        "message": TEXT,
        "check": CHECK,
        "range": _any(_list(VALUE)),
        "fastest": _any(POSITIVE),
        "rises": _any(POSITIVE),
        "still": _any(SECONDS),
    },
)
CODE = _keys({"spn": _whole(1, 0x7FFFE)}, {"fmi": _whole(0, 31)})
FAULTS = {
    "lamps": _list({"enum": [*diagnostics.LAMPS]}),
    "codes": _list(CODE),
    "listen": _number(0, 60),
}
TIMING = {  # s; what a controller may be late by is a few of its cycles, and no truck waits a minute for it
    "controller_timeout": _number(0.02, 0.5),
    "stall": _number(0.02, 0.5),
    "handover": _number(0.5, 10),
    "handover_scale": _number(0.05, 1),  # 1: rates are never raised
    "stands": _number(1, 600),
    "fade_longest": _number(0.5, 10),
    "blind": _number(1, 60),
    "persist": _number(0.05, 2),
    "slowing": _number(0.5, 5),
    "settle": _number(0.5, 10),
    "weak": _number(0.5, 10),
    "answer": _number(0.5, 5),
    "unexplained": _number(0.1, 5),
    "gear_change": _number(0.1, 10),
    "quiet": _number(0.1, 60),
    "releases": _whole(1, 20),
}
INTERFACE = {
    "engine_unit": {"enum": ["N m", "percent"]},
    "brake_unit": {"enum": ["percent", "m/s^2"]},
    "grade": SWITCH,
    "fuel": SWITCH,
}
DRIVELINE = {
    "rolling_radius": _number(0.1, 2),
    "final_drive": _number(0.5, 20),
    "tolerance": _number(0.01, 1),
}
VEHICLE: Schema = {
    "$schema": "http://json-schema.org/draft-07/schema#",
    "title": "vehicle file",
    **_keys(
        {
            "name": TEXT,
            "interface": _keys(INTERFACE),
            "bridge": _keys({"address": ADDRESS, "identity": _whole(0, (1 << 21) - 1)}),
            "addresses": _any(ADDRESS),
            "command": _keys({"engine": _list(VALUE), "brake": _list(VALUE)}),
            "reference_torque": _any(_number(1, 1e5)),
            "transmit": _keys({"engine": TRANSMIT, "brake": TRANSMIT}, {"retarder": TRANSMIT}),
            "demands": _any(_any(DEMAND)),
            "receive": _any(RECEIVE),
            "driver": _any(VALUE),
            "forbidden": _any(VALUE),
            "engage": _keys({"speed": _list(VALUE), "needs_lead": SWITCH}),
        },
        {
            "truck": TEXT,
            "dbc": _list(TEXT),
            "driveline": _keys(DRIVELINE),
            "obeys": _any(_list(VALUE)),
            "follows": _any(_keys({"signal": TEXT, "beyond": VALUE})),
            "coasts": _number(0.3, 5),
            "set_speed": _number(1, 50),
            "faults": _keys({}, FAULTS),
            "timing": _keys({}, TIMING),
        },
    ),
}


def check(data: Any, where: str) -> None:
    """Raises InputError, naming file and place, if the content of a vehicle file does not fit the schema.

    Errors that involve several entries, such as an address that no controller has, are found by `load`.
    """
    from jsonschema import Draft7Validator, validators

    finite = Draft7Validator.TYPE_CHECKER.redefine(
        "number", lambda _, x: isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x)
    )
    kind = validators.extend(Draft7Validator, type_checker=finite)
    # a misspelt key is also a missing one: the misspelling comes first
    found = min(_errors(kind(VEHICLE).iter_errors(data)), default=None)
    if found is not None:
        raise InputError(": ".join((where, *found[1:])))


def _errors(errors: Iterator[Any]) -> Iterator[tuple[int, str, str]]:
    """Rank, place and text of each error."""
    for error in errors:
        text = " ".join(str(error.message).split())
        unknown = error.validator == "additionalProperties"
        if unknown:
            known = error.schema["properties"]
            key = next(key for key in error.instance if key not in known)
            near = difflib.get_close_matches(str(key), known, n=1)
            hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(known)}"
            text = f"unknown key '{key}'; {hint}"
        yield 1 - unknown, ".".join(map(str, error.absolute_path)) or "file", text
