"""Types of the result. `Verdict.to_json` alone writes verdict.json, schema 3."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.json_data import HIDDEN, SPARSE, from_json, stored, to_json
from deeptruck_core.signals import Said, Speed
from deeptruck_model.mismatch.correction.fit_result import FitResult, Interval, Strength
from deeptruck_model.mismatch.folders import AS_GIVEN, CORRECTION
from deeptruck_model.mismatch.posterior.budget import Budget
from deeptruck_model.mismatch.posterior.events import Event
from deeptruck_model.mismatch.posterior.names import Explanation, Node
from deeptruck_model.mismatch.prepare.drives import NotRecorded, Rejection
from deeptruck_model.mismatch.verdict.wording import digits

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
    """A segment of one recording in which a finding, given by its index, acts; rows are of the stacked
    evidence."""

    recording: str
    start_s: float = field(metadata=stored(digits=2))
    end_s: float = field(metadata=stored(digits=2))
    finding: int
    mean_force_n: float | None = field(metadata=stored(digits=1))  # None where no mass is known
    start: int = field(default=0, metadata=HIDDEN)
    stop: int = field(default=0, metadata=HIDDEN)
    energy: float = field(default=0.0, metadata=HIDDEN)


@dataclass(frozen=True)
class Bound:
    """A range of a signal; infinite bounds are open."""

    signal: str
    low: float
    high: float
    unit: str

    def __str__(self) -> str:
        low, high = self._end(self.low, with_unit=np.isinf(self.high)), self._end(self.high)
        if np.isinf(self.low):
            return Said(self.signal, " < ", high)
        if np.isinf(self.high):
            return Said(self.signal, " > ", low)
        return Said(self.signal, " ", low, " .. ", high)

    def _end(self, value: float, *, with_unit: bool | np.bool_ = True) -> str | Speed:
        if self.unit == "m/s":
            return Speed(value, 3, bool(with_unit))
        return digits(value) + (f" {self.unit}" if self.unit and with_unit else "")


@dataclass(frozen=True)
class Regime:
    """A region of driving in which all `bounds` hold, with its share of the error and of the time."""

    where: str
    share_of_error: float
    share_of_time: float
    bounds: tuple[Bound, ...] = field(default=(), metadata=HIDDEN)


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


@dataclass(frozen=True)
class Size:
    """A size in `unit` with its 95 % interval, if it was fitted; of one `drive` if that is named."""

    value: float
    unit: str
    ci95: Interval | None = None
    drive: str = field(default="", metadata=SPARSE)


@dataclass(frozen=True)
class Alternative:
    """A name of a credible set, and the size that the force would need under this name: `times_usual` is that
    over the prior standard deviation of its mechanism."""

    name: str
    probability: float = field(metadata=stored(digits=3))
    size: Size | None = field(default=None, metadata=SPARSE)
    times_usual: float | None = field(default=None, metadata=stored(digits=2, sparse=True))


@dataclass(frozen=True)
class Finding:
    """One finding. `stated` is the deepest node of the tree that is probable enough; `force` (n,), m/s^2, is
    absent for a fault that is visible between sensors alone."""

    kind: Kind
    effect: str
    family: str
    stated: str
    says: str
    equation: str
    parameters: Mapping[str, Size]
    separating_manoeuvre: str = field(metadata=stored(earlier="would_be_told_by"))
    depends_on: tuple[str, ...]
    probability: float
    family_probability: float
    credible_set: tuple[str, ...] = field(default=(), metadata=stored(earlier="cannot_be_told_from"))
    alternatives: tuple[Alternative, ...] = field(default=(), metadata=SPARSE)  # where several names remain
    share_of_explainable_error: float = 0.0
    evidence_nats: float | None = field(default=None, metadata=SPARSE)
    strength: Strength | None = field(default=None, metadata=SPARSE)
    missing_input: str = field(
        default="", metadata=SPARSE
    )  # which was not recorded and may explain it as well
    in_log: bool = field(default=False, metadata=SPARSE)  # what is missing was recorded, by another sensor
    in_drives: tuple[str, ...] = field(default=(), metadata=SPARSE)  # in which it acts, where not in all
    in_condition: str = field(default="", metadata=SPARSE)  # in which it acts, where not always
    # of the squared speed error, that the budget gives its family
    share_of_error: float | None = field(default=None, metadata=stored(digits=4, sparse=True))
    # its 90 % interval, where it is the share of one part
    share_ci90: Interval | None = field(
        default=None, metadata=stored(key="share_of_error_ci90", digits=4, sparse=True)
    )
    # the simulator's mass to set for each drive, kg, where that is what differs between drives
    mass_by_drive: Mapping[str, float] = field(default_factory=dict, metadata=stored(figures=5, sparse=True))
    force: Array | None = field(default=None, compare=False, metadata=HIDDEN)

    @property
    def by_drive(self) -> dict[str, Size]:
        """Its size in each drive, where it has one, by the drive's name."""
        return {x.drive: x for x in self.parameters.values() if x.drive}

    @property
    def rivals(self) -> tuple[str, ...]:
        """The other names of its credible set."""
        return tuple(name for name in self.credible_set if name != self.effect)


@dataclass(frozen=True)
class Witness:
    """A channel, the part of the budget that it explains, and the share of that part's variance that it
    predicts on left-out drives."""

    channel: str
    part: str
    share: float = field(metadata=stored(digits=3))


@dataclass(frozen=True)
class Data:
    """Number of samples `recorded`, the share `compared`, and the samples rejected by each rule."""

    rejected: tuple[Rejection, ...] = ()
    recorded: int = field(default=0, metadata=stored(later=True))
    compared: float = field(default=0.0, metadata=stored(digits=4, later=True))
    doubts: tuple[str, ...] = field(default=(), metadata=SPARSE)  # of inputs and speed, to settle first


@dataclass(frozen=True)
class Verdict:
    """The content of verdict.json. `fit` and `budget` are None if nothing could be compared."""

    kind: Conclusion = field(metadata=stored(key="verdict"))
    findings: tuple[Finding, ...] = ()
    explanations: tuple[Explanation, ...] = field(default=(), metadata=stored(later=True))
    events: tuple[Event, ...] = field(default=(), metadata=stored(later=True))
    segments: tuple[Segment, ...] = ()
    regimes: tuple[Regime, ...] = ()
    fit: FitResult | None = None
    data: Data = field(default_factory=Data)
    caveats: tuple[str, ...] = ()
    not_recorded: tuple[NotRecorded, ...] = ()
    budget: Budget | None = None
    witnesses: tuple[Witness, ...] = ()
    tree: tuple[Node, ...] = ()
    advice: Mapping[str, Advice] = field(default_factory=dict)

    @property
    def validated(self) -> bool:
        """Whether the offered simulator, corrected or with refitted parameters only, passed validation."""
        return self.fit is not None and self.fit.validated

    @property
    def offered(self) -> str:
        """The simulator that is offered, as given if no other is better."""
        return self.fit.offered if self.fit is not None else AS_GIVEN

    def to_json(self) -> dict[str, Any]:
        """verdict.json."""
        out = to_json(self)
        return {"schema": SCHEMA, **out, "fit": out["fit"] or {}, "budget": out["budget"] or {}}

    @staticmethod
    def read(verdict: Mapping[str, Any]) -> Verdict:
        """Verdict from verdict.json, without forces along the drives. Raises KeyError, TypeError or
        ValueError for invalid content."""
        fit, budget = verdict["fit"] or None, verdict["budget"] or None
        if fit is not None:
            fit = {"offered": CORRECTION if fit["validated"] else AS_GIVEN, **fit}
        return from_json(Verdict, {**verdict, "fit": fit, "budget": budget})
