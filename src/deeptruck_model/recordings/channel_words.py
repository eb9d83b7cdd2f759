"""Words and value ranges by which a number in a bag or table is recognised as a channel."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from deeptruck_core.reading import package_yaml

_DATA = package_yaml(__package__, "channel_words.yaml")
COMMANDED, STATISTIC, LEADER = (frozenset(_DATA[kind]) for kind in ("commanded", "statistic", "leader"))
UNIT_WORDS: dict[str, str] = _DATA["unit_words"]


@dataclass(frozen=True)
class Words:
    """`any_of`: sets of words, one of which must occur completely; `none_of`: words that exclude the
    channel."""

    any_of: tuple[frozenset[str], ...]
    none_of: frozenset[str]


@dataclass(frozen=True)
class Named:
    """A channel that a name may mean: the words that match, and their rank among the rule's `any_of`."""

    channel: str
    asked: frozenset[str]
    place: int


def _rule(any_of: list[str], none_of: Sequence[str] = (), none_of_kinds: Sequence[str] = ()) -> Words:
    kinds = [frozenset(_DATA[kind]) for kind in none_of_kinds]
    return Words(tuple(frozenset(one.split()) for one in any_of), frozenset(none_of).union(*kinds))


BY_WORDS = {channel: _rule(**rule) for channel, rule in _DATA["channels"].items()}
_DECELERATION = {"deceleration", "decel", "acceleration", "xbr"}
_PITCH = {"pitch", "incline", "inclination"}
_BY_OWN_WORDS = frozenset(("speed", "engine_command", "brake_command"))  # words around spoil none of these
_BY_RANGE: dict[str, list[tuple[float, float, str]]] = _DATA["ranges"]


def words(text: str) -> frozenset[str]:
    """The words of a name in any spelling: brake_cmd, BrakeCmd and /brake/cmd give the same."""
    return frozenset(word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", text))


def named_channels(own: frozenset[str], around: frozenset[str]) -> Iterator[Named]:
    """The channels that a number may be, by its own words and those of its parents, most probable first."""
    for channel, rule in BY_WORDS.items():
        asked = [k for k, one in enumerate(rule.any_of) if one <= own | around and (one & own or not own)]
        spoilt = rule.none_of & (own if own and channel in _BY_OWN_WORDS else own | around)
        spoilt |= LEADER & (own | around) if channel == "speed" else frozenset()
        if asked and not spoilt:
            yield Named(channel, rule.any_of[asked[0]], asked[0])


def unit_by_range(channel: str, named: frozenset[str], largest: float) -> str:
    """The first unit in which values up to `largest` are plausible; '' if there is none."""
    limits = _BY_RANGE.get(_kind(channel, named), ())
    return next((unit for _, most, unit in limits if math.isfinite(largest) and largest <= most), "")


def units_by_range(channel: str, named: frozenset[str], largest: float) -> list[str]:
    """Every unit in which a drive can plausibly reach `largest`; '' stands for several."""
    return [
        unit for least, most, unit in _BY_RANGE.get(_kind(channel, named), ()) if least <= largest <= most
    ]


def _kind(channel: str, named: frozenset[str]) -> str:
    if channel == "brake_command":
        channel = "brake pressure" if "pressure" in named else channel
        return "brake deceleration" if _DECELERATION & named else channel
    return "pitch" if channel == "grade" and _PITCH & named else channel
