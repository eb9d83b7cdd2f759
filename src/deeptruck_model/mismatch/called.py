"""Checks the arguments of `find_mismatch` before anything is computed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from deeptruck_core.errors import InputError
from deeptruck_model.checks import calls, mass
from deeptruck_model.mismatch.excluded import check_excluded
from deeptruck_model.mismatch.prepare import Span
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.recordings import Recording
from deeptruck_model.recordings.several import check_paths_apart, drives
from deeptruck_model.recordings.splits import refuse_shared
from deeptruck_model.simulators import Simulator, completed


def called(
    simulator: Any,
    recordings: Any,
    held_out: Any,
    *,
    seed: Any,
    exclude: Any,
    without: Any,
    say: Any,
    rules: Any,
    mass_kg: Any,
) -> tuple[Simulator, list[Recording], list[Recording]]:
    """The simulator, and the recordings to fit and to hold out, read from bags if these were given.

    Raises InputError for invalid arguments.
    """
    calls.integer(seed, "seed")
    calls.instance(rules, Rules, "rules", "change single ones by Rules(speed_scale=...)")
    if say is not None and not isinstance(say, Callable):  # type: ignore[arg-type]
        raise InputError(f"say must be a function of a text, such as print, not {calls.shown(say)}")
    if mass_kg is not None:
        calls.number(mass_kg, "mass_kg", "kg")
    if isinstance(exclude, str):
        raise InputError(f"exclude must be a list of effects: exclude=[{exclude!r}]")
    check_excluded(exclude)
    check_paths_apart(recordings, held_out)
    truck = completed(simulator)
    _check_mass(truck, mass_kg)
    rate = 1.0 / truck.dt
    fit = drives(recordings, "recordings", rate_hz=rate, among=held_out)
    held = drives(held_out, "held_out", rate_hz=rate, among=recordings)
    refuse_shared(fit, held)
    _check_spans(without, [*fit, *held])
    return truck, fit, held


def _check_mass(simulator: Simulator, mass_kg: float | None) -> None:
    if mass_kg is None:
        return
    mass(mass_kg)
    own = simulator.parameters().get("mass")
    if own is not None and abs(mass_kg - own) > 1e-6 * own:
        raise InputError(f"the simulator's own mass is {own:g} kg; leave --mass-kg out, or set its parameter")


def _check_spans(without: Any, recordings: Sequence[Recording]) -> None:
    if not isinstance(without, Sequence) or not all(isinstance(span, Span) for span in without):
        raise InputError(f"without must be a list of Span(NAME, FROM_S, TO_S), not {calls.shown(without)}")
    names = list(dict.fromkeys(r.name for r in recordings))
    for span in without:
        if span.recording not in names:
            raise InputError(
                f"there is no recording '{span.recording}' to leave rows out of; there are {', '.join(names)}"
            )
