"""Words and ranges by which a number in a bag or table is recognised as one of our channels."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass

COMMANDED = frozenset((  # anywhere in a topic, type or field: what is requested, not what was measured
    "cmd", "cmds", "command", "commands", "commanded", "target", "desired", "setpoint", "setpoints", "set",
    "reference", "ref", "request", "requested", "req", "demand", "demanded", "goal", "control", "ctrl",
    "des", "tgt", "sp", "soll", "ziel", "wunsch",
    "planned", "planning", "plan", "trajectory", "predicted", "recommended", "advised", "nominal", "cruise",
))  # fmt: skip
STATISTIC = frozenset((  # of a number, not the number
    "limit", "limits", "max", "min", "maximum", "minimum", "average", "avg", "mean", "total", "error",
    "delta", "difference", "lim", "simulated",
    "accuracy", "uncertainty", "variance", "std", "valid", "validity", "quality",
    "avail", "available", "timeout", "fault",
))  # fmt: skip
LEADER = frozenset(("lead", "leader", "front", "preceding", "ahead", "radar"))


@dataclass(frozen=True)
class Words:
    """`any_of`: sets of words of which one must be there whole; `none_of`: words that stand for others."""

    any_of: tuple[frozenset[str], ...]
    none_of: frozenset[str]


@dataclass(frozen=True)
class Named:
    """A channel that words may mean: which of them say so, and their place among the rule's `any_of`."""

    channel: str
    asked: frozenset[str]
    place: int


def _words(any_of: str, none_of: str = "", more: frozenset[str] = frozenset()) -> Words:
    return Words(
        tuple(frozenset(one.split()) for one in any_of.split(",")), frozenset(none_of.split()) | more
    )


BY_WORDS: dict[str, Words] = {
    "speed": _words(
        "speed,velocity,vel,vx",
        "engine motor shaft turbo fan pump angular angle steering yaw heading lateral vertical wind "
        "relative rel y z",
        STATISTIC,
    ),
    "acceleration": _words(
        "acceleration,accel,acc,ax",
        "pedal throttle brake brakes angular lateral lat transverse vertical gravity axis relative rel y z "
        "position pos",
        STATISTIC | LEADER,
    ),
    "engine_command": _words(
        "accelerator,accel pedal,acc pedal,gas pedal,accel position,accel pos,throttle,gas,engine command,"
        "engine cmd,engine request,"
        "torque request,torque requested,torque command,torque cmd,torque demand,pedal",
        "clutch acceleration brake brakes retarder steering exhaust temperature temp pressure min max limit "
        "switch kickdown",
    ),
    "brake_switch": _words(
        "brake switch,brake light,brake lamp,brake pressed,brake active,brake on,brakes pressed",
        "parking temperature temp wear engine exhaust retarder",
    ),
    "brake_command": _words(
        "brake,brakes,xbr,deceleration request,deceleration demand,deceleration target",
        "parking temperature temp wear lamp light switch engine exhaust retarder throttle torque",
    ),
    "grade": _words("grade,slope,gradient,incline,inclination,pitch", "rate angular gear"),
    "fuel_rate": _words("fuel", "level tank temperature temp pressure total economy trim"),
    "gear": _words("gear", "ratio oil temperature temp pressure", STATISTIC),
    "engine_speed": _words(
        "engine speed,engine rpm,rpm", "wheel turbo fan pump shaft output input transmission", STATISTIC
    ),
    "engine_torque": _words("torque", "brake steering wheel retarder friction losses reference", STATISTIC),
    "elevation": _words("elevation,altitude,alt"),
    "gap": _words(
        "gap,distance,headway,range",
        "travelled traveled trip total time rate bottom ground driven",
        STATISTIC,
    ),
    "leader_speed": _words(
        ",".join(f"{who} {what}" for who in sorted(LEADER) for what in ("speed", "velocity", "vel")),
        "relative rel rate wheel axle tire tyre left right",
        STATISTIC,
    ),
    "ambient_temperature": _words(
        "ambient temperature,outside temperature,air temperature,ambient temp,outside temp,ambient",
        "intake charge manifold",
    ),
    "latitude": _words("latitude,lat", "acceleration accel acc speed velocity"),
    "longitude": _words("longitude,lon,lng", "acceleration accel acc speed velocity"),
}
UNIT_WORDS = {
    "kmh": "km/h", "kph": "km/h", "mph": "mph", "mps": "m/s", "rpm": "rpm", "percent": "percent",
    "pct": "percent", "percentage": "percent", "ratio": "ratio", "nm": "N m", "bar": "bar", "kpa": "kPa",
    "psi": "psi", "deg": "deg", "rad": "rad", "lph": "l/h",
}  # fmt: skip
_DECELERATION = {"deceleration", "decel", "acceleration", "xbr"}
_PITCH = {"pitch", "incline", "inclination"}
_BY_OWN_WORDS = frozenset(("speed", "engine_command", "brake_command"))  # words around spoil none of these
_BY_RANGE: dict[
    str, tuple[tuple[float, float, str], ...]
] = {  # least and most that a drive reaches, and unit
    "speed": ((2.0, 45.0, "m/s"), (8.0, 160.0, "km/h"), (5.0, 85.0, "mph")),
    "leader_speed": ((2.0, 45.0, "m/s"), (8.0, 160.0, "km/h"), (5.0, 85.0, "mph")),
    "acceleration": ((0.03, 15.0, "m/s^2"), (0.03, 1.0, "g")),
    "engine_command": ((0.1, 1.05, "ratio"), (10.0, 105.0, "percent"), (105.0, 6000.0, "N m")),
    # up to 15: bar, m/s^2 or percent
    "brake_command": ((0.1, 1.05, "ratio"), (1.05, 15.0, ""), (5.0, 105.0, "percent")),
    "brake pressure": ((1.0, 15.0, "bar"), (50.0, 1500.0, "kPa"), (10.0, 220.0, "psi"), (15.0, 200.0, "bar")),
    "brake deceleration": ((0.03, 15.0, "m/s^2"), (0.03, 1.0, "g"), (5.0, 105.0, "percent")),
    "grade": ((0.005, 0.4, "ratio"), (0.12, 40.0, "percent"), (0.1, 22.0, "deg")),
    "pitch": ((0.005, 0.4, "rad"), (0.1, 25.0, "deg"), (0.12, 40.0, "percent")),
    "gear": ((1.0, 24.0, "1"),),
    "brake_switch": ((0.0, 3.0, "1"),),
    "engine_speed": ((60.0, 300.0, "rad/s"), (500.0, 7000.0, "rpm")),
    "engine_torque": ((0.0, 130.0, ""), (0.0, 6000.0, "N m")),  # up to 130: percent of an unnamed torque
    "elevation": ((0.0, 6000.0, "m"), (0.0, 20000.0, "ft")),
    "gap": ((1.0, 500.0, "m"), (3.0, 1600.0, "ft")),
    "ambient_temperature": ((0.0, 70.0, "degC"), (0.0, 140.0, "degF"), (220.0, 345.0, "K")),
    "latitude": ((1e-3, 90.0, "deg"),),
    "longitude": ((1e-3, 180.0, "deg"),),
}


def words(text: str) -> frozenset[str]:
    """The words of a name in any spelling: brake_cmd, BrakeCmd and /brake/cmd are the same."""
    return frozenset(word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", text))


def named_channels(own: frozenset[str], around: frozenset[str]) -> Iterator[Named]:
    """The channels that a number may be by its own words and those around it, the likeliest first."""
    for channel, rule in BY_WORDS.items():
        asked = [k for k, one in enumerate(rule.any_of) if one <= own | around and (one & own or not own)]
        spoilt = rule.none_of & (own if own and channel in _BY_OWN_WORDS else own | around)
        spoilt |= LEADER & (own | around) if channel == "speed" else frozenset()
        if asked and not spoilt:
            yield Named(channel, rule.any_of[asked[0]], asked[0])


def unit_by_range(channel: str, named: frozenset[str], largest: float) -> str:
    """The first unit in which values up to `largest` are plausible; '' where there is none."""
    limits = _BY_RANGE.get(_kind(channel, named), ())
    return next((unit for _, most, unit in limits if math.isfinite(largest) and largest <= most), "")


def units_by_range(channel: str, named: frozenset[str], largest: float) -> list[str]:
    """Every unit in which a drive may reach `largest` and no more; '' stands for several."""
    return [
        unit for least, most, unit in _BY_RANGE.get(_kind(channel, named), ()) if least <= largest <= most
    ]


def _kind(channel: str, named: frozenset[str]) -> str:
    if channel == "brake_command":
        channel = "brake pressure" if "pressure" in named else channel
        return "brake deceleration" if _DECELERATION & named else channel
    return "pitch" if channel == "grade" and _PITCH & named else channel
