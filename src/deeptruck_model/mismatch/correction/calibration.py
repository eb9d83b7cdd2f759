"""Calibrates a physics truck's parameters on recordings, and finds which parameters these do not identify.

All parameters that the recorded truck shares with a truck of the pool are fitted at once, relinearised until
convergence, with the noise and priors of the mismatch tool. No missing effects are fitted: they bias the
parameters, which held-out drives then show.

Changing mass and gains together hardly changes the acceleration, so missing physics could move all of them
far. The mass from a data sheet is more certain than that: it is changed only if held-out drives are then
predicted better, and gains are kept near the given values (another load does not change them).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.stats import t as student_t
from threadpoolctl import threadpool_limits

from deeptruck_core.errors import InputError
from deeptruck_model.mismatch.correction.fit_result import Interval, Rmse
from deeptruck_model.mismatch.correction.free_runs import free_windows, horizon, improvement
from deeptruck_model.mismatch.posterior.regression import FREE, Model, Regression
from deeptruck_model.mismatch.posterior.relinearise import refitted
from deeptruck_model.mismatch.prepare.drives import PreparedDrives, prepare_drives
from deeptruck_model.mismatch.residual.gather import accepted, gather
from deeptruck_model.mismatch.residual.left_out import left_to_compare
from deeptruck_model.mismatch.residual.noise import Z95
from deeptruck_model.mismatch.rules import Limits, Rules
from deeptruck_model.recordings import Recording
from deeptruck_model.trucks import PARAMETERS, PhysicsTruck

PARTS = 10  # of the driving, to see how far they disagree
GAINS = ("torque_gain", "brake_gain")
NO_GRADE = (
    "the truck takes no grade: slopes go into its parameters, so that it is fitted on a level road alone"
)


@dataclass(frozen=True)
class Fitted:
    """A parameter as given and as fitted, with a 95 % interval; None if the drives do not identify it."""

    name: str
    unit: str
    given: float
    value: float
    ci95: Interval | None


@dataclass(frozen=True)
class Calibration:
    """The fitted truck and its parameters, the pairs that these drives identify only jointly, and the errors
    of free runs of `horizon_s` on the held-out recordings. `better` is the 95 % interval of their relative
    improvement, None without a free run."""

    truck: PhysicsTruck
    parameters: tuple[Fitted, ...]
    alike: tuple[tuple[str, str], ...]
    held_out: tuple[str, ...]
    horizon_s: float
    before: Rmse | None
    after: Rmse | None
    better: Interval | None
    caveats: tuple[str, ...]
    mass_held: bool = False

    @property
    def validated(self) -> bool:
        """Whether the fitted truck predicts the held-out recordings significantly better."""
        return self.better is not None and self.better[0] > 0.0


def calibrate(
    truck: PhysicsTruck,
    recordings: Sequence[Recording],
    held_out: Sequence[Recording] = (),
    *,
    seed: int = 0,
    say: Callable[[str], None] = lambda step: None,
    rules: Rules = Rules(),
) -> Calibration:
    """Fit the parameters of a physics truck to recordings; without `held_out` the last 30 % are held out.

    Raises InputError if truck and recordings do not belong together, or the recordings cannot be used.
    """
    with threadpool_limits(1):
        say("checking the data")
        drives = prepare_drives(truck, recordings, held_out, rules)
        if drives.unusable_because:
            raise InputError(f"the truck cannot be fitted to these recordings: {drives.unusable_because}")
        say("driving the truck along the recordings")
        e = gather(truck, drives.prepared, drives.held_out, seed=seed, rules=rules)
        drives, e = left_to_compare(drives, e)
        if drives.unusable_because:
            raise InputError(f"the truck cannot be fitted to these recordings: {drives.unusable_because}")
        say("fitting all parameters")
        regression, model = refitted(truck, drives, e, seed, frozenset(e.sensitivity), say)
        # Deviations hold the evidence temperature: a half of the prior at 6 is this at 9.
        identified = frozenset(p for p in regression.parameters if model.moved_sd(p) < 0.61 * FREE[p])
        if identified != frozenset(e.sensitivity):
            say("fitting those that the drives identify")
            regression, model = refitted(truck, drives, e, seed, identified, say)
        moved = _driven(truck, drives, regression, model, identified)
        if not any("mass" in pair and set(pair) & set(GAINS) for pair in moved.alike):
            return moved
        say("fitting with the mass as given")
        free = identified - {"mass"}
        held = _driven(truck, drives, *refitted(truck, drives, e, seed, free, say), free)
        nearer = all(_off(moved, gain) <= _off(held, gain) + Limits.gain_farther for gain in GAINS)
        saved = (_saves(drives, other, moved.truck) for other in (held.truck, truck))
        if nearer and all(x > Limits.mass_saves for x in saved):
            return moved
        return replace(held, mass_held=True)


def _off(found: Calibration, name: str) -> float:
    """Magnitude of a fitted parameter's relative change from its given value; 0 if it was not fitted."""
    return next((abs(p.value / p.given - 1.0) for p in found.parameters if p.name == name), 0.0)


def _saves(drives: PreparedDrives, held: PhysicsTruck, moved: PhysicsTruck) -> float:
    """The share of the held-out speed error that is removed by changing the mass: the lower end of its 95 %
    interval; 0 without a free run."""
    along = drives.part(held_out=True)
    long = horizon(along)
    errors = {name: free_windows(t, along, long) for name, t in (("before", held), ("after", moved))}
    if not len(errors["before"].speed):
        return 0.0
    interval = improvement({**errors, "parameters_only": errors["before"]}).ci95
    return 0.0 if interval is None else interval[0]


def _driven(
    truck: PhysicsTruck,
    drives: PreparedDrives,
    regression: Regression,
    model: Model,
    identified: frozenset[str],
) -> Calibration:
    change = {p: regression.e.total_change(p, model.moved(p)) for p in identified}
    own = truck.parameters()
    fitted = truck.with_parameters({p: own[p] * (1.0 + x) for p, x in accepted(truck, change).items()})
    held = drives.part(held_out=True)
    long = horizon(held)
    errors = {name: free_windows(t, held, long) for name, t in (("before", truck), ("after", fitted))}
    some = len(errors["before"].speed) > 0
    spread = _jackknife(regression, identified)
    gained = improvement({**errors, "parameters_only": errors["before"]}).ci95 if some else None
    return Calibration(
        truck=fitted,
        parameters=tuple(
            _parameter(p, truck, fitted, regression, model, identified, spread) for p in regression.parameters
        ),
        alike=_alike(model, sorted(identified)),
        held_out=tuple(p.recording.name for p in held),
        horizon_s=long,
        before=errors["before"].rmse() if some else None,
        after=errors["after"].rmse() if some else None,
        better=gained,
        caveats=(*drives.caveats, *([] if truck.interface.grade else [NO_GRADE])),
    )


def _parameter(
    name: str,
    truck: PhysicsTruck,
    fitted: PhysicsTruck,
    regression: Regression,
    model: Model,
    identified: frozenset[str],
    spread: Mapping[str, float],
) -> Fitted:
    given, value = truck.parameters()[name], fitted.parameters()[name]
    about = given * (1.0 + regression.e.moved.get(name, 0.0))  # the value whose relative change was fitted
    wide = Z95 * about * max(model.moved_sd(name), spread.get(name, 0.0))
    interval = (value - wide, value + wide) if name in identified else None
    return Fitted(name, PARAMETERS[name].unit, given, value, interval)


def _jackknife(regression: Regression, identified: frozenset[str]) -> dict[str, float]:
    """Sd of the relative changes between parts of the driving, which the noise within parts does not show.

    Each of PARTS is left out in turn (delete-a-group jackknife: Kott, Journal of Official Statistics 17,
    2001). Parts have equal time, because there are too few drives to use as parts.
    """
    rows = np.flatnonzero(regression.e.valid)
    part = np.full(len(regression.e), -1)
    part[rows] = np.arange(len(rows)) * PARTS // max(len(rows), 1)
    fits = [Regression(regression.e, only=part != k).model((), identified) for k in range(PARTS)]
    changes = {p: np.array([fit.moved(p) for fit in fits]) for p in identified}
    wider = float(student_t.ppf(0.975, PARTS - 1)) / Z95
    return {p: wider * float(np.sqrt((PARTS - 1) * np.var(x))) for p, x in changes.items()}


def _alike(model: Model, names: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """Pairs of free parameters with strongly correlated errors."""
    layout = dict(model.layout)
    at = {p: layout[f"parameter:{p}"].start for p in names}
    sd = np.sqrt(np.diag(model.fit.covariance))
    return tuple(
        (p, q)
        for p, q in combinations(names, 2)
        if abs(model.fit.covariance[at[p], at[q]]) > Limits.pair_correlation * sd[at[p]] * sd[at[q]]
    )
