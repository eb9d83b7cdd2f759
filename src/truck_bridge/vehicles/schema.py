"""Schema of vehicle files; a violation gives one clear line."""

from __future__ import annotations

import difflib
from typing import Any

from truck_bridge.errors import InputError
from truck_bridge.j1939 import checksums, diagnostics


class Optional:
    """A key that may be absent."""

    def __init__(self, spec: Any) -> None:
        self.spec = spec


class OneOf:
    """A value from a list."""

    def __init__(self, *values: Any) -> None:
        self.values = values


class Number:
    """A number in a range."""

    def __init__(self, low: float, high: float) -> None:
        self.low, self.high = low, high


class Whole(Number):
    """A whole number in a range."""


class MapOf:
    """Any keys, with values of one kind."""

    def __init__(self, spec: Any) -> None:
        self.spec = spec


SECONDS = Number(0.001, 60)
ANY = Number(-1e6, 1e6)
ADDRESS = Number(0, 253)

LIMITS = {
    "speed": [ANY],
    "low": [ANY],
    "high": [ANY],
    "rate": Number(1e-3, 1e6),
    "fade": Number(1e-3, 1e6),
    "jerk": Number(1e-3, 1e9),
}
TRANSMIT = {
    "message": str,
    "to": str,
    "demand": str,
    "period": SECONDS,
    "phase": Number(0, 1),
    "check": OneOf(*checksums.KINDS),
    "active": MapOf(ANY),
    "release": MapOf(ANY),
    "idle_at_rest": Optional(bool),
    "start_from": Optional(str),
    "limits": LIMITS,
}
DEMAND = {"modes": [OneOf(1, 2, 3)], "longest": SECONDS, "period": [SECONDS]}
RECEIVE = {
    "message": Optional(str),
    "from": str,
    "period": SECONDS,
    "timeout": SECONDS,
    "check": Optional(OneOf(*checksums.KINDS)),
    "signals": MapOf(str),
    "range": Optional(MapOf([ANY])),
    "fastest": Optional(MapOf(Number(1e-6, 1e6))),
    "rises": Optional(MapOf(Number(1e-6, 1e6))),
    "still": Optional(MapOf(SECONDS)),
}
FAULTS = {
    "lamps": Optional([OneOf(*diagnostics.LAMPS)]),
    "codes": Optional([{"spn": Whole(1, 0x7FFFE), "fmi": Optional(Whole(0, 31))}]),
    "listen": Optional(Number(0, 60)),
}
TIMING = {  # s; what a controller may be late by is a few of its cycles, and no truck waits a minute for it
    "controller_timeout": Number(0.02, 0.5),
    "stall": Number(0.02, 0.5),
    "handover": Number(0.5, 10),
    "handover_scale": Number(0.05, 1),  # 1: rates are never raised
    "fade_longest": Number(0.5, 10),
    "persist": Number(0.05, 2),
    "slowing": Number(0.5, 5),
    "settle": Number(0.5, 10),
    "unexplained": Number(0.1, 5),
    "gear_change": Number(0.1, 10),
    "quiet": Number(0.1, 60),
    "releases": Whole(1, 20),
}
VEHICLE: dict[str, Any] = {
    "name": str,
    "truck": Optional(str),
    "dbc": Optional([str]),
    "interface": {
        "engine_unit": OneOf("N m", "percent"),
        "brake_unit": OneOf("percent", "m/s^2"),
        "grade": bool,
        "fuel": bool,
    },
    "bridge": {"address": ADDRESS, "identity": Number(0, (1 << 21) - 1)},
    "addresses": MapOf(ADDRESS),
    "command": {"engine": [ANY], "brake": [ANY]},
    "reference_torque": MapOf(Number(1, 1e5)),
    "driveline": Optional(
        {"rolling_radius": Number(0.1, 2), "final_drive": Number(0.5, 20), "tolerance": Number(0.01, 1)}
    ),
    "transmit": {"engine": TRANSMIT, "retarder": Optional(TRANSMIT), "brake": TRANSMIT},
    "demands": MapOf(MapOf(DEMAND)),
    "receive": MapOf(RECEIVE),
    "driver": MapOf(ANY),
    "forbidden": MapOf(ANY),
    "obeys": Optional(MapOf([ANY])),
    "follows": Optional(MapOf({"signal": str, "beyond": Number(-1e6, 1e6)})),
    "coasts": Optional(Number(0.3, 5)),
    "faults": Optional(FAULTS),
    "engage": {"speed": [ANY], "needs_lead": bool},
    "timing": Optional({key: Optional(spec) for key, spec in TIMING.items()}),
}
_PLAIN = {str: "string", bool: "boolean"}


def for_editors() -> dict[str, Any]:
    """The schema as a JSON Schema, by which editors check and complete a vehicle file while it is written.

    Errors that involve several entries, such as an address that no controller has, are found only by `load`.
    """
    return {"$schema": "http://json-schema.org/draft-07/schema#", "title": "vehicle file", **_schema(VEHICLE)}


def _schema(spec: Any) -> dict[str, Any]:
    if isinstance(spec, dict):
        required = [key for key, inner in spec.items() if not isinstance(inner, Optional)]
        properties = {key: _schema(inner) for key, inner in spec.items()}
        found = {"type": "object", "properties": properties, "additionalProperties": False}
        return {**found, "required": required} if required else found
    if isinstance(spec, Optional):
        return _schema(spec.spec)
    if isinstance(spec, MapOf):
        return {"type": "object", "additionalProperties": _schema(spec.spec)}
    if isinstance(spec, list):
        return {"type": "array", "items": _schema(spec[0])}
    if isinstance(spec, OneOf):
        return {"enum": list(spec.values)}
    if isinstance(spec, Number):
        kind = "integer" if isinstance(spec, Whole) else "number"
        return {"type": kind, "minimum": spec.low, "maximum": spec.high}
    return {"type": _PLAIN[spec]}


def check(value: Any, spec: Any, where: str) -> None:
    """Raise InputError, naming the place, if a value does not satisfy its spec."""
    if isinstance(spec, dict):
        _check_mapping(value, spec, where)
    elif isinstance(spec, MapOf):
        if not isinstance(value, dict):
            raise InputError(f"{where} must be a mapping, not {value!r}")
        for key, item in value.items():
            check(item, spec.spec, f"{where}.{key}")
    elif isinstance(spec, list):
        if not isinstance(value, list):
            raise InputError(f"{where} must be a list, not {value!r}")
        for number, item in enumerate(value):
            check(item, spec[0], f"{where}[{number}]")
    elif isinstance(spec, OneOf):
        if value not in spec.values:
            raise InputError(f"{where} is {value!r}; it must be one of {', '.join(map(str, spec.values))}")
    elif isinstance(spec, Number):
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not spec.low <= value <= spec.high
        ):
            raise InputError(f"{where} is {value!r}; it must be a number from {spec.low:g} to {spec.high:g}")
        if isinstance(spec, Whole) and value != int(value):
            raise InputError(f"{where} is {value!r}; it must be a whole number")
    elif not isinstance(value, spec):
        raise InputError(f"{where} is {value!r}; it must be of type {spec.__name__}")


def _check_mapping(value: Any, spec: dict[str, Any], where: str) -> None:
    if not isinstance(value, dict):
        raise InputError(f"{where} must be a mapping, not {value!r}")
    for key in value:
        if key not in spec:
            guess = difflib.get_close_matches(str(key), spec, n=1)
            hint = f"did you mean '{guess[0]}'?" if guess else f"known: {', '.join(spec)}"
            raise InputError(f"{where}: unknown key '{key}'; {hint}")
    for key, inner in spec.items():
        if key in value:
            check(
                value[key],
                inner.spec if isinstance(inner, Optional) else inner,
                f"{where}: {key}" if ":" not in where else f"{where}.{key}",
            )
        elif not isinstance(inner, Optional):
            raise InputError(f"{where}: key '{key}' is missing")
