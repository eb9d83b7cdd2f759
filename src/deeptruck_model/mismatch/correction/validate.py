"""Free runs on held-out recordings with the simulator as given, refitted, and corrected."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student_t

from deeptruck_core.arrays import Array
from deeptruck_core.signals import SPEED
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck
from deeptruck_model.mismatch.correction.fit_result import Errors, FitResult, WithoutExogenous, strength
from deeptruck_model.mismatch.correction.free_runs import (
    free_run_errors,
    free_runs,
    free_windows,
    horizon,
    improvement,
    interval,
)
from deeptruck_model.mismatch.correction.from_draws import Correction
from deeptruck_model.mismatch.folders import CORRECTION, REFIT
from deeptruck_model.mismatch.posterior.reference_error import reference_drives
from deeptruck_model.mismatch.prepare.drives import PreparedDrives
from deeptruck_model.mismatch.prepare.prepared import Prepared
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.gather import REFIT_PARAMETERS, accepted
from deeptruck_model.mismatch.rules import Limits, Rules
from deeptruck_model.simulators import Simulator, run

PEDALS = 21  # engine commands, of which one about holds a speed
RAISED = 0.1  # relative change of a parameter, by which its effect at high speed is measured


@dataclass(frozen=True)
class Validated:
    """Free runs along held-out drives by simulator, and of the one as given along the `fitted` drives; and
    the error of a learned simulator in free runs on its held-out recordings, m/s (None if not known)."""

    errors: dict[str, Errors]
    judged: FitResult
    reference_error: float | None
    better: frozenset[str]  # simulators that are significantly better than the one as given


def validate(simulator: Simulator, correction: Correction, drives: PreparedDrives, e: Evidence) -> Validated:
    """Run the simulator as given, with refitted parameters only, and corrected; `decide` offers one. Forces
    are stated along the drives of evidence `e`."""
    held_out, fitted = drives.part(held_out=True), drives.part(held_out=False)
    horizon_s = horizon(held_out or fitted)
    after = correction.corrected
    jobs = {"before": simulator, "parameters_only": correction.parameters_only, "after": after}
    driven = free_runs([(truck, held_out) for truck in jobs.values()], horizon_s)
    errors = dict(zip(jobs, driven, strict=True))
    without = _without_exogenous(after, held_out, horizon_s)
    fit = FitResult(
        held_out=tuple(p.recording.name for p in held_out),
        horizon_s=horizon_s,
        windows=len(errors["before"].speed),
        corrected=tuple(sorted({*correction.forces, *after.moved})),
        errors=free_run_errors(errors),
        improvement=improvement(errors) if len(errors["before"].speed) else None,
        corrected_parameters={p: round(change, 4) for p, change in after.moved.items()},
        corrected_intervals={p: x.change_ci95 for p, x in correction.changed.items() if p in after.moved},
        corrected_forces={name: strength(e, force) for name, force in correction.forces.items()},
        forms=tuple(t.effect for t in after.terms if t.effect not in correction.forces),
        refit=correction.refit,
        without_exogenous=without,
        scales_forces=not simulator.parameters(),
        at_high_speed=at_high_speed(simulator, drives),
    )
    reference = (
        error_on_reference(simulator, held_out[0].measured_acceleration, horizon_s) if held_out else None
    )
    along_fitted = free_windows(simulator, fitted, horizon_s)
    return Validated(
        errors | {"fitted": along_fitted}, fit, reference, _those_better(errors, correction, e.rules)
    )


def at_high_speed(simulator: Simulator, drives: PreparedDrives) -> dict[str, float]:
    """The speed (m/s) that each parameter adds per relative change in a free run of the longest horizon, from
    `high_speed` on a level road under the constant engine command that about holds it."""
    own, i = simulator.parameters(), simulator.interface
    named = {name: own[name] for name in REFIT_PARAMETERS if own.get(name) and name != "brake_gain"}
    if not named:
        return {}
    steps = round(Limits.horizons_s[0] / simulator.dt)
    u, w = np.zeros((PEDALS, steps, len(i.u))), np.zeros((PEDALS, steps, len(i.w)))
    most = max(float(np.nanmax(p.u[:, 0])) for p in drives.prepared)
    u[:, :, 0] = np.linspace(0.0, most, PEDALS)[:, None]
    y0 = np.zeros((PEDALS, len(i.y)))
    y0[:, SPEED] = Limits.high_speed
    ends = run(simulator, u, w, y0, None).y[:, -1, SPEED]
    held = int(np.argmin(np.abs(ends - Limits.high_speed)))
    one, out = slice(held, held + 1), {}
    raised, lowered = (accepted(simulator, dict.fromkeys(named, side * RAISED)) for side in (1.0, -1.0))
    for name in named:
        change = raised[name] or lowered[name]  # one at its limit can only be lowered
        if not change:
            continue
        truck = simulator.with_parameters({name: named[name] * (1.0 + change)})
        end = run(truck, u[one], w[one], y0[one], None).y[0, -1, SPEED]
        out[name] = float(end - ends[held]) / change
    return out


def _those_better(errors: Mapping[str, Errors], correction: Correction, rules: Rules) -> frozenset[str]:
    """The simulators that are significantly better than the one as given."""
    trucks = {
        REFIT: ("parameters_only", correction.parameters_only),
        CORRECTION: ("after", correction.corrected),
    }
    return frozenset(
        offer
        for offer, (name, truck) in trucks.items()
        if (truck.terms or truck.moved) and _better(errors, correction, name, rules)
    )


def _better(errors: Mapping[str, Errors], correction: Correction, name: str, rules: Rules) -> bool:
    """Whether the root-mean-square error along held-out drives falls below `better` of that as given, and the
    mean absolute one falls; whether the mean error of runs decreases significantly, or that of drives,
    combined with the fitted drives that were left out in turn; and whether drives do not grow worse in the
    mean, as those do that carried another load."""
    before, after = errors["before"], errors[name]
    if (
        not len(before.speed)
        or after.rmse().speed >= rules.better * before.rmse().speed
        or np.abs(after.speed).mean() >= np.abs(before.speed).mean()
    ):
        return False
    pairs = [
        (before.of_runs()[own].mean(), after.of_runs()[own].mean())
        for own in (before.recording == drive for drive in np.unique(before.recording))
    ]
    if correction.left_out:
        pairs += list(zip(correction.left_out["before"], correction.left_out[name], strict=True))
    ratio = _log_ratio(np.array(pairs), rules)
    return float(ratio.mean()) < 0.0 and (interval(before, after)[0] > 0.0 or _falls(ratio, rules))


def _log_ratio(pairs: Array, rules: Rules) -> Array:
    """Logarithm (drives,) of the ratio of drives' errors (drives, 2), m/s, after to before. What is
    too small for a finding is added to both in quadrature, so that smaller errors hardly count."""
    floored = np.hypot(pairs, rules.drift)
    return np.asarray(np.log(floored[:, 1] / floored[:, 0]))


def _falls(ratio: Array, rules: Rules) -> bool:
    """Whether drives' ratios of errors, as `_log_ratio` gives them, are below `rules.better`, at the
    one-sided confidence `falls`."""
    if len(ratio) < Limits.drives_that_agree:
        return False
    wide = float(student_t.ppf(Limits.falls, len(ratio) - 1)) * ratio.std(ddof=1) / np.sqrt(len(ratio))
    return bool(ratio.mean() + wide < np.log(rules.better))


def _without_exogenous(
    after: CorrectedTruck, held_out: list[Prepared], horizon_s: float
) -> WithoutExogenous | None:
    """Errors of the corrected simulator with only the channels of the protocol, as others will run it."""
    lacks = after.needs_beyond()
    if not lacks:
        return None
    errors = free_runs([(after, held_out)], horizon_s, exogenous=False)[0]
    return WithoutExogenous(lacks, errors.rmse().speed) if len(errors.speed) else None


def error_on_reference(simulator: Simulator, measured_acceleration: bool, horizon_s: float) -> float | None:
    """Rms speed error, m/s, of a learned simulator in free runs on the recordings stored in it; None if it
    has none, or has parameters."""
    if simulator.parameters():
        return None
    errors = free_windows(simulator, reference_drives(simulator, measured_acceleration), horizon_s)
    return errors.rmse().speed if len(errors.speed) else None
