"""By which words and ranges a number in a bag or table is taken for one of our channels."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

COMMANDED = frozenset((  # anywhere in a topic, type or field: what is asked for, not what was measured
    "cmd", "cmds", "command", "commands", "commanded", "target", "desired", "setpoint", "setpoints", "set",
    "reference", "ref", "request", "requested", "req", "demand", "demanded", "goal", "control", "ctrl",
    "planned", "planning", "plan", "trajectory", "predicted", "recommended", "advised", "nominal", "cruise",
))  # fmt: skip
STATISTIC = frozenset((  # of a number, not the number
    "limit", "limits", "max", "min", "maximum", "minimum", "average", "avg", "mean", "total", "error",
    "delta", "difference", "accuracy", "uncertainty", "variance", "std", "valid", "validity", "quality",
    "avail", "available", "timeout", "fault",
))  # fmt: skip
LEADER = frozenset(("lead", "leader", "front", "preceding", "ahead", "radar"))


@dataclass(frozen=True)
class Words:
    """`any_of`: sets of words of which one must be there whole; `none_of`: words that stand for others."""

    any_of: tuple[frozenset[str], ...]
    none_of: frozenset[str]


def _words(any_of: str, none_of: str = "", more: frozenset[str] = frozenset()) -> Words:
    return Words(
        tuple(frozenset(one.split()) for one in any_of.split(",")), frozenset(none_of.split()) | more
    )


BY_WORDS: dict[str, Words] = {
    "speed": _words(
        "speed,velocity,vel,vx",
        "engine motor shaft turbo fan pump angular yaw heading lateral vertical wind relative rel",
        STATISTIC,
    ),
    "acceleration": _words(
        "acceleration,accel,acc,ax",
        "pedal throttle brake brakes angular lateral vertical gravity relative rel",
        STATISTIC | LEADER,
    ),
    "engine_command": _words(
        "throttle,accelerator,accel pedal,gas pedal,gas,engine command,engine cmd,engine request,"
        "torque request,torque requested,torque command,torque cmd,torque demand",
        "brake brakes retarder steering exhaust temperature temp pressure min max limit",
    ),
    "brake_command": _words(
        "brake,brakes,xbr,deceleration request", "parking temperature temp wear lamp light throttle torque"
    ),
    "grade": _words("grade,slope,gradient,incline,inclination,pitch", "rate angular gear"),
    "fuel_rate": _words("fuel", "level tank temperature temp pressure total economy"),
    "gear": _words("gear", "ratio", STATISTIC),
    "engine_speed": _words("engine speed,engine rpm,rpm", "wheel turbo fan", STATISTIC),
    "engine_torque": _words("torque", "brake steering wheel", STATISTIC),
    "elevation": _words("elevation,altitude,alt"),
    "gap": _words("gap,distance,headway,range", "travelled traveled trip total time rate min max"),
    "leader_speed": _words(
        ",".join(f"{who} {what}" for who in sorted(LEADER) for what in ("speed", "velocity", "vel")),
        "relative rel rate wheel axle tire tyre left right",
        STATISTIC,
    ),
    "ambient_temperature": _words(
        "ambient temperature,outside temperature,air temperature,ambient temp,outside temp,ambient",
        "intake charge manifold",
    ),
    "latitude": _words("latitude,lat"),
    "longitude": _words("longitude,lon,lng"),
}
UNIT_WORDS = {
    "kmh": "km/h", "kph": "km/h", "mph": "mph", "mps": "m/s", "rpm": "rpm", "percent": "percent",
    "pct": "percent", "percentage": "percent", "ratio": "ratio", "nm": "N m", "bar": "bar", "kpa": "kPa",
    "psi": "psi", "deg": "deg", "rad": "rad", "lph": "l/h",
}  # fmt: skip
_DECELERATION = {"deceleration", "decel", "acceleration", "xbr"}
_PITCH = {"pitch", "incline", "inclination"}
_BY_RANGE: dict[str, tuple[tuple[float, str], ...]] = {  # the first unit in which so much is plausible
    "speed": ((45.0, "m/s"), (160.0, "km/h")),
    "leader_speed": ((45.0, "m/s"), (160.0, "km/h")),
    "acceleration": ((15.0, "m/s^2"),),
    "engine_command": ((1.05, "ratio"), (105.0, "percent"), (6000.0, "N m")),
    "brake_command": ((1.05, "ratio"), (15.0, ""), (105.0, "percent")),  # up to 15: bar, m/s^2 or percent
    "brake pressure": ((15.0, "bar"), (1500.0, "kPa")),
    "brake deceleration": ((15.0, "m/s^2"),),
    "grade": ((0.4, "ratio"), (40.0, "percent")),
    "pitch": ((0.4, "rad"), (25.0, "deg")),
    "gear": ((24.0, "1"),),
    "engine_speed": ((300.0, "rad/s"), (7000.0, "rpm")),
    "engine_torque": ((130.0, ""), (6000.0, "N m")),  # up to 130: percent of a torque that nobody names
    "elevation": ((6000.0, "m"),),
    "gap": ((500.0, "m"),),
    "ambient_temperature": ((70.0, "degC"), (345.0, "K")),
    "latitude": ((90.0, "deg"),),
    "longitude": ((180.0, "deg"),),
}


def words(text: str) -> frozenset[str]:
    """The words of a name in any spelling: brake_cmd, BrakeCmd and /brake/cmd are the same."""
    return frozenset(word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", text))


def unit_by_range(channel: str, named: frozenset[str], largest: float) -> str:
    """The unit in which values up to `largest` are plausible; '' where none is, or several are."""
    kind = channel
    if channel == "brake_command":
        kind = "brake pressure" if "pressure" in named else kind
        kind = "brake deceleration" if _DECELERATION & named else kind
    elif channel == "grade" and _PITCH & named:
        kind = "pitch"
    limits = _BY_RANGE.get(kind, ())
    return next((unit for most, unit in limits if math.isfinite(largest) and largest <= most), "")
