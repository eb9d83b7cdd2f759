"""The levels of the examination: the laws that each may hide, and the order in which seeds select them."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence

import numpy as np

from deeptruck_core.errors import InputError
from deeptruck_exam.laws import EFFECTS, Effect, named, nameless, of_kind
from deeptruck_exam.laws.parameters import each_drive

LEVELS = (
    "noise",
    "wrong_parameters",
    "absorbed",
    "closed_loop",
    "one_condition",
    "rare",
    "decoy",
    "several",
    "fault",
    "unknown",
    "parameter_error",
    "input_not_recorded",
    "slope_or_wind",
    "slope_or_wind_felt",
    "each_drive_differs",
    "only_parameters",
    "nothing_missing",
)
NO_EFFECT = ("only_parameters", "nothing_missing")
FELT = "slope_or_wind_felt"  # with an accelerometer
SLOPE_OR_WIND = ("slope_or_wind", FELT)
NOT_RECORDED: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    # an input: the channels that are withheld, and the names that may be given for what it hides
    "brake": (("brake_command",), ()),
    "gear": (("gear", "engine_speed"), ()),
    "slope": (("grade", "elevation"), ("road_grade",)),
    "gap": (("gap", "leader_speed"), ("drafting",)),
}


def mark(level: str) -> int:
    """Number mixed into every draw, so that equal seeds of different levels give different cases."""
    return zlib.crc32(level.encode())


def hidden_input(level: str, seed: int) -> str:
    """The input withheld in a case of level input_not_recorded; empty at other levels."""
    return list(NOT_RECORDED)[seed % len(NOT_RECORDED)] if level == "input_not_recorded" else ""


def suitable(level: str) -> list[Effect]:
    """The effects that a level may hide, in an order specific to the level, so that a seed does not select
    the same law at every level."""
    if level in (*NO_EFFECT, "input_not_recorded"):
        return []
    if level == "each_drive_differs":
        return each_drive()
    if level == "fault":
        some = of_kind("measurement_fault")
    elif level == "parameter_error":
        some = of_kind("parameter_error")
    elif level == "one_condition":
        some = [e for e in named() if e.gateable and e.name not in ("payload_change", "road_surface")]
    elif level in SLOPE_OR_WIND:
        some = [e for e in named() if e.key == "slope_not_recorded" or e.name == "headwind"]
    elif level == "rare":
        some = [e for e in named() if e.gateable or e.name.startswith("command")]
    else:
        some = named()
    return [some[k] for k in np.random.default_rng(mark(level)).permutation(len(some))]


def find(effect: str) -> Effect:
    """An effect by key or name. Raises InputError if there is none."""
    every = [*EFFECTS.values(), *each_drive()]
    found = EFFECTS.get(effect) or next((e for e in every if effect in (e.key, e.name)), None)
    if found is None:
        raise InputError(f"there is no law '{effect}'; laws: {', '.join(sorted(EFFECTS))}")
    return found


def choose(level: str, seed: int, effect: str | None) -> tuple[tuple[Effect, ...], tuple[str, ...]]:
    """The effects to hide, and the names excluded from the tool's library.

    Level `unknown` hides an unnamed law and, for every second seed, a law whose name is excluded. Raises
    InputError for an unknown level or effect.
    """
    if level not in LEVELS:
        raise InputError(f"there is no level '{level}'; levels: {', '.join(LEVELS)}")
    if level in NO_EFFECT:
        return (), ()
    if level == "input_not_recorded":
        hides_a_law = {"slope": "slope_not_recorded", "gap": "slipstream"}.get(hidden_input(level, seed))
        return ((EFFECTS[hides_a_law],) if hides_a_law else ()), ()
    if effect is not None:
        found = find(effect)
        return (found,), _taken(found) if level == "unknown" and found.name != "unknown" else ()
    if level == "unknown":
        candidates = nameless() if seed % 2 == 0 else _distinct()
        one = candidates[(seed // 2) % len(candidates)]
        return (one,), () if seed % 2 == 0 else _taken(one)
    candidates = suitable(level)
    first = candidates[seed % len(candidates)]
    if level != "several":
        return (first,), ()
    rng = np.random.default_rng([seed, mark(level), 1])
    return _companions(first, candidates, 2 + int(rng.random() < 0.35), rng), ()


def _taken(effect: Effect) -> tuple[str, ...]:
    return (effect.name, *effect.accepts)


def _distinct() -> list[Effect]:
    """Named laws that no parameter or sensor fault resembles, whose names can therefore be excluded
    fairly."""
    other = {e.name for e in EFFECTS.values() if e.kind != "missing_physics"}
    some = [e for e in named() if not other & set(e.accepts) and e.name not in other]
    return [some[k] for k in np.random.default_rng(mark("unknown")).permutation(len(some))]


def _companions(
    first: Effect, candidates: Sequence[Effect], count: int, rng: np.random.Generator
) -> tuple[Effect, ...]:
    chosen = [first]
    for k in rng.permutation(len(candidates)):
        other = candidates[k]
        clash = any(
            other.name == e.name or other.name in e.accepts or e.name in other.accepts for e in chosen
        )
        together = set(other.trucks).intersection(*(e.trucks for e in chosen))
        if len(chosen) < count and not clash and together and other.key != "slope_not_recorded":
            chosen.append(other)
    return tuple(chosen)
