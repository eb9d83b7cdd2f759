"""What a correction does in free runs, as types: errors, how surely they fall, and what was chosen.

`FitResult.to_json` gives `fit` of verdict.json.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.posterior.next_pass import NextPass

Array = NDArray[np.float64]
Interval = tuple[float, float]

LEAST = 1e-3  # m/s; errors this small are as good as none, and none can be no improvement
CLEARLY_WORSE = 1.03  # times the error: less is how free runs of the same drives happen to begin


class Chosen(StrEnum):
    """What goes into a corrected simulator."""

    NOTHING = "nothing"
    FINDINGS = "findings"
    PARAMETERS = "parameters"  # all refitted, and no name
    LAWS = "laws"  # the findings, and laws for what has no name


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

    def of_a_run(self) -> float:
        """Mean of `of_runs`. In a mean of squares one run in which a gear is chosen otherwise, by whatever
        little, outweighs all others."""
        return float(np.mean(self.of_runs()))


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
    corrected, and corrected by laws for what has no name too."""

    before: Rmse
    parameters_only: Rmse
    after: Rmse
    free_model: Rmse | None = None

    def each(self) -> dict[str, Rmse]:
        """By the names of verdict.json, those that there are."""
        return {name: rmse for name, rmse in vars(self).items() if rmse is not None}


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
class HandedOver:
    """Speed error after a correction, rms in m/s, where nobody tells it the signals it asks for beyond the
    protocol, such as a gap: they count as absent."""

    without: tuple[str, ...]
    after: float

    def to_json(self) -> dict[str, Any]:
        """`fit.handed_over`."""
        return {"without": list(self.without), "after": self.after}

    @staticmethod
    def read(entry: Mapping[str, Any] | None) -> HandedOver | None:
        """From `fit.handed_over`; None where there is none."""
        return HandedOver(tuple(entry["without"]), entry["after"]) if entry else None


@dataclass(frozen=True)
class FitResult:
    """What the correction does for `windows` free runs of `horizon_s` on the held-out recordings.

    `errors` and `improvement` are None where no recording is long enough for a free run.
    """

    held_out: tuple[str, ...]
    horizon_s: float
    windows: int
    chosen: Chosen
    corrected: tuple[str, ...]  # effects and parameters that the corrected simulator holds
    validated: bool
    errors: Compared | None = None
    improvement: Improvement | None = None
    refitted: Mapping[str, float] = field(default_factory=dict)  # relative changes of its parameters
    for_driving: bool = False  # whether its sizes are those of least speed error, not the most probable ones
    next_pass: NextPass | None = None  # of a road that came again: what one pass tells of another
    handed_over: HandedOver | None = None  # None where it asks for nothing beyond the protocol
    scales_forces: bool = False  # the simulator has no parameters: what refits them scales its forces instead
    by_mean: tuple[str, ...] = ()  # corrected effects that belong to a time or place: it holds their mean

    @property
    def harms_alone(self) -> bool:
        """Whether the correction makes drives worse where nobody tells it all that it asks for."""
        if self.handed_over is None or self.errors is None:
            return False
        return self.handed_over.after > CLEARLY_WORSE * self.errors.before.speed

    @property
    def changes_nothing(self) -> bool:
        """Whether the held-out recordings are driven alike with the correction and without."""
        return self.errors is not None and self.errors.after == self.errors.before

    def to_json(self) -> dict[str, Any]:
        """`fit`."""
        names = ("held_out", "horizon_s", "windows", "chosen", "corrected")
        out = {name: getattr(self, name) for name in names}
        if self.refitted:
            out["refitted"] = dict(self.refitted)
        if self.for_driving:
            out["for_driving"] = True
        if self.scales_forces:
            out["scales_forces"] = True
        if self.by_mean:
            out["by_mean"] = list(self.by_mean)
        if self.next_pass is not None:
            out["next_pass"] = self.next_pass.to_json()
        if self.handed_over is not None:
            out["handed_over"] = self.handed_over.to_json()
        if self.errors is not None:
            out |= {name: rmse.to_json() for name, rmse in self.errors.each().items()}
        if self.improvement is not None:
            out |= self.improvement.to_json()
        return out | {"validated": self.validated}

    @staticmethod
    def read(fit: Mapping[str, Any]) -> FitResult | None:
        """`fit` of verdict.json; None where nothing could be driven."""
        if not fit:
            return None
        names = ("before", "parameters_only", "after", "free_model")
        driven = {name: Rmse.read(fit[name]) for name in names if name in fit}
        return FitResult(
            tuple(fit["held_out"]), fit["horizon_s"], fit["windows"], Chosen(fit["chosen"]),
            tuple(fit["corrected"]), fit["validated"],
            Compared(**driven) if driven else None,
            Improvement.read(fit) if driven else None,
            fit.get("refitted", {}),
            fit.get("for_driving", False),
            NextPass.read(fit.get("next_pass")),
            HandedOver.read(fit.get("handed_over")),
            fit.get("scales_forces", False),
            tuple(fit.get("by_mean", ())),
        )  # fmt: skip
