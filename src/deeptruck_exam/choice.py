"""Which effects a case hides: by level, seed and forms, or as asked."""

from __future__ import annotations

import zlib

import numpy as np

from deeptruck_exam.effects import EFFECTS, named, of_family, of_kind, unknown
from deeptruck_exam.effects.planting import ALL, Effect
from deeptruck_model.errors import InputError


def mark(level: str, forms: str) -> int:
    """Mixed into every draw, so that equal seeds of other levels are other worlds."""
    return zlib.crc32(f"{level}, {forms} forms".encode())


def suitable(level: str, forms: str = ALL) -> list[Effect]:
    """Effects a level may plant, in an order of its own."""
    if level == "nothing_missing":
        return []
    if level in ("measurement_fault", "parameter_error"):
        return _in_order(of_kind(level, forms), level, forms)
    some = named(forms)
    if level == "confounded":
        some = [e for e in some if e.gateable and e.name not in ("payload_change", "road_surface")]
    if level == "rare":
        some = [e for e in some if e.gateable or e.name.startswith("command")]
    return _in_order(some, level, forms)


def _in_order(effects: list[Effect], level: str, forms: str) -> list[Effect]:
    """The order in which seeds go through the effects: else one seed would hide one effect at every
    level."""
    return [effects[k] for k in np.random.default_rng(mark(level, forms)).permutation(len(effects))]


def _leave_one_out(forms: str) -> list[Effect]:
    """Named effects that no parameter or fault of the measurement imitates: leaving out their name is
    fair."""
    other = {e.name for e in EFFECTS.values() if e.kind != "missing_physics"}
    return [e for e in named(forms) if not other & set(e.accepts) and e.name not in other]


def _find(effect: str, forms: str) -> Effect:
    """By key or name among the forms, else by key among all."""
    some = of_family(forms)
    found = next((e for e in some if e.key == effect), None) or next(
        (e for e in some if e.name == effect), EFFECTS.get(effect)
    )
    if found is None:
        raise InputError(f"there is no hidden effect '{effect}'; effects: {', '.join(sorted(EFFECTS))}")
    return found


def choose_effects(
    level: str, seed: int, effect: str | None, forms: str
) -> tuple[tuple[Effect, ...], tuple[str, ...]]:
    """The effects to hide, and the names the tool is to be without. Raises InputError for unknown forms."""
    of_family(forms)
    if level == "nothing_missing":
        return (), ()
    if effect is not None:
        found = _find(effect, forms)
        leave_out = level == "not_in_library" and found.name != "unknown"
        return (found,), ((found.name, *found.accepts) if leave_out else ())
    if level == "not_in_library":
        candidates = unknown(forms) if seed % 2 == 0 else _in_order(_leave_one_out(forms), level, forms)
        one = candidates[(seed // 2) % len(candidates)]
        return (one,), (() if seed % 2 == 0 else (one.name, *one.accepts))
    candidates = suitable(level, forms)
    first = candidates[seed % len(candidates)]
    if level != "several":
        return (first,), ()
    rng = np.random.default_rng([seed, mark(level, forms), 1])
    return _companions(first, candidates, 2 + int(rng.random() < 0.35), rng), ()


def _companions(
    first: Effect, candidates: list[Effect], count: int, rng: np.random.Generator
) -> tuple[Effect, ...]:
    chosen = [first]
    for k in rng.permutation(len(candidates)):
        other = candidates[k]
        clash = any(
            other.name == e.name or other.name in e.accepts or e.name in other.accepts for e in chosen
        )
        together = set(other.trucks).intersection(*(e.trucks for e in chosen))
        if len(chosen) < count and not clash and together and other.key != "road_grade":
            chosen.append(other)
    return tuple(chosen)
