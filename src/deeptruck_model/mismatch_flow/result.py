"""What was found, as types; `Verdict.to_json` gives verdict.json, schema 2, and nothing else does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck
from deeptruck_model.mismatch.data.checks import Rejection
from deeptruck_model.mismatch.data.prepared import Prepared
from deeptruck_model.mismatch.fit_result import Errors, FitResult, Interval
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.result import Conclusion, Regime, Segment
from deeptruck_model.mismatch.strength import Strength
from deeptruck_model.mismatch_flow.budget import Budget
from deeptruck_model.mismatch_flow.tree import Node
from deeptruck_model.mismatch_flow.unrecorded import NotRecorded
from deeptruck_model.mismatch_flow.witnesses import Witness

Array = NDArray[np.float64]

SCHEMA = 2


class Kind(StrEnum):
    """What a finding is."""

    PHYSICS = "missing_physics"
    PARAMETER = "parameter_error"
    SENSOR = "measurement_fault"


class Answer(StrEnum):
    """To a question of `advice`."""

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
    would_be_told_by: str
    depends_on: tuple[str, ...]
    cannot_be_told_from: tuple[str, ...] = ()
    share_of_explainable_error: float = 0.0
    evidence_nats: float | None = None
    strength: Strength | None = None
    force: Array | None = field(default=None, compare=False)

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
            "would_be_told_by": self.would_be_told_by,
            "depends_on": self.depends_on,
            "probability": self.probability,
            "family_probability": self.family_probability,
            "cannot_be_told_from": self.cannot_be_told_from,
            "share_of_explainable_error": self.share_of_explainable_error,
        }
        if self.evidence_nats is not None:
            out["evidence_nats"] = self.evidence_nats
        if self.strength is not None:
            out["strength"] = self.strength.to_json()
        return out


@dataclass(frozen=True)
class Verdict:
    """All that verdict.json says. `fit` and `budget` are None where nothing could be compared."""

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
                "data": {"rejected": [vars(r) for r in self.rejected]},
                "caveats": self.caveats,
                "not_recorded": [m.to_json() for m in self.not_recorded],
                "budget": self.budget.to_json() if self.budget is not None else {},
                "witnesses": [w.to_json() for w in self.witnesses],
                "tree": [vars(n) for n in self.tree],
                "advice": {name: a.to_json() for name, a in self.advice.items()},
            }
        )
        return out


@dataclass(frozen=True, repr=False)
class Result:
    """The verdict and what the report draws beside it; None where nothing can be compared."""

    result: Verdict
    evidence: Evidence | None
    errors: Mapping[str, Errors]
    corrected: CorrectedTruck | None
    prepared: tuple[Prepared, ...]

    def __repr__(self) -> str:
        """What was found, in a line: its parts hold all samples."""
        names = ", ".join(f.effect for f in self.findings) or "no finding"
        return f"<Result: {self.result.kind}; {names}; {'' if self.result.validated else 'not '}validated>"

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
