"""What the tool found, as types. `Verdict.to_json` gives verdict.json, and nothing else does.

Rooms below give the parts; the report reads them. Numbers are rounded where a finding is made, so that page,
terminal and file say the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck
from deeptruck_model.mismatch.data.checks import Rejection
from deeptruck_model.mismatch.data.prepared import Prepared
from deeptruck_model.mismatch.finding import Finding, Suspicion
from deeptruck_model.mismatch.fit_result import Errors, FitResult
from deeptruck_model.mismatch.posterior.causes import Explanation
from deeptruck_model.mismatch.residual.evidence import Evidence

Array = NDArray[np.float64]

SCHEMA = 1
COVERAGE = "coverage.png"
ALWAYS, RARELY = "steady force all the time", "steady force 2 % of the time"


class Conclusion(StrEnum):
    """What it comes down to: the kind of the main finding, or why there is none."""

    PHYSICS = "missing_physics"
    PARAMETER = "parameter_error"
    SENSOR = "measurement_fault"
    NOTHING = "nothing_missing"
    UNDETERMINED = "undetermined"


@dataclass(frozen=True)
class Segment:
    """A stretch of one recording in which a finding (by its place) acts; rows are of the stacked evidence."""

    recording: str
    start_s: float
    end_s: float
    finding: int
    mean_force_n: float | None  # None where no mass is known
    start: int
    stop: int
    energy: float

    def to_json(self) -> dict[str, Any]:
        """An entry of `segments`."""
        return {
            "recording": self.recording,
            "start_s": round(self.start_s, 2),
            "end_s": round(self.end_s, 2),
            "finding": self.finding,
            "mean_force_n": None if self.mean_force_n is None else round(self.mean_force_n, 1),
        }


@dataclass(frozen=True)
class Bound:
    """A range of a signal, open on a side that is infinite."""

    signal: str
    low: float
    high: float
    unit: str

    def __str__(self) -> str:
        after = f" {self.unit}" if self.unit else ""
        if np.isinf(self.low):
            return f"{self.signal} < {self.high:.3g}{after}"
        if np.isinf(self.high):
            return f"{self.signal} > {self.low:.3g}{after}"
        return f"{self.signal} {self.low:.3g} .. {self.high:.3g}{after}"


@dataclass(frozen=True)
class Regime:
    """A region of driving, everywhere without bounds, with its share of the error and of the time."""

    bounds: tuple[Bound, ...]
    share_of_error: float
    share_of_time: float

    @property
    def where(self) -> str:
        """The bounds in one line."""
        return " and ".join(map(str, self.bounds)) or "everywhere"

    def to_json(self) -> dict[str, Any]:
        """An entry of `regimes`."""
        return {
            "where": self.where,
            "share_of_error": self.share_of_error,
            "share_of_time": self.share_of_time,
        }


@dataclass(frozen=True)
class SmallestVisible:
    """What would have been reported: relative errors of parameters, and steady forces (m/s^2)."""

    parameters: Mapping[str, float]
    always: float  # a force that acts all the time
    rarely: float  # one that acts for 2 % of it
    mass_kg: float | None  # None where it is not known

    def to_json(self) -> dict[str, Any]:
        """`data.smallest_visible`."""
        forces = {ALWAYS: self._force(self.always), RARELY: self._force(self.rarely)}
        return {name: {"relative": size} for name, size in self.parameters.items()} | forces

    def _force(self, acceleration: float) -> dict[str, float]:
        if self.mass_kg is None:
            return {"m_s2": acceleration}
        newtons = round(acceleration * self.mass_kg, 1)
        return {"newton": newtons, "m_s2": acceleration, "mass_kg": self.mass_kg}

    @staticmethod
    def read(entry: Mapping[str, Any] | None) -> SmallestVisible | None:
        """`data.smallest_visible` of verdict.json."""
        if entry is None:
            return None
        relative = {name: size["relative"] for name, size in entry.items() if "relative" in size}
        always, rarely = entry[ALWAYS], entry[RARELY]
        return SmallestVisible(relative, always["m_s2"], rarely["m_s2"], always.get("mass_kg"))


@dataclass(frozen=True)
class DataReport:
    """What was wrong with the recordings; and, where nothing is missing, what would have been seen."""

    rejected: tuple[Rejection, ...] = ()
    smallest_visible: SmallestVisible | None = None

    def to_json(self) -> dict[str, Any]:
        """`data`."""
        out: dict[str, Any] = {"rejected": [vars(r) for r in self.rejected], "coverage": COVERAGE}
        if self.smallest_visible is not None:
            out["smallest_visible"] = self.smallest_visible.to_json()
        return out


@dataclass(frozen=True)
class Verdict:
    """All that verdict.json tells. `fit` is None where nothing could be driven."""

    kind: Conclusion
    findings: tuple[Finding, ...] = ()
    segments: tuple[Segment, ...] = ()
    regimes: tuple[Regime, ...] = ()
    fit: FitResult | None = None
    data: DataReport = DataReport()
    caveats: tuple[str, ...] = ()
    suspicions: tuple[Suspicion, ...] = ()

    @property
    def validated(self) -> bool:
        """Whether the corrected simulator passed validation."""
        return self.fit is not None and self.fit.validated

    def to_json(self) -> dict[str, Any]:
        """verdict.json as plain JSON data: no NaN, no infinities, no numpy types."""
        out: dict[str, Any] = _plain(
            {
                "schema": SCHEMA,
                "verdict": self.kind,
                "findings": [f.to_json() for f in self.findings],
                "segments": [s.to_json() for s in self.segments],
                "regimes": [r.to_json() for r in self.regimes],
                "fit": self.fit.to_json() if self.fit is not None else {},
                "data": self.data.to_json(),
                "caveats": self.caveats,
                "suspicions": [vars(s) for s in self.suspicions],
            }
        )
        return out

    @staticmethod
    def read(verdict: Mapping[str, Any]) -> Verdict:
        """What verdict.json tells of findings, fit, data and caveats; where it acts is left out."""
        data = verdict["data"]
        return Verdict(
            Conclusion(verdict["verdict"]),
            tuple(Finding.read(f) for f in verdict["findings"]),
            fit=FitResult.read(verdict["fit"]),
            data=DataReport(
                tuple(Rejection(**r) for r in data["rejected"]),
                SmallestVisible.read(data.get("smallest_visible")),
            ),
            caveats=tuple(verdict["caveats"]),
            suspicions=tuple(Suspicion(**s) for s in verdict.get("suspicions", ())),
        )


@dataclass(frozen=True, repr=False)
class Mismatch:
    """Everything the tool found: its result, and what the report draws. None where nothing can be said."""

    result: Verdict
    evidence: Evidence | None
    explanation: Explanation | None
    errors: Mapping[str, Errors]
    corrected: CorrectedTruck | None
    prepared: tuple[Prepared, ...]
    excluded: tuple[str, ...] = ()  # effects that were to be left out of the library

    def __repr__(self) -> str:
        """What was found, in a line: its parts hold all samples."""
        names = ", ".join(f.effect for f in self.findings) or "no finding"
        return f"<Mismatch: {self.result.kind}; {names}; {'' if self.result.validated else 'not '}validated>"

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What was found, in the order of verdict.json."""
        return self.result.findings

    @property
    def verdict(self) -> dict[str, Any]:
        """The content of verdict.json."""
        return self.result.to_json()


def _plain(x: Any) -> Any:
    """JSON data without NaN, infinities, enums and numpy types."""
    if isinstance(x, dict):
        return {str(k): _plain(v) for k, v in x.items()}
    if isinstance(x, (list, tuple)):
        return [_plain(v) for v in x]
    if isinstance(x, StrEnum):
        return x.value
    if isinstance(x, (bool, np.bool_)):
        return bool(x)
    if isinstance(x, (int, np.integer)):
        return int(x)
    if isinstance(x, (float, np.floating)):
        return float(x) if np.isfinite(x) else None
    return x
