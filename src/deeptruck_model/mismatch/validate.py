"""Free runs on held-out recordings: the simulator as given, refitted, and corrected."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck
from deeptruck_model.mismatch.correction.improvement import (
    compared,
    free_runs,
    free_windows,
    horizon,
    improvement,
)
from deeptruck_model.mismatch.data.prepared import Prepared
from deeptruck_model.mismatch.discrepancy import kept
from deeptruck_model.mismatch.fit_result import Errors, FitResult, WithoutExogenous
from deeptruck_model.mismatch.model import Made
from deeptruck_model.simulators import Simulator


@dataclass(frozen=True)
class Validated:
    """The corrected simulator, marked as validated or not; the free runs of each simulator by name; and what
    a learned simulator is off by in free runs on its own recordings, m/s (None where that is not known)."""

    corrected: CorrectedTruck
    errors: dict[str, Errors]
    fit: FitResult
    own_error: float | None


def validate(simulator: Simulator, made: Made, held_out: list[Prepared], fitted: list[Prepared]) -> Validated:
    """The benefit of the correction, validated where the held-out error falls significantly, in root mean
    square and in mean absolute value, without signals beyond the protocol too."""
    horizon_s = horizon(held_out or fitted)
    after = made.corrected
    jobs = {"before": simulator, "parameters_only": made.tuned, "after": after}
    driven = free_runs([(truck, held_out) for truck in jobs.values()], horizon_s)
    errors = dict(zip(jobs, driven, strict=True))
    compared_errors = compared(errors)
    gained = improvement(errors) if compared_errors is not None else None
    changed = bool(after.terms or after.moved)
    better = (
        compared_errors is not None
        and gained is not None
        and gained.ci95[0] > 0.0
        and compared_errors.after.speed < compared_errors.before.speed
        and np.abs(errors["after"].speed).mean() < np.abs(errors["before"].speed).mean()
    )
    without = _without_exogenous(after, held_out, horizon_s)
    if compared_errors is not None and without is not None:
        better = better and without.after <= compared_errors.before.speed
    fit = FitResult(
        held_out=tuple(p.recording.name for p in held_out),
        horizon_s=horizon_s,
        windows=len(errors["before"].speed),
        corrected=tuple(sorted({t.effect for t in after.terms} | set(after.moved))),
        validated=changed and bool(better),
        errors=compared_errors,
        improvement=gained,
        refitted={p: round(change, 4) for p, change in after.moved.items()},
        output_error=made.recipe.output_error,
        without_exogenous=without,
        scales_forces=not simulator.parameters(),
    )
    own = own_error(simulator, held_out[0].measured_acceleration, horizon_s) if held_out else None
    return Validated(after.marked(fit.validated), errors, fit, own)


def _without_exogenous(
    after: CorrectedTruck, held_out: list[Prepared], horizon_s: float
) -> WithoutExogenous | None:
    """As whoever drives the corrected simulator has it, with what the protocol carries alone."""
    lacks = after.needs_beyond()
    if not lacks:
        return None
    errors = free_runs([(after, held_out)], horizon_s, exogenous=False)[0]
    return WithoutExogenous(lacks, errors.rmse().speed) if len(errors.speed) else None


def own_error(simulator: Simulator, measured_acceleration: bool, horizon_s: float) -> float | None:
    """Speed error (rms, m/s) of a learned simulator in free runs on the recordings that it keeps; None where
    it keeps none, or has parameters."""
    if simulator.parameters():
        return None
    errors = free_windows(simulator, kept(simulator, measured_acceleration), horizon_s)
    return errors.rmse().speed if len(errors.speed) else None
