"""One thing found, as a type: an entry of `findings` of verdict.json, and what was found and withdrawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from deeptruck_model.mismatch.active_fault import ActiveFault
from deeptruck_model.mismatch.fit_result import Interval
from deeptruck_model.mismatch.posterior.causes import Cause
from deeptruck_model.mismatch.posterior.left_out import LeftOut
from deeptruck_model.mismatch.posterior.road_lock import RoadLock
from deeptruck_model.mismatch.sentence import Sentence
from deeptruck_model.mismatch.strength import Strength

LAWS_R2 = "held_out_r2"  # the name under which verdict.json has `Finding.laws_r2`


class Kind(StrEnum):
    """What a finding is."""

    PHYSICS = "missing_physics"
    PARAMETER = "parameter_error"
    SENSOR = "measurement_fault"


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
    nearest: str | None = None  # the name whose form fits best, where it is told by none or by another
    laws_r2: float | None = None  # of a force without a name: r2 of its laws on recordings not fitted to
    formula_r2: float | None = None  # held-out r2 of the formula in `equation`, where one was found
    decided_by: str | None = None  # of a slow force: what gave it its name
    road: RoadLock | None = None
    engine_torque: str | None = None  # whether the engine's recorded torque shows it, where that is known
    strength: Strength | None = None  # None for a fault that shows between sensors alone
    left_out: LeftOut | None = None  # of what acts at a time of its own: what its own drives show
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
        road = self.road.to_json() if self.road is not None else None
        only_if = {
            "nearest": self.nearest,
            "decided_by": self.decided_by,
            "road": road,
            "formula_r2": self.formula_r2,
            "engine_torque": self.engine_torque,
            "strength": self.strength.to_json() if self.strength is not None else None,
            "left_out_blocks": self.left_out.to_json() if self.left_out is not None else None,
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
            left_out=LeftOut.read(entry.get("left_out_blocks")),
            active_fault=ActiveFault.read(entry.get("active_fault")),
        )  # fmt: skip


@dataclass(frozen=True)
class Suspicion:
    """What explained the fitted recordings, and is no finding: held-out drives speak against it."""

    effect: str
    evidence_nats: float
    would_be_told_by: str


def _interval(ci95: list[float] | None) -> Interval | None:
    return (ci95[0], ci95[1]) if ci95 else None
