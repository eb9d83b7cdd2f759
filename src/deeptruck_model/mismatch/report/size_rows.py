"""A finding's sizes as the page lists them: which belong to what, and how they add up."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from deeptruck_model.mismatch.report.drawing import words
from deeptruck_model.mismatch.report.findings import SETTING_UNITS
from deeptruck_model.mismatch.report.page_words import measured, number, prose
from deeptruck_model.mismatch.residual.signal_units import unit

AT = re.compile(r"at (?P<by>.+) (?P<x>-?[\d.]+(?:e[+-]?\d+)?)")  # a place on a curve, as own_forms names it
IN = re.compile(r"(?P<name>[^\[]+)\[(?P<where>.+)\]")  # in one recording, or at one knot
NOTHING = 1e-3  # of the widest place on a curve: a place nearer to zero is zero
ADD_UP = "what acts at a moment is the sum of all that hold there: {}"
THERE_ALONE = "in that recording or near that moment alone"
HELD_AT_ZERO = "it cannot be less, and no more was seen"
ENDS = "by its form the curve ends there at zero"
Parameters = Mapping[str, Mapping[str, Any]]


def rows(parameters: Parameters) -> list[dict[str, str]]:
    """Name and text of every size, then how they add up where they are of several kinds."""
    fitted = {p["unit"] for n, p in parameters.items() if p["ci95"] is not None}
    shown = {n: p for n, p in parameters.items() if _told(n, p, fitted)}
    sizes = [{"name": _named(n, shown), "text": _text(n, p, shown)} for n, p in shown.items()]
    kinds = _kinds(shown)
    return [*sizes, *([{"name": "together", "text": ADD_UP.format(kinds)}] if kinds else [])]


def _told(name: str, p: Mapping[str, Any], fitted: set[str]) -> bool:
    """Whether people get it: not what only chose a place on a grid, about which the size was fitted."""
    return p["value"] is not None and name != "held_out_r2" and not (_chosen(name, p) and p["unit"] in fitted)


def _chosen(name: str, p: Mapping[str, Any]) -> bool:
    return p["ci95"] is None and name in SETTING_UNITS


def _named(name: str, shown: Parameters) -> str:
    """A size's name in words; recordings keep theirs."""
    curve, own = AT.fullmatch(name), IN.fullmatch(name)
    if curve:
        by, x = curve["by"], float(curve["x"])
        widest = max(abs(place) for place in _places(by, shown))
        x = 0.0 if abs(x) < NOTHING * widest else x
        return " ".join(filter(None, [f"at {words(by)} of {number(x)}", unit(by, {})]))
    if own:
        return f"{words(own['name'])}[{own['where']}]"
    return re.sub(" (s|m|hz)$", "", words(name)) if _chosen(name, shown[name]) else words(name)


def _places(by: str, shown: Parameters) -> list[float]:
    found = [AT.fullmatch(name) for name in shown]
    return [float(f["x"]) for f in found if f and f["by"] == by]


def _text(name: str, p: Mapping[str, Any], shown: Parameters) -> str:
    text = measured(p["value"], p["unit"], p["ci95"])
    if _chosen(name, p):
        return f"about {text}, the best of a few that were tried"
    if p["value"] != 0.0 or p["ci95"] is not None:
        return text
    curve = AT.fullmatch(name)
    places = _places(curve["by"], shown) if curve else []
    ends = curve is not None and float(curve["x"]) in (min(places), max(places))
    return f"{text}: {ENDS if ends else HELD_AT_ZERO}"


def _kinds(shown: Parameters) -> str:
    """The kinds of size of one unit, in words; empty where there is only one."""
    kinds: dict[str, str] = {}
    for name, p in shown.items():
        curve, own = AT.fullmatch(name), IN.fullmatch(name)
        if _chosen(name, p):
            continue
        if curve:
            kinds[f"at {curve['by']}"] = f"the curve over {words(curve['by'])}"
        elif own:
            kinds[f"[{own['name']}"] = (
                f"{words(own['name'])}[...] in that recording or near that moment alone"
            )
        else:
            kinds[name] = prose(name)
    mixed = any(k.startswith(("at ", "[")) for k in kinds) and len({p["unit"] for p in shown.values()}) == 1
    return ", ".join(kinds.values()) if mixed and len(kinds) > 1 else ""
