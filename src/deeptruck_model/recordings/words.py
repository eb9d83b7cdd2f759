"""Words of names and headers, from words.yaml: by them, units and ranges of values a number in a bag or table
is recognised as a channel.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from deeptruck_core.reading import package_yaml
from deeptruck_core.signals import CHANNELS
from deeptruck_model.recordings.units import TIME_UNITS, fits

_DATA = package_yaml(__package__, "words.yaml")
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


TIME = frozenset(_DATA["time"])
NO_TIME = frozenset(_DATA["no_time"])
_STEMS: dict[str, str] = _DATA["stems"]
_WHOLE: dict[str, str] = _DATA["whole"]
_LETTERS: dict[str, str] = _DATA["letters"]
_BESIDE_LETTERS = frozenset(_DATA["beside_letters"])
_SPELLINGS: dict[str, str] = _DATA["spellings"]
_UNITS_OF_NAMES: dict[str, tuple[str, str]] = _DATA["units_of_names"]
_NO_CHANNEL = frozenset(_DATA["no_channel"])
_KNOWN = frozenset(
    {word for rule in BY_WORDS.values() for one in rule.any_of for word in one}
    | {word for rule in BY_WORDS.values() for word in rule.none_of}
    | COMMANDED
    | STATISTIC
    | TIME
)
_COUNTS = re.compile(r"(?:^|[\s_(\[{<]+)\d*\.?\d+ ?(s|sec|ms|us|min)\b[)\]}>]*", re.I)
_ENDS = re.compile(r"[\s_,;:/-]+(?=[^\s_,;:]+$)")
_LONG_ENDS = re.compile(
    r"[\s_]+(km_per_h|km_h|m_per_s2|m_s2|m_per_s|m_s|l_per_h|l_h|l_100km|g_s|1_min|deg_c|deg_f|grad_c)$", re.I
)


COMPONENTS = tuple(pair for a, b in (("north", "east"), ("n", "e"), ("x", "y")) for pair in ((a, b), (b, a)))


@dataclass(frozen=True)
class Header:
    """A column's name: its English words, the unit it states ('' if none), and where it states it."""

    words: frozenset[str]
    unit: str = ""
    stated: str = ""


def header(name: str, below: str = "", place: str = "in the row of units") -> Header:
    """Words and unit of a column's name; `below` is a unit that the table states at another `place`."""
    if counts := _COUNTS.search(name):  # 'Time (0.1 sec)': its numbers count such steps, in no unit
        rest = header(name[: counts.start()] + name[counts.end() :])
        return Header(rest.words, counts[0].strip(" ()[]{}<>"), f"'{counts[0].strip()}' in the header")
    text, unit, stated = name, spelled(below, name), f"'{below.strip()}' {place}"
    for bracket in reversed(re.findall(r"[(\[{<]([^()\[\]{}<>]*)[)\]}>]", name)):
        if found := spelled(bracket, name):
            text = re.sub(rf"[(\[{{<]{re.escape(bracket)}[)\]}}>]", " ", text)
            unit, stated = (unit or found), (stated if unit else f"'{bracket}' in the header")
            break
    if not unit:
        end = _LONG_ENDS.search(text)
        parts = [text[: end.start()], end[1]] if end else _ENDS.split(text.strip(), maxsplit=1)
        single = len(parts) == 2 and len(parts[1]) == 1 and parts[1] not in "msgh%°CFK"  # means other things
        if len(parts) == 2 and not single and (found := spelled(parts[1], name)):
            text, unit, stated = parts[0], found, f"'{parts[1]}' at the end of the header"
    named = _english(text)
    if not unit and (found_words := sorted(named & UNIT_WORDS.keys() - {"rpm"})):
        unit, stated = UNIT_WORDS[found_words[0]], f"'{found_words[0]}' in the header"
    if not unit and (known := next((k for k in _UNITS_OF_NAMES if k in name.lower().replace(" ", "")), "")):
        unit, stated = _UNITS_OF_NAMES[known][0], f"{_UNITS_OF_NAMES[known][1]}, which has this name"
    if unit.lower() == "rpm":
        named |= {"rpm"}
    unit = "m/s" if unit == "ms" and named & {"speed", "velocity"} else unit
    if not unit and len(name) > 2 and (found := spelled(name, name)):  # 'km/h' as the whole header
        unit, stated = found, "the header"
        named |= {"speed"} if found in ("km/h", "mph", "m/s") else frozenset()
    return Header(named, unit, stated if unit else "")


def sibling(name: str, others: Iterable[str]) -> str:
    """The column with the other horizontal component of a velocity: vel_e of vel_n, vy of vx; '' if there is
    none."""
    own, written = _parted(name), {_parted(other): other for other in others}
    for one, other in COMPONENTS:
        part = rf"(?<![a-z])((?:v|vel|velocity|)_?){one}(?![a-z])"
        found = re.sub(part, rf"\1{other}", own, count=1)
        if found != own and found in written:
            return written[found]
    return ""


def _parted(name: str) -> str:
    """A name in lower case, its words in capitals parted by '_'."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()


def spelled(text: str, name: str = "") -> str:
    """A unit as units.conversion spells it, a unit of time, or a unit that fits no channel; '' if `text` is
    no unit.

    Letters that often number a sensor, such as (D), are no units; C, F and K are units if `name` mentions a
    temperature.
    """
    plain = text.strip().strip("()[]{}").strip()
    key = plain.lower().replace(" ", "").rstrip(".")
    if key in ("", "1", "gear", "d", "n", "j") or (key in ("c", "f", "k") and "temp" not in name.lower()):
        return ""
    unit = _SPELLINGS.get(key, plain)
    ours = any(fits(channel, unit) for channel in CHANNELS)
    return unit if ours or unit.lower() in TIME_UNITS or unit.lower() in _NO_CHANNEL else ""


def _without_umlauts(text: str) -> str:
    pairs = ("ae", "oe", "ue", "Ae", "Oe", "Ue", "ss", "i", "l", "o", "d")
    for umlaut, pair in zip("äöüÄÖÜßıłøđ", pairs, strict=True):
        text = text.replace(umlaut, pair)
    return "".join(c for c in unicodedata.normalize("NFKD", text) if not unicodedata.combining(c))


def _english(text: str) -> frozenset[str]:
    text = _without_umlauts(text)
    text = re.sub(r"cruise[ _]control[ _/]+vehicle[ _]speed", " ", text, flags=re.I)  # a J1939 message's name
    found: set[str] = set()
    written = words(text)
    for word in written:
        if word == "a" and re.search(r"\bA\b", text):
            found |= {"current"}  # A stands for a current, where a stands for an acceleration
        elif word in _LETTERS:
            found |= {_LETTERS[word]} if written - {word} <= _BESIDE_LETTERS | COMMANDED else set()
        elif word in _WHOLE:
            found |= {*_WHOLE[word].split()}
        elif word in _KNOWN or word in UNIT_WORDS:
            found.add(word)
        else:
            found |= _parts(word) or {word}
    return frozenset(found)


def _parts(word: str) -> set[str]:
    """English words for the stems of a compound word."""
    found: set[str] = set()
    for stem in sorted(_STEMS, key=len, reverse=True):
        if stem in word:
            word = word.replace(stem, " ")
            found |= {*_STEMS[stem].split()}
    return found
