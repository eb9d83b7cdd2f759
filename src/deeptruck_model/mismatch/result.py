"""What the tool found, as types. `Verdict.to_json` gives verdict.json, and nothing else does.

Rooms below give the parts; the report reads them. Numbers are rounded where a finding is made, so that page,
terminal and file say the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.active_fault import ActiveFault
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck
from deeptruck_model.mismatch.data.checks import Rejection
from deeptruck_model.mismatch.data.prepared import Prepared
from deeptruck_model.mismatch.fit_result import Errors, FitResult, Interval
from deeptruck_model.mismatch.posterior.causes import Cause, Explanation
from deeptruck_model.mismatch.posterior.road_lock import RoadLock
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.sentence import Sentence
from deeptruck_model.mismatch.strength import Strength

Array = NDArray[np.float64]

SCHEMA = 1
COVERAGE = "coverage.png"
LAWS_R2 = "held_out_r2"  # the name under which verdict.json has `Finding.laws_r2`
ALWAYS, RARELY = "steady force all the time", "steady force 2 % of the time"


class Kind(StrEnum):
    """What a finding is."""

    PHYSICS = "missing_physics"
    PARAMETER = "parameter_error"
    SENSOR = "measurement_fault"


class Conclusion(StrEnum):
    """What it comes down to: the kind of the main finding, or why there is none."""

    PHYSICS = "missing_physics"
    PARAMETER = "parameter_error"
    SENSOR = "measurement_fault"
    NOTHING = "nothing_missing"
    UNDETERMINED = "undetermined"


@dataclass(frozen=True)
class Size:
    """A size in `unit` with its 95 % interval, where it was fitted."""

    value: float
    unit: str
    ci95: Interval | None = None
    picked: bool = False  # not fitted: the best of a few that were tried


@dataclass(frozen=True)
class Rival:
    """Another name, and by how many nats the whole explanation is worse with it."""

    effect: str
    worse_by_nats: float


@dataclass(frozen=True)
class Finding:
    """One thing found. `share_of_explainable_error` and `probability` are from 0 to 1."""

    kind: Kind
    effect: str
    says: Sentence
    equation: str
    parameters: Mapping[str, Size]
    probability: float
    would_be_told_by: Sentence
    depends_on: tuple[str, ...]
    cannot_be_told_from: tuple[str, ...] = ()
    share_of_explainable_error: float = 0.0
    evidence_nats: float | None = None  # None for a fault that shows between sensors alone
    rivals: tuple[Rival, ...] = ()
    capped: bool = False  # the fit alone would be surer than `probability`
    nearest: str | None = None  # of a force without a name: the name that comes nearest
    laws_r2: float | None = None  # of a force without a name: r2 of its laws on recordings not fitted to
    formula_r2: float | None = None  # held-out r2 of the formula in `equation`, where one was found
    decided_by: str | None = None  # of a slow force: what gave it its name
    road: RoadLock | None = None
    engine_torque: str | None = None  # whether the engine's recorded torque shows it, where that is known
    strength: Strength | None = None  # None for a fault that shows between sensors alone
    active_fault: ActiveFault | None = None  # told by the truck's controllers, mostly while it acts
    cause: Cause | None = field(default=None, compare=False)  # None for a fault between sensors

    def to_json(self) -> dict[str, Any]:
        """An entry of `findings`."""
        sizes = dict(self.parameters) | ({} if self.laws_r2 is None else {LAWS_R2: Size(self.laws_r2, "1")})
        out: dict[str, Any] = {
            "kind": self.kind,
            "effect": self.effect,
            "says": str(self.says),
            "equation": self.equation,
            "parameters": {n: {"value": s.value, "unit": s.unit, "ci95": s.ci95} for n, s in sizes.items()},
            "would_be_told_by": str(self.would_be_told_by),
            "depends_on": self.depends_on,
            "probability": self.probability,
            "cannot_be_told_from": self.cannot_be_told_from,
            "share_of_explainable_error": self.share_of_explainable_error,
        }
        if self.evidence_nats is not None:
            out["evidence_nats"] = self.evidence_nats
            out["rivals"] = [vars(r) for r in self.rivals]
        road = {n: round(v, 3) for n, v in vars(self.road).items()} if self.road is not None else None
        only_if = {
            "nearest": self.nearest,
            "decided_by": self.decided_by,
            "road": road,
            "formula_r2": self.formula_r2,
            "engine_torque": self.engine_torque,
            "strength": self.strength.to_json() if self.strength is not None else None,
            "active_fault": self.active_fault.to_json() if self.active_fault is not None else None,
        }
        return out | {name: value for name, value in only_if.items() if value is not None}

    @staticmethod
    def read(entry: Mapping[str, Any]) -> Finding:
        """An entry of `findings` of verdict.json."""
        sizes = {n: Size(s["value"], s["unit"], _interval(s["ci95"])) for n, s in entry["parameters"].items()}
        laws = sizes.pop(LAWS_R2, None)
        road = entry.get("road")
        return Finding(
            Kind(entry["kind"]), entry["effect"], Sentence.of(entry["says"]), entry["equation"], sizes,
            entry["probability"], Sentence.of(entry["would_be_told_by"]), tuple(entry["depends_on"]),
            tuple(entry["cannot_be_told_from"]), entry["share_of_explainable_error"],
            entry.get("evidence_nats"), tuple(Rival(**r) for r in entry.get("rivals", ())),
            nearest=entry.get("nearest"), laws_r2=laws.value if laws else None,
            formula_r2=entry.get("formula_r2"), decided_by=entry.get("decided_by"),
            road=RoadLock(**road) if road else None, engine_torque=entry.get("engine_torque"),
            strength=Strength.read(entry.get("strength")),
            active_fault=ActiveFault.read(entry.get("active_fault")),
        )  # fmt: skip


@dataclass(frozen=True)
class Suspicion:
    """What explained the fitted recordings, and is no finding: held-out drives speak against it."""

    effect: str
    evidence_nats: float
    would_be_told_by: str


@dataclass(frozen=True)
class Segment:
    """A stretch of one recording in which a finding (by its place) acts; rows are of the stacked evidence."""

    recording: str
    start_s: float
    end_s: float
    finding: int
    mean_force_n: float
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
            "mean_force_n": round(self.mean_force_n, 1),
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


def _interval(ci95: list[float] | None) -> Interval | None:
    return (ci95[0], ci95[1]) if ci95 else None


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
