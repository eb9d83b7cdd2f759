"""The mismatch tool from recordings to verdict, in the order of computation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from deeptruck_model import overall_ratios
from deeptruck_model.checks import mass
from deeptruck_model.errors import InputError
from deeptruck_model.mismatch import unrecorded
from deeptruck_model.mismatch.budget import budget
from deeptruck_model.mismatch.called import called
from deeptruck_model.mismatch.comparison import Compared, Uncompared
from deeptruck_model.mismatch.conclude import conclude, useless
from deeptruck_model.mismatch.correction.improvement import free_windows
from deeptruck_model.mismatch.data.prepared import too_little
from deeptruck_model.mismatch.discrepancy import allowed_for
from deeptruck_model.mismatch.events import events
from deeptruck_model.mismatch.excluded import check_excluded
from deeptruck_model.mismatch.folders import AS_GIVEN, CORRECTION
from deeptruck_model.mismatch.model import correct
from deeptruck_model.mismatch.names import names
from deeptruck_model.mismatch.nuisance import about_fitting_parameters
from deeptruck_model.mismatch.posterior.kernels import without as leaving_out
from deeptruck_model.mismatch.posterior.posterior import posterior
from deeptruck_model.mismatch.prepare import Span, prepared, with_rejection
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.forced import forgotten
from deeptruck_model.mismatch.residual.gather import gather
from deeptruck_model.mismatch.result import Mismatch
from deeptruck_model.mismatch.road import road
from deeptruck_model.mismatch.rules import Limits, Rules
from deeptruck_model.mismatch.validate import validate
from deeptruck_model.mismatch.witnesses import witnesses
from deeptruck_model.progress_steps import steps
from deeptruck_model.recordings import Recording
from deeptruck_model.recordings.given import Drives
from deeptruck_model.simulators import MinimalSimulator, Simulator
from deeptruck_model.vehicle_kinds import IMPOSSIBLE_ACCELERATION

IMPOSSIBLE = (
    "the simulator answers with more than {most:g} m/s^2 in {share:.2g} % of samples, as no vehicle does; "
    "see 'deeptruck-model check-simulator'"
)
FORGETS = (
    "the simulator has no force() and starts anew at each recorded response, which changes its own "
    "acceleration by {share:.0%}: what it forgets would be named as what it lacks. Add force(state, y), "
    "which keeps gear, boost and brake pressure"
)
OTHER_GEAR = "the simulator drives in another gear than was recorded or follows from the engine speed"


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
) -> Mismatch:
    """Compare a simulator with recordings. If the data do not suffice, the verdict is `undetermined`, or
    `measurement_fault` if a sensor is wrong.

    The simulator may be named as for `load`, recordings by paths of bags. `say` is called with each step;
    without it a terminal shows them.

    `exclude` removes effects from the library, `without` rows from the recordings. `mass_kg` is the mass of a
    simulator that does not state its mass: without it forces are per kilogram. Raises InputError if simulator
    and recordings do not belong together, for a held-out drive that is also fitted, for an unknown effect,
    for a mass that is impossible or differs from the simulator's, and for a simulator whose acceleration no
    vehicle has.
    """
    truck, fit, held = called(
        simulator, recordings, held_out, seed=seed, exclude=exclude, without=without, say=say, rules=rules,
        mass_kg=mass_kg,
    )  # fmt: skip
    check_excluded(exclude)
    _check_mass(truck, mass_kg)
    with threadpool_limits(1), steps(say, "checking the data") as say:
        c = compared(
            truck, fit, held, seed=seed, exclude=exclude, without=without, say=say,
            rules=rules, mass_kg=mass_kg,
        )  # fmt: skip
        if isinstance(c, Uncompared):
            return Mismatch(useless(c.drives, c.missing), None, {}, None, c.drives.prepared)
        slow_road = road(c.search.e.everywhere())
        seen_by = witnesses(c.search, c.drives.prepared, c.budget, rules)

        say("correcting the simulator and driving it free")
        made = correct(truck, c.posterior, rules)
        driven = validate(truck, made, c.drives.part(held_out=True), c.drives.part(held_out=False))
        verdict = conclude(c, slow_road, seen_by, made, driven, rules)
        along_fitted = free_windows(truck, c.drives.part(held_out=False), driven.fit.horizon_s)
    evidence = replace(c.search.e.everywhere(), residual=c.residual)  # of the simulator as given
    offered = verdict.fit.offered if verdict.fit is not None else AS_GIVEN
    return Mismatch(
        verdict,
        evidence,
        {**driven.errors, "fitted": along_fitted},
        driven.corrected.marked(offered == CORRECTION),
        c.drives.prepared,
        driven.refitted.marked(verdict.validated and driven.refit_better),
    )


def compared(
    simulator: Simulator,
    recordings: Sequence[Recording],
    held_out: Sequence[Recording] = (),
    *,
    sets_aside: bool = True,
    seed: int = 0,
    exclude: Sequence[str] = (),
    without: Sequence[Span] = (),
    say: Callable[[str], None] = lambda step: None,
    rules: Rules = Rules(),
    mass_kg: float | None = None,
) -> Compared | Uncompared:
    """The first half of `find_mismatch`: names and budget, without a correction. Raises InputError as it
    does.

    Without `sets_aside` all recordings are fitted if none is held out.
    """
    say("checking the data")
    overall_ratios.check(simulator, [*recordings, *held_out])
    drives = prepared(simulator, recordings, held_out, rules, sets_aside=sets_aside, without=without)
    stated = mass_kg is not None or "mass" in simulator.parameters()
    missing = unrecorded.inputs([*recordings, *held_out], mass_known=stated)
    if drives.useless:
        return Uncompared(drives, missing)
    if (lost := forgotten(simulator, drives.part(held_out=False))) > Limits.forgotten:
        return Uncompared(replace(drives, useless=FORGETS.format(share=lost)), missing)

    say("driving the simulator along the recordings")
    e = gather(
        simulator,
        drives.prepared,
        drives.held_out,
        seed=seed,
        rules=rules,
        mass_kg=mass_kg,
        reruns_held_out=False,
    )
    _check_possible(e)
    drives = with_rejection(drives, OTHER_GEAR, e.other_gear)
    if little := too_little(e):
        return Uncompared(replace(drives, useless=little), missing)
    hidden, gain = unrecorded.braking(e, rules)
    e = replace(e, valid=e.valid & ~hidden)
    missing = unrecorded.with_braking(missing, e, hidden, gain)
    e = allowed_for(simulator, e, drives.prepared[0].measured_acceleration, seed)

    say("comparing every mechanism with what the simulator is off by")
    search = about_fitting_parameters(simulator, drives, e, hidden, seed, exclude, say)
    found = posterior(search, rules, seed=seed)
    happened = events(found, seed)
    if happened:  # what acts for seconds is left out of the fit of what acts always
        rows = np.zeros(len(e), dtype=bool)
        for event in happened:
            rows[event.start : event.stop] = True
        found = posterior(leaving_out(search, rows), rules, seed=seed, noise=found.noise)
    parts = budget(found, hidden & ~e.held_out, e)
    behind = unrecorded.names_behind([*recordings, *held_out], missing)
    return Compared(
        dict(simulator.parameters()),
        drives,
        missing,
        e.residual,
        found,
        names(found, rules, happened),
        parts,
        behind,
        happened,
    )


def _check_mass(simulator: Simulator, mass_kg: float | None) -> None:
    if mass_kg is None:
        return
    mass(mass_kg)
    own = simulator.parameters().get("mass")
    if own is not None and abs(mass_kg - own) > 1e-6 * own:
        raise InputError(f"the simulator's own mass is {own:g} kg; leave --mass-kg out, or set its parameter")


def _check_possible(e: Evidence) -> None:
    """Raises InputError if the simulator's response is impossible for any vehicle."""
    beyond = float(np.mean(np.abs(e.simulated[e.valid]) > IMPOSSIBLE_ACCELERATION)) if e.valid.any() else 0.0
    if beyond > Limits.no_vehicle:
        raise InputError(IMPOSSIBLE.format(most=IMPOSSIBLE_ACCELERATION, share=100.0 * beyond))
