"""Types of the result. `Verdict.to_json` alone makes verdict.json, schema 3."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.budget import Budget
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck
from deeptruck_model.mismatch.data.checks import Rejection
from deeptruck_model.mismatch.data.prepared import Prepared
from deeptruck_model.mismatch.events import Event
from deeptruck_model.mismatch.fit_result import Errors, FitResult, Interval
from deeptruck_model.mismatch.names import Explanation
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.strength import Strength
from deeptruck_model.mismatch.tree import Node
from deeptruck_model.mismatch.unrecorded import NotRecorded
from deeptruck_model.mismatch.witnesses import Witness

Array = NDArray[np.float64]

SCHEMA = 3


class Conclusion(StrEnum):
    """The kind of the main finding, or why there is none."""

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

    @staticmethod
    def read(entry: Mapping[str, Any]) -> Segment:
        """An entry of `segments` of verdict.json."""
        return Segment(**entry, start=0, stop=0, energy=0.0)


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
    """A region of driving, unlimited without bounds, with its share of the error and of the time."""

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


class Kind(StrEnum):
    """The kind of a finding."""

    PHYSICS = "missing_physics"
    PARAMETER = "parameter_error"
    SENSOR = "measurement_fault"


class Answer(StrEnum):
    """Answer to a question of `advice`."""

    YES = "yes"
    NO = "no"
    UNSURE = "unsure"


@dataclass(frozen=True)
class Advice:
    """An answer with its reason in one sentence."""

    answer: Answer
    reason: str

    def to_json(self) -> dict[str, str]:
        """An entry of `advice`."""
        return {"answer": self.answer, "reason": self.reason}


@dataclass(frozen=True)
class Size:
    """A size in `unit` with its 95 % interval, where it was fitted."""

    value: float
    unit: str
    ci95: Interval | None = None


@dataclass(frozen=True)
class Finding:
    """One thing found. `stated` is the deepest node of the tree that is probable enough; `force` (n,), m/s^2,
    is absent for a fault that shows between sensors alone."""

    kind: Kind
    effect: str
    family: str
    stated: str
    says: str
    equation: str
    parameters: Mapping[str, Size]
    probability: float
    family_probability: float
    separating_manoeuvre: str
    depends_on: tuple[str, ...]
    credible_set: tuple[str, ...] = ()
    share_of_explainable_error: float = 0.0
    evidence_nats: float | None = None
    strength: Strength | None = None
    missing_input: str = ""  # which was not recorded and may explain it as well
    in_drives: tuple[str, ...] = ()  # in which it acts, where not in all
    share_of_error: float | None = None  # of the squared speed error, that the budget gives its family
    force: Array | None = field(default=None, compare=False)

    @staticmethod
    def read(entry: Mapping[str, Any]) -> Finding:
        """An entry of `findings` of verdict.json."""
        sizes = {
            name: Size(s["value"], s["unit"], (s["ci95"][0], s["ci95"][1]) if s["ci95"] else None)
            for name, s in entry["parameters"].items()
        }
        return Finding(
            Kind(entry["kind"]), entry["effect"], entry["family"], entry["stated"], entry["says"],
            entry["equation"], sizes, entry["probability"], entry["family_probability"],
            entry.get("separating_manoeuvre", entry.get("would_be_told_by", "")), tuple(entry["depends_on"]),
            tuple(entry.get("credible_set", entry.get("cannot_be_told_from", ()))),
            entry["share_of_explainable_error"], entry.get("evidence_nats"),
            Strength.read(entry.get("strength")), entry.get("missing_input", ""),
            tuple(entry.get("in_drives", ())), entry.get("share_of_error"),
        )  # fmt: skip

    def to_json(self) -> dict[str, Any]:
        """An entry of `findings`."""
        out: dict[str, Any] = {
            "kind": self.kind,
            "effect": self.effect,
            "family": self.family,
            "stated": self.stated,
            "says": self.says,
            "equation": self.equation,
            "parameters": {
                n: {"value": s.value, "unit": s.unit, "ci95": s.ci95} for n, s in self.parameters.items()
            },
            "separating_manoeuvre": self.separating_manoeuvre,
            "would_be_told_by": self.separating_manoeuvre,  # the key of schema 2
            "depends_on": self.depends_on,
            "probability": self.probability,
            "family_probability": self.family_probability,
            "credible_set": self.credible_set,
            "cannot_be_told_from": self.credible_set,  # the key of schema 2
            "share_of_explainable_error": self.share_of_explainable_error,
        }
        if self.evidence_nats is not None:
            out["evidence_nats"] = self.evidence_nats
        if self.strength is not None:
            out["strength"] = self.strength.to_json()
        if self.missing_input:
            out["missing_input"] = self.missing_input
        if self.in_drives:
            out["in_drives"] = self.in_drives
        if self.share_of_error is not None:
            out["share_of_error"] = round(self.share_of_error, 4)
        return out


@dataclass(frozen=True)
class Verdict:
    """All that verdict.json says. `fit` and `budget` are None where nothing could be compared. `recorded` are
    samples, of which the share `compared` was compared."""

    kind: Conclusion
    findings: tuple[Finding, ...] = ()
    segments: tuple[Segment, ...] = ()
    regimes: tuple[Regime, ...] = ()
    fit: FitResult | None = None
    rejected: tuple[Rejection, ...] = ()
    caveats: tuple[str, ...] = ()
    not_recorded: tuple[NotRecorded, ...] = ()
    budget: Budget | None = None
    witnesses: tuple[Witness, ...] = ()
    tree: tuple[Node, ...] = ()
    advice: Mapping[str, Advice] = field(default_factory=dict)
    recorded: int = 0
    compared: float = 0.0
    explanations: tuple[Explanation, ...] = ()
    events: tuple[Event, ...] = ()

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
                "explanations": [x.to_json() for x in self.explanations],
                "events": [x.to_json() for x in self.events],
                "segments": [s.to_json() for s in self.segments],
                "regimes": [r.to_json() for r in self.regimes],
                "fit": self.fit.to_json() if self.fit is not None else {},
                "data": self._data(),
                "caveats": self.caveats,
                "not_recorded": [m.to_json() for m in self.not_recorded],
                "budget": self.budget.to_json() if self.budget is not None else {},
                "witnesses": [w.to_json() for w in self.witnesses],
                "tree": [vars(n) for n in self.tree],
                "advice": {name: a.to_json() for name, a in self.advice.items()},
            }
        )
        return out

    def _data(self) -> dict[str, Any]:
        out: dict[str, Any] = {
            "rejected": [vars(r) for r in self.rejected],
            "recorded": self.recorded,
            "compared": round(self.compared, 4),
        }
        return out

    @staticmethod
    def read(verdict: Mapping[str, Any]) -> Verdict:
        """From verdict.json; forces along the drives are not in it. Raises KeyError, TypeError or ValueError
        for what is none."""
        data, budget = verdict["data"], verdict["budget"]
        return Verdict(
            Conclusion(verdict["verdict"]),
            tuple(Finding.read(f) for f in verdict["findings"]),
            tuple(Segment.read(s) for s in verdict["segments"]),
            (),
            FitResult.read(verdict["fit"]),
            tuple(Rejection(**r) for r in data["rejected"]),
            tuple(verdict["caveats"]),
            tuple(NotRecorded(**m) for m in verdict["not_recorded"]),
            Budget.read(budget) if budget else None,
            tuple(Witness(**w) for w in verdict["witnesses"]),
            tuple(Node(**n) for n in verdict["tree"]),
            {name: Advice(Answer(a["answer"]), a["reason"]) for name, a in verdict["advice"].items()},
            data.get("recorded", 0),
            data.get("compared", 0.0),
            tuple(Explanation(tuple(x["names"]), x["probability"]) for x in verdict.get("explanations", ())),
            tuple(Event.read(x) for x in verdict.get("events", ())),
        )


@dataclass(frozen=True, repr=False)
class Mismatch:
    """The verdict and what the report draws with it; None where nothing can be compared."""

    result: Verdict
    evidence: Evidence | None
    errors: Mapping[str, Errors]
    corrected: CorrectedTruck | None
    prepared: tuple[Prepared, ...]
    refitted: CorrectedTruck | None = None

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
