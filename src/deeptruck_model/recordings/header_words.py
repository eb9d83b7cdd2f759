"""What headers of tables mean: English and German words and abbreviations, and the spellings of units."""

from __future__ import annotations

import re
from dataclasses import dataclass

from deeptruck_model.errors import InputError
from deeptruck_model.recordings.channel_words import BY_WORDS, COMMANDED, STATISTIC, UNIT_WORDS, words
from deeptruck_model.recordings.columns import TIME_UNITS
from deeptruck_model.recordings.units import conversion
from deeptruck_model.signals import CHANNELS

TIME = frozenset((
    "time", "timestamp", "timestamps", "date", "datetime", "clock", "utc", "epoch", "elapsed", "seconds", "t",
    "stamp", "ts", "tow", "itow",
))  # fmt: skip
NO_TIME = frozenset(
    ("gap", "headway", "engine", "idle", "zone", "collision")
)  # 'time gap', 'engine run time'

# A word of a header, or a part of one: the English words that it stands for. Umlauts are written ae, oe, ue.
_STEMS = {
    "geschwindigkeit": "speed", "geschw": "speed", "tempomat": "cruise", "beschleunigung": "acceleration",
    "verzoegerung": "deceleration", "laengs": "longitudinal", "quer": "lateral", "vertikal": "vertical",
    "fahrpedal": "accelerator pedal", "gaspedal": "accelerator pedal", "drosselklappe": "throttle",
    "brems": "brake", "druck": "pressure", "stellung": "position", "drehzahl": "rpm", "drehmoment": "torque",
    "momentan": "instantaneous", "moment": "torque", "steigung": "slope", "neigung": "inclination",
    "querneigung": "lateral", "gefaelle": "slope", "hoehe": "altitude", "breitengrad": "latitude",
    "laengengrad": "longitude", "kraftstoff": "fuel", "verbrauch": "fuel", "durchfluss": "flow",
    "fuellstand": "level", "temperatur": "temperature", "aussen": "outside", "umgebung": "ambient",
    "kuehlmittel": "coolant", "kuehlwasser": "coolant", "ansaug": "intake", "ladeluft": "intake",
    "abgas": "exhaust", "abstand": "gap", "strecke": "trip", "kilometerstand": "total",
    "reichweite": "total", "soll": "target", "ziel": "target", "wunsch": "desired", "vorgabe": "target",
    "anforderung": "request", "angefordert": "request", "grenz": "limit", "limit": "limit",
    "hoechst": "maximum", "durchschnitt": "average", "mittelwert": "mean", "mittlere": "mean",
    "vorderfahrzeug": "leader", "vorausfahrend": "leader", "fuehrungsfahrzeug": "leader", "zeit": "time",
    "datum": "date", "motor": "engine", "getriebe": "transmission", "lenk": "steering", "reifen": "tyre",
    "feststell": "parking", "handbremse": "parking brake", "retarder": "retarder", "leistung": "power",
    "fahrer": "driver", "schalter": "switch", "licht": "light", "luft": "air", "winkel": "angle",
    "raddrehzahl": "wheel rpm", "radgeschwindigkeit": "wheel speed", "radmoment": "wheel torque",
    "relativgeschwindigkeit": "relative speed", "relativ": "relative", "turbine": "turbo",
    "turbolader": "turbo",
    "gelenkwelle": "shaft", "abweichung": "error", "fehler": "error", "differenz": "difference",
    "gueltig": "valid", "fuehrungsgroesse": "reference", "stellgroesse": "command", "prognose": "predicted",
    "simul": "simulated", "modell": "simulated", "luefter": "fan",
    "abtrieb": "output", "ausgang": "output", "eingang": "input", "gier": "yaw", "wind": "wind",
    "reib": "friction",
    "empfohlen": "recommended", "stempel": "timestamp", "pedal": "pedal", "gasp": "accelerator",
    "referenz": "reference", "verlust": "losses", "kupplung": "clutch", "drehz": "rpm",
    # abbreviations, written without a mark between them
    "spd": "speed", "trq": "torque", "brk": "brake", "accped": "accelerator pedal", "pdl": "pedal",
    "throt": "throttle", "rqst": "request",
    # English, written without a mark between the words
    "speed": "speed", "velocity": "velocity", "engine": "engine", "vehicle": "vehicle", "wheel": "wheel",
    "throttle": "throttle", "accelerator": "accelerator", "brake": "brake",
    "torque": "torque", "fuel": "fuel", "altitude": "altitude", "elevation": "elevation",
    "ambient": "ambient", "target": "target", "desired": "desired", "command": "command", "cruise": "cruise",
    "setpoint": "setpoint", "setspeed": "set speed", "speedset": "set speed", "avgspeed": "average speed",
    "maxspeed": "maximum speed", "refspeed": "reference speed", "gpsspeed": "gps speed",
    "acceleration": "acceleration", "timestamp": "timestamp", "longtitude": "longitude",
}  # fmt: skip
_WHOLE = {  # only as a whole word
    "vist": "speed",
    "vfzg": "speed",
    "vsoll": "target speed",
    "vset": "set speed",
    "vref": "reference speed",
    "vziel": "target speed",
    "vego": "speed",
    "vveh": "speed",
    "vss": "speed",
    "ist": "actual",
    "vehspd": "vehicle speed",
    "nmot": "engine rpm",
    "gang": "gear",
    "gangstufe": "gear",
    "istgang": "gear",
    "sollgang": "target gear",
    "zielgang": "target gear",
    "selected": "target",
    "tps": "throttle",
    "app": "accelerator pedal",
    "aps": "accelerator pedal",
    "last": "load",
    "rad": "wheel",
    "oel": "oil",
    "tempo": "speed",
    "weg": "trip",
    "posted": "limit",
    "accel": "accel",
    "braking": "brake",
    "uhr": "time",
    "odometer": "total",
    "eng": "engine",
    "mot": "engine",
    "ped": "pedal",
    "rqed": "request",
    "reqed": "request",
    "reqd": "request",
    "rqd": "request",
    "rq": "request",
    "tsc": "request",
    "gps": "gps",
    "gpm": "gpm",
    "fuelrate": "fuel",
    "zeit": "time",
    "bremse": "brake",
    "gas": "gas",
    "fahrgeschwindigkeit": "speed",
    "tank": "tank",
    "map": "manifold",
    "iat": "intake",
    "ect": "coolant",
    "hoehe": "altitude",
    "dist": "distance",
    "sas": "steering",
}
_LETTERS = {"v": "speed", "a": "acceleration"}  # where all other words are of these:
_BESIDE_LETTERS = frozenset((
    "x", "ist", "actual", "act", "veh", "vehicle", "fzg", "ego", "long", "lon", "mess", "meas",
    "measured", "can", "gps", "kmh", "mps", "kph", "mph",
))  # fmt: skip
GERMAN = ("geschw", "zeit", "drehzahl", "brems", "gang", "pedal", "hoehe", "moment", "kraftstoff", "datum")
_KNOWN = frozenset(
    {word for rule in BY_WORDS.values() for one in rule.any_of for word in one}
    | {word for rule in BY_WORDS.values() for word in rule.none_of}
    | COMMANDED
    | STATISTIC
    | TIME
)
_SPELLINGS = {  # as exports write a unit, in lower case without blanks: as units.conversion reads it
    "kmh": "km/h", "kph": "km/h", "mps": "m/s", "km/hr": "km/h", "kmph": "km/h",
    "km/std": "km/h", "kilometer/h": "km/h", "km_h": "km/h",
    "km_per_h": "km/h", "meters/second": "m/s", "metres/second": "m/s", "meter/second": "m/s",
    "m/sec": "m/s", "m_s": "m/s", "m_per_s": "m/s", "miles/hour": "mph", "knots": "knot", "kt": "knot",
    "kts": "knot", "m/s²": "m/s^2", "mps2": "m/s^2", "ms2": "m/s^2", "m_s2": "m/s^2", "m/s/s": "m/s^2",
    "m/ss": "m/s^2", "m_per_s2": "m/s^2", "m/sec^2": "m/s^2", "m/sec2": "m/s^2", "l/hr": "l/h",
    "lph": "l/h", "l_h": "l/h", "l_per_h": "l/h", "l/std": "l/h", "liter/h": "l/h", "litres/hour": "l/h",
    "gal/hr": "gal/h", "g/sec": "g/s", "g_s": "g/s", "u/min": "rpm", "upm": "rpm",
    "umin": "rpm", "min-1": "rpm", "1/min": "rpm", "rev/min": "rpm",
    "min^-1": "rpm", "r/min": "rpm", "1_min": "rpm", "umdr/min": "rpm",
    "revs/min": "rpm", "prozent": "percent", "pct": "percent", "percentage": "percent", "perc": "percent",
    "‰": "permille", "promille": "permille", "grad": "deg", "degree": "deg", "degrees": "deg",
    "grdc": "degC", "gradc": "degC", "grad_c": "degC", "degreesc": "degC", "deg_c": "degC", "deg.c": "degC",
    "degreesf": "degF", "deg_f": "degF", "n.m": "N m", "newtonmeter": "N m", "lb.ft": "lb-ft",
    "lbs.ft": "lb-ft", "ft.lb": "ft-lb", "ft.lbs": "ft-lb", "ftlbs": "ft-lb", "meter": "m", "metres": "m",
    "meters": "m", "foot": "ft", "fuss": "ft", "kilopascal": "kPa", "mbar": "hPa",
    "second": "s", "seconds": "s", "sekunden": "s", "sek": "s", "secs": "s", "millis": "ms", "msec": "ms",
    "milliseconds": "ms", "millisekunden": "ms", "usec": "us", "microseconds": "us", "nanoseconds": "ns",
    "minutes": "min", "minuten": "min", "hours": "h", "stunden": "h", "tage": "days",
    "℃": "degC", "°c": "degC", "°f": "degF",
    "â°c": "degC", "â°f": "degF", "cc/min": "ml/min", "cm3/min": "ml/min", "cm³/min": "ml/min",
    "kilometer_per_hour": "km/h", "kilometers_per_hour": "km/h", "mile_per_hour": "mph",
    "meter_per_second": "m/s",
    "revolutions_per_minute": "rpm", "revolution_per_minute": "rpm", "degree_celsius": "degC",
    "liter_per_hour": "l/h", "gram_per_second": "g/s", "newton_meter": "N m",
    "mi/hr": "mph", "miles": "mi", "g-force": "g", "l/s": "l/s",
}  # fmt: skip
_NO_CHANNEL = frozenset((  # units of what is no channel of ours: they say that the column is none either
    "l", "km", "kg", "w", "kw", "v", "mah", "kwh", "l/100km", "l_100km", "mpg", "kmpl", "hpa", "n", "kn", "j",
    "hp", "ps", "deg/s", "rad/s", "°/s", "ppm", "g/km", "mg/stk", "bit", "dbm", "mi", "gal", "m3", "m^3",
    "kwh/100km", "kcal", "inhg", "lb", "lbs",
))  # fmt: skip
_ENDS = re.compile(r"[\s_,;:/-]+(?=[^\s_,;:]+$)")
_LONG_ENDS = re.compile(
    r"[\s_]+(km_per_h|km_h|m_per_s2|m_s2|m_per_s|m_s|l_per_h|l_h|l_100km|g_s|1_min|deg_c|deg_f|grad_c)$", re.I
)


IMPERIAL = frozenset((
    "mph", "ft", "degf", "gal", "mi", "gal/h", "gph", "psi", "lb-ft", "ft-lb", "mpg", "lb", "inhg",
))  # fmt: skip
METRIC = frozenset((
    "km/h", "kph", "kmh", "degc", "km", "l", "l/h", "l/100km", "kpa", "bar", "m/s", "kg", "kg/h",
    "ml/min", "kmpl",
))  # fmt: skip


@dataclass(frozen=True)
class Header:
    """A name of a column: its English words, and the unit it states ('' where none) with where it does."""

    words: frozenset[str]
    unit: str = ""
    stated: str = ""
    german: bool = False


def header(name: str, below: str = "") -> Header:
    """The words and unit of a column's name; `below` is its cell in a row of units."""
    text, unit, stated = name, spelled(below, name), f"'{below.strip()}' in the row of units"
    for bracket in reversed(re.findall(r"[(\[{<]([^()\[\]{}<>]*)[)\]}>]", name)):
        if found := spelled(bracket, name):
            text = re.sub(rf"[(\[{{<]{re.escape(bracket)}[)\]}}>]", " ", text)
            unit, stated = (unit or found), (stated if unit else f"'{bracket}' in the header")
            break
    if not unit:
        end = _LONG_ENDS.search(text)
        parts = [text[: end.start()], end[1]] if end else _ENDS.split(text.strip(), maxsplit=1)
        if len(parts) == 2 and (found := _at_end(parts[1], name)):
            text, unit, stated = parts[0], found, f"'{parts[1]}' at the end of the header"
    named = _english(text)
    if not unit and (found_words := sorted(named & UNIT_WORDS.keys() - {"rpm"})):
        unit, stated = UNIT_WORDS[found_words[0]], f"'{found_words[0]}' in the header"
    if unit.lower() == "rpm":
        named |= {"rpm"}
    if not unit and len(name) > 2 and (found := spelled(name, name)):  # 'km/h' as the whole header
        unit, stated = found, "the header"
        named |= {"speed"} if found in ("km/h", "mph", "m/s") else frozenset()
    german = any(stem in _without_umlauts(name).lower() for stem in GERMAN)
    return Header(named, unit, stated if unit else "", german)


def _at_end(text: str, name: str) -> str:
    """A unit at the end of a name; of single letters only those that rarely mean anything else."""
    return spelled(text, name) if len(text) > 1 or text in "msgh%°CFK" else ""


def spelled(text: str, name: str = "") -> str:
    """A unit as units.conversion reads it, one of time, or one that fits no channel; '' for what is none.

    Letters that often number a sensor, such as (D), are no units; C, F and K are, where `name` has a
    temperature.
    """
    plain = text.strip().strip("()[]{}").strip()
    key = plain.lower().replace(" ", "").rstrip(".")
    if key in ("", "1", "gear", "d", "n", "j") or (key in ("c", "f", "k") and "temp" not in name.lower()):
        return ""
    unit = _SPELLINGS.get(key, plain)
    ours = any(fits(channel, unit) for channel in CHANNELS)
    return unit if ours or unit.lower() in TIME_UNITS or unit.lower() in _NO_CHANNEL else ""


def fits(channel: str, unit: str) -> bool:
    """Whether a channel can be in this unit."""
    try:
        conversion(channel, unit)
    except InputError:
        return False
    return True


def _without_umlauts(text: str) -> str:
    for umlaut, pair in zip("äöüÄÖÜß", ("ae", "oe", "ue", "Ae", "Oe", "Ue", "ss"), strict=True):
        text = text.replace(umlaut, pair)
    return text


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
