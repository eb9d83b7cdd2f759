"""Types for errors in free runs and the certainty of their improvement; `FitResult.to_json` is `fit` of
verdict.json."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.folders import AS_GIVEN, CORRECTION
from deeptruck_model.mismatch.posterior.next_pass import NextPass

Array = NDArray[np.float64]
Interval = tuple[float, float]

LEAST = 1e-3  # m/s; errors this small are as good as none, and none can be no improvement


@dataclass(frozen=True)
class Errors:
    """Errors of free windows, (windows, steps), and the recording and sample each begins at."""

    speed: Array
    acceleration: Array
    recording: NDArray[np.intp]
    start: NDArray[np.intp]

    def rmse(self) -> Rmse:
        """Over all windows and steps."""
        speed, acceleration = (float(np.sqrt(np.mean(x**2))) for x in (self.speed, self.acceleration))
        return Rmse(speed, acceleration)

    def of_runs(self) -> Array:
        """Speed error of each run, rms in m/s, (windows,)."""
        return np.asarray(np.sqrt(np.mean(self.speed**2, axis=1) + LEAST**2))


@dataclass(frozen=True)
class Rmse:
    """Of speed (m/s) and acceleration (m/s^2) in free runs."""

    speed: float
    acceleration: float

    def to_json(self) -> dict[str, float]:
        """An entry of `fit`."""
        return {"speed_rmse": self.speed, "acceleration_rmse": self.acceleration}

    @staticmethod
    def read(entry: Mapping[str, float]) -> Rmse:
        """An entry of `fit` of verdict.json."""
        return Rmse(entry["speed_rmse"], entry["acceleration_rmse"])


@dataclass(frozen=True)
class Compared:
    """Errors of the simulators in the same free runs: as given, with all parameters refitted and no name,
    and corrected."""

    before: Rmse
    parameters_only: Rmse
    after: Rmse


@dataclass(frozen=True)
class Improvement:
    """95 % intervals of the relative improvement of the speed error, over that many recordings."""

    ci95: Interval
    over_parameters_ci95: Interval
    recordings: int

    def to_json(self) -> dict[str, Any]:
        """Its entries of `fit`."""
        return {
            "improvement_ci95": self.ci95,
            "improvement_over_parameters_ci95": self.over_parameters_ci95,
            "improvement_recordings": self.recordings,
        }

    @staticmethod
    def read(fit: Mapping[str, Any]) -> Improvement:
        """From `fit` of verdict.json."""
        (a, b), (c, d) = fit["improvement_ci95"], fit["improvement_over_parameters_ci95"]
        return Improvement((a, b), (c, d), fit["improvement_recordings"])


@dataclass(frozen=True)
class Refitted:
    """A parameter that is refitted alone: its relative `change` from the simulator as given and the change's
    95 % interval, and its value and interval in `unit` where the simulator states it."""

    change: float
    change_ci95: Interval
    unit: str = "1"
    value: float | None = None
    ci95: Interval | None = None

    def to_json(self) -> dict[str, Any]:
        """An entry of `fit.refit`."""
        out: dict[str, Any] = {"relative": self.change, "relative_ci95": self.change_ci95}
        if self.value is not None:
            out |= {"value": self.value, "unit": self.unit, "ci95": self.ci95}
        return out

    @staticmethod
    def read(entry: Mapping[str, Any]) -> Refitted:
        """An entry of `fit.refit` of verdict.json."""
        low, high = entry["relative_ci95"]
        own = entry.get("ci95")
        return Refitted(
            entry["relative"],
            (low, high),
            entry.get("unit", "1"),
            entry.get("value"),
            (own[0], own[1]) if own else None,
        )


@dataclass(frozen=True)
class WithoutExogenous:
    """Speed error after a correction, rms in m/s, where the `signals` that it needs beyond the protocol, such
    as a gap, are not passed to it: they count as absent."""

    signals: tuple[str, ...]
    after: float

    def to_json(self) -> dict[str, Any]:
        """`fit.without_exogenous`."""
        return {"signals": list(self.signals), "after": self.after}

    @staticmethod
    def read(entry: Mapping[str, Any] | None) -> WithoutExogenous | None:
        """From `fit.without_exogenous`; None where there is none."""
        return WithoutExogenous(tuple(entry["signals"]), entry["after"]) if entry else None


@dataclass(frozen=True)
class FitResult:
    """What the correction does for `windows` free runs of `horizon_s` on the held-out recordings.

    `errors` and `improvement` are None where no recording is long enough for a free run.
    """

    held_out: tuple[str, ...]
    horizon_s: float
    windows: int
    corrected: tuple[str, ...]  # effects and parameters that the corrected simulator holds
    validated: bool
    errors: Compared | None = None
    improvement: Improvement | None = None
    refitted: Mapping[str, float] = field(default_factory=dict)  # relative changes of its parameters
    output_error: bool = False  # whether sizes are those of least speed error, not the most probable ones
    next_pass: NextPass | None = None  # of a road that two passes share: what one predicts of the other
    without_exogenous: WithoutExogenous | None = None  # None where it needs nothing beyond the protocol
    scales_forces: bool = False  # the simulator has no parameters: what refits them scales its forces instead
    offered: str = AS_GIVEN  # the best along held-out drives; `validated` where that is not the one as given
    refit: Mapping[str, Refitted] = field(default_factory=dict)  # all parameters, refitted alone

    def to_json(self) -> dict[str, Any]:
        """`fit`."""
        names = ("held_out", "horizon_s", "windows", "corrected")
        out = {name: getattr(self, name) for name in names}
        if self.refitted:
            out["refitted"] = dict(self.refitted)
        if self.output_error:
            out["output_error"] = True
        if self.scales_forces:
            out["scales_forces"] = True
        if self.next_pass is not None:
            out["next_pass"] = self.next_pass.to_json()
        if self.without_exogenous is not None:
            out["without_exogenous"] = self.without_exogenous.to_json()
        if self.errors is not None:
            out |= {name: rmse.to_json() for name, rmse in vars(self.errors).items()}
        if self.improvement is not None:
            out |= self.improvement.to_json()
        if self.refit:
            out["refit"] = {name: r.to_json() for name, r in self.refit.items()}
        return out | {"validated": self.validated, "offered": self.offered}

    @staticmethod
    def read(fit: Mapping[str, Any]) -> FitResult | None:
        """`fit` of verdict.json; None where nothing could be driven."""
        if not fit:
            return None
        driven = {
            name: Rmse.read(fit[name]) for name in ("before", "parameters_only", "after") if name in fit
        }
        return FitResult(
            held_out=tuple(fit["held_out"]),
            horizon_s=fit["horizon_s"],
            windows=fit["windows"],
            corrected=tuple(fit["corrected"]),
            validated=fit["validated"],
            errors=Compared(**driven) if driven else None,
            improvement=Improvement.read(fit) if driven else None,
            refitted=fit.get("refitted", {}),
            output_error=fit.get("output_error", False),
            next_pass=NextPass.read(fit.get("next_pass")),
            without_exogenous=WithoutExogenous.read(fit.get("without_exogenous")),
            scales_forces=fit.get("scales_forces", False),
            offered=fit.get("offered", CORRECTION if fit["validated"] else AS_GIVEN),
            refit={name: Refitted.read(entry) for name, entry in fit.get("refit", {}).items()},
        )
