"""The mismatch tool from recordings to verdict, in the order of computation."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from deeptruck_core.errors import InputError
from deeptruck_core.terminal.progress import steps
from deeptruck_model import calls
from deeptruck_model.mismatch.correction.from_draws import Correction, correct, uncorrected
from deeptruck_model.mismatch.correction.validate import Validated, validate
from deeptruck_model.mismatch.folders import CORRECTION, REFIT
from deeptruck_model.mismatch.mechanisms import LIBRARY, Mechanism
from deeptruck_model.mismatch.mechanisms.families import check_excluded, joined
from deeptruck_model.mismatch.mechanisms.own import check_extras, checked, not_compared
from deeptruck_model.mismatch.posterior.budget import budget
from deeptruck_model.mismatch.posterior.events import with_events
from deeptruck_model.mismatch.posterior.names import Compared, names
from deeptruck_model.mismatch.posterior.reference_error import with_reference_error
from deeptruck_model.mismatch.posterior.relinearise import at_estimated_parameters
from deeptruck_model.mismatch.prepare.drives import PreparedDrives, Span, prepare_drives
from deeptruck_model.mismatch.report.found import Mismatch
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.gather import COMPARING, gather
from deeptruck_model.mismatch.residual.left_out import left_to_compare
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.mismatch.verdict import wording
from deeptruck_model.mismatch.verdict.decide import Stated, conclude, name_tree, tolerated, unusable
from deeptruck_model.mismatch.verdict.findings import findings
from deeptruck_model.mismatch.verdict.road import road
from deeptruck_model.mismatch.verdict.where import located, with_channels, witnesses
from deeptruck_model.recordings import Recording
from deeptruck_model.recordings.several import Drives, check_paths_apart, drives
from deeptruck_model.recordings.splits import refuse_shared
from deeptruck_model.simulators import MinimalSimulator, Simulator, completed
from deeptruck_model.simulators.running import said_of_rollout


def find_mismatch(
    simulator: MinimalSimulator | str | Path,
    recordings: Drives,
    held_out: Drives = (),
    *,
    seed: int = 0,
    exclude: Sequence[str] = (),
    without: Sequence[Span] = (),
    say: Callable[[str], None] | None = None,
    rules: Rules = Rules(),
    mass_kg: float | None = None,
    mechanisms: Sequence[Mechanism] = (),
) -> Mismatch:
    """Compare a simulator with recordings. If the data do not suffice, the verdict is `undetermined`, or
    `measurement_fault` if a sensor is wrong.

    The simulator may be named as for `load`, recordings by paths of bags. `say` is called with each step;
    without it a terminal shows them.

    `exclude` removes effects from the library, `mechanisms` are added to it for this comparison, `without`
    removes rows from the recordings. `mass_kg` is the mass of a
    simulator that does not state its mass: without it forces are per kilogram. Raises InputError if simulator
    and recordings do not belong together, for a held-out drive that is also fitted, for an unknown effect,
    for a mass that is impossible or differs from the simulator's, and for a simulator whose acceleration no
    vehicle has.
    """
    user_mechanisms = checked(mechanisms, LIBRARY.values())
    joined(user_mechanisms)
    truck, to_fit, to_hold_out = called(
        simulator, recordings, held_out, seed=seed, exclude=exclude, without=without, say=say, rules=rules,
        mass_kg=mass_kg,
    )  # fmt: skip
    check_extras(user_mechanisms, [*to_fit, *to_hold_out])
    with threadpool_limits(1), steps(say, "checking the data") as say:
        c = compared(
            truck, to_fit, to_hold_out, seed=seed, exclude=exclude, without=without, say=say, rules=rules,
            mass_kg=mass_kg, mechanisms=user_mechanisms,
        )  # fmt: skip
        if not isinstance(c, Compared):
            return Mismatch(unusable(c), None, {}, None, c.prepared)
        return concluded(truck, c, rules, say)


def concluded(truck: Simulator, c: Compared, rules: Rules, say: Callable[[str], None]) -> Mismatch:
    """The second half of `find_mismatch`: a correction, free runs with it, and the verdict."""
    say("correcting the simulator and driving it free")
    try:
        correction = correct(truck, c)
    except Exception as error:  # of a simulator of somebody else, say: what was compared is not lost
        correction = uncorrected(truck, f"nothing was corrected: {type(error).__name__}, {error}")
    driven = validate(truck, correction, c.drives, c.fitted)
    verdict = conclude(c, correction, driven, stated(c, correction, driven))
    return Mismatch(
        verdict,
        c.given,
        driven.errors,
        correction.corrected.marked(verdict.offered == CORRECTION),
        c.drives.prepared,
        correction.parameters_only.marked(verdict.validated and REFIT in driven.better),
    )


def stated(c: Compared, correction: Correction, driven: Validated) -> Stated:
    """The findings, where they act, and what recorded channels say of what has no name."""
    slope = road(c.regression)
    error, tolerance = tolerated(c, driven)
    found = findings(c, correction, slope, error, tolerance)
    nodes = name_tree(c, slope)
    channels = witnesses(c.regression, c.drives.prepared, c.budget)
    seen = with_channels(c.drives.prepared, c.events)
    return Stated(found, *located(c.fitted, found), seen, nodes, channels)


def compared(
    simulator: Simulator,
    recordings: Sequence[Recording],
    held_out: Sequence[Recording] = (),
    *,
    seed: int = 0,
    exclude: Sequence[str] = (),
    without: Sequence[Span] = (),
    say: Callable[[str], None] = lambda step: None,
    rules: Rules = Rules(),
    mass_kg: float | None = None,
    mechanisms: tuple[Mechanism, ...] = (),
) -> Compared | PreparedDrives:
    """The first half of `find_mismatch`: names and budget, without a correction; drives that are unusable if
    nothing can be compared. Raises InputError as it does."""
    drives = prepare_drives(simulator, recordings, held_out, rules, without=without, mass_kg=mass_kg)
    if drives.unusable_because:
        return drives

    say("driving the simulator along the recordings")
    e = gather(simulator, drives.prepared, drives.held_out, seed=seed, rules=rules, mass_kg=mass_kg, say=say)
    drives, e = left_to_compare(drives, replace(e, user_mechanisms=mechanisms))
    if drives.unusable_because:
        return drives
    e = with_reference_error(simulator, e, drives.prepared[0].measured_acceleration, seed)

    say(COMPARING)
    look = at_estimated_parameters(simulator, drives, e, seed, exclude, say)
    p, events = with_events(look, seed)
    regression = p.regression
    parameters = dict(simulator.parameters())
    remarks = (
        *_caveats(simulator, regression.e),
        *not_compared(mechanisms, LIBRARY.values(), regression.library, regression.e),
    )
    found = names(p)
    return Compared(parameters, drives, e, p, found, budget(p, e, found.given), events, remarks)


def _caveats(simulator: Simulator, e: Evidence) -> Iterator[str]:
    """Remarks on the simulator."""
    if says := said_of_rollout(simulator):
        yield f"{says}; see 'deeptruck-model check-simulator'"
    if e.reference is None and not e.known_physics:
        yield wording.COUNTS_AS_LEARNED
    if not e.mass_known:
        yield wording.WITHOUT_MASS


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
    calls.mass(mass_kg)
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
