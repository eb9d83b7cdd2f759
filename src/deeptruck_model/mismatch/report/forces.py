"""Forces that no mechanism's own form tells: the slow ones, those whose course is their own, those without a
name, and those whose name is told by likeness."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from deeptruck_model.mismatch.finding import Size
from deeptruck_model.mismatch.mechanisms import LIBRARY, UNNAMED
from deeptruck_model.mismatch.posterior.causes import Cause, Explanation
from deeptruck_model.mismatch.posterior.road_lock import RoadLock
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.sentence import Named, Part, Sentence
from deeptruck_model.mismatch.strength import Strength, acts

ONE_WAY = 0.5  # of its rms that the mean of a force must have, to tell its size
AT_ITS_MOMENTS = "record more signals, and look what else happens when it acts most (the `segments`)"
BY_LIKENESS = "Its name is told by likeness to laws that were seen before"


@dataclass(frozen=True)
class Told:
    """What depends on what kind of cause it is: the sentence, the equation, the sizes, and what to drive."""

    says: Sentence
    equation: str
    parameters: dict[str, Size]
    would_be_told_by: Sentence
    depends_on: tuple[str, ...]
    laws_r2: float | None = None


def strength(cause: Cause, e: Evidence) -> str:
    """How strong a force is where it acts, and for how much of the time."""
    s = strength_of(cause, e)
    told = e.unit.told(s.value / e.unit.scale, "+" if s.one_way else "")
    size = f"{told} on average" if s.one_way else f"{told} rms, forward and back,"
    if s.mostly:
        return size.rstrip(",")
    return f"{size} while it acts, {100.0 * s.share_of_time:.0f} % of the time"


def strength_of(cause: Cause, e: Evidence) -> Strength:
    """The same as numbers."""
    acting = acts(cause.force[e.valid])
    force = e.newtons(cause.force)[e.valid][acting] / e.mass if acting.any() else np.zeros(1)
    mean, rms = float(np.mean(force)), float(np.sqrt(np.mean(force**2)))
    one_way = abs(mean) > ONE_WAY * rms
    return Strength((mean if one_way else rms) * e.unit.scale, e.unit.name, one_way, float(np.mean(acting)))


def slow(cause: Cause) -> Told:
    """A slow force, and what size it would need under each name: sizes decide here, not the fit."""
    needed = cause.needed or {}
    rms = float(np.sqrt(np.mean(cause.force**2)))
    sizes = (
        f"as a slope {100 * needed['road_grade']:.1f} %, as wind {needed['headwind']:.0f} m/s, "
        f"as a change of engine force {100 * needed['torque_derate']:.0f} %"
    )
    m = LIBRARY.get(cause.effect)
    what = m.says if m else "a slow force that no signal predicts"
    units = ("ratio", "m/s", "1")
    return Told(
        Sentence.of(f"{what}: {rms:.3f} m/s^2 rms. It would be {sizes}{_again(cause.road)}"),
        m.equation if m else "F = f(t)",
        {f"rms_as_{n}": Size(v, u) for (n, v), u in zip(needed.items(), units, strict=True)},
        Sentence.of(m.told_by if m else "drive the same stretch in both directions"),
        m.depends_on if m else ("time",),
    )


def _again(road: RoadLock | None) -> str:
    """On how much road a force came again, where it did."""
    if road is None:
        return ""
    ways = [f"on {road.same_way_km:.0f} km driven again the same way"] if road.same_way_km > 0 else []
    if road.other_way_km > 0:
        ways.append(f"on {road.other_way_km:.0f} km driven the other way with its sign turned")
    return (
        f". It comes again {' and '.join(ways)}. Its agreement is {road.agreement:.2f}, "
        f"by chance less than {road.by_chance:.2f} in 99 % of windows"
    )


def time_varying(cause: Cause, e: Evidence) -> Told:
    """An unknown force that no signal predicts and that acts like none of the known ones."""
    near = _nearest(cause, "does not explain how it acts")
    now_and_then = bool(np.mean(cause.force[e.valid] == 0.0) > 0.5)
    return Told(
        Sentence.of(f"{UNNAMED.says}: {strength(cause, e)}", *near),
        UNNAMED.equation,
        {},
        Sentence.of(AT_ITS_MOMENTS if now_and_then else UNNAMED.told_by),
        ("time",) if now_and_then else UNNAMED.depends_on,
    )


def _nearest(cause: Cause, fails: str) -> tuple[Part, ...]:
    """The name nearest to a force without one, and what it fails in where it may not be that force."""
    if not cause.nearest:
        return ()
    if cause.nearest in cause.not_told_from:
        return (". The nearest name is ", Named(cause.nearest))
    return (". The nearest name, ", Named(cause.nearest), f", {fails}")


def unknown(cause: Cause, e: Evidence, explanation: Explanation) -> Told:
    left = explanation.left_over
    if cause.term is None:
        drivers = [name for name, share in left.importance.items() if share > 0.1][:4]
    else:
        drivers = [*cause.term.mechanism.depends_on]
    near = _nearest(cause, "does not explain it")
    one: Part = Named(drivers[0]) if drivers else "one signal"
    says = f"a force that no mechanism of the library explains: {strength(cause, e)}. It varies with "
    return Told(
        Sentence.of(says, *(Sentence.named(drivers) or ("nothing recorded",)), *near),
        f"F = f({', '.join(drivers)})",
        {},
        Sentence.of("drive so that ", one, " changes while the others change little"),
        tuple(drivers),
        left.r2,
    )


def by_likeness(cause: Cause, e: Evidence, explanation: Explanation) -> Told:
    """A force whose name is not that of the form it is modelled by, if it has one."""
    m, laws = LIBRARY[cause.effect], unknown(cause, e, explanation)
    form: tuple[Part, ...] = ("; no form that is known here fits it",)
    if cause.term is not None:
        form = ("; the form that fits it best is that of ", Named(cause.acts_as))
    return replace(
        laws,
        says=Sentence.of(f"{m.says}: {strength(cause, e)}. {BY_LIKENESS}", *form),
        would_be_told_by=Sentence.of(m.told_by),
        laws_r2=laws.laws_r2 if cause.term is None else None,
    )
