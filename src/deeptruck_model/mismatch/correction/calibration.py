"""Calibrates a physics truck's parameters on recordings, and finds which parameters these do not identify.

All parameters that the recorded truck shares with a truck of the pool are fitted at once by exact runs, with
the noise and priors of the mismatch tool. No missing effects are fitted: they bias the
parameters, which held-out drives then show.

Changing mass and gains together hardly changes the acceleration, so missing physics could move all of them
far. The mass from a data sheet is more certain than that: it is changed only if held-out drives are then
predicted better, and gains are kept near the given values (another load does not change them).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from threadpoolctl import threadpool_limits

from deeptruck_core.errors import InputError
from deeptruck_model.mismatch.correction.fit_result import Interval, Rmse
from deeptruck_model.mismatch.correction.free_runs import free_windows, horizon, improvement
from deeptruck_model.mismatch.posterior import exact
from deeptruck_model.mismatch.posterior.posterior import first_look
from deeptruck_model.mismatch.posterior.regression import FREE, Regression
from deeptruck_model.mismatch.prepare.drives import PreparedDrives, prepare_drives
from deeptruck_model.mismatch.residual.gather import gather
from deeptruck_model.mismatch.residual.left_out import left_to_compare
from deeptruck_model.mismatch.residual.noise import Z95
from deeptruck_model.mismatch.rules import Limits, Rules
from deeptruck_model.recordings import Recording
from deeptruck_model.trucks import PARAMETERS, PhysicsTruck

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
        look = first_look(Regression(e.to_fit()), seed=seed)
        every = np.ones(len(look.draws.states), dtype=bool)

        def fitted(free: Sequence[str]) -> exact.Fitted:
            return exact.Exact(truck, drives.prepared, look, every, free).fit()

        whole = fitted(tuple(e.sensitivity))
        identified = [p for p in e.sensitivity if whole.change(p)[1] < Limits.identified * FREE[p]]
        moved = _driven(truck, drives, whole if len(identified) == len(e.sensitivity) else fitted(identified))
        if not any("mass" in pair and set(pair) & set(GAINS) for pair in moved.alike):
            return moved
        say("fitting with the mass as given")
        held = _driven(truck, drives, fitted([p for p in identified if p != "mass"]))
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


def _driven(truck: PhysicsTruck, drives: PreparedDrives, found: exact.Fitted) -> Calibration:
    own, moved = truck.parameters(), found.setting.moved
    fitted = truck.with_parameters({p: own[p] * (1.0 + x) for p, x in moved.items()})
    held = drives.part(held_out=True)
    long = horizon(held)
    errors = {name: free_windows(t, held, long) for name, t in (("before", truck), ("after", fitted))}
    some = len(errors["before"].speed) > 0
    gained = improvement({**errors, "parameters_only": errors["before"]}).ci95 if some else None
    return Calibration(
        truck=fitted,
        parameters=tuple(_parameter(p, truck, fitted, found) for p in found.of.e.sensitivity),
        alike=_alike(found),
        held_out=tuple(p.recording.name for p in held),
        horizon_s=long,
        before=errors["before"].rmse() if some else None,
        after=errors["after"].rmse() if some else None,
        better=gained,
        caveats=(*drives.caveats, *([] if truck.interface.grade else [NO_GRADE])),
    )


def _parameter(name: str, truck: PhysicsTruck, fitted: PhysicsTruck, found: exact.Fitted) -> Fitted:
    given, value = truck.parameters()[name], fitted.parameters()[name]
    wide = Z95 * given * found.change(name)[1] if found.places(name) else None
    return Fitted(
        name, PARAMETERS[name].unit, given, value, None if wide is None else (value - wide, value + wide)
    )


def _alike(found: exact.Fitted) -> tuple[tuple[str, str], ...]:
    """Pairs of free parameters with strongly correlated errors."""
    names = [u.of for u in found.of.unknown]
    covariance = np.linalg.inv(found.H)[: len(names), : len(names)]
    sd = np.sqrt(np.diag(covariance))
    related = np.abs(covariance) > Limits.pair_correlation * np.outer(sd, sd)
    return tuple((names[i], names[j]) for i, j in combinations(range(len(names)), 2) if related[i, j])
