"""What an explanation is made of: causes, each a mechanism, a parameter or what has no name."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.mechanisms import Shape, comes_and_goes
from deeptruck_model.mismatch.posterior.free_model import FreeModel
from deeptruck_model.mismatch.posterior.road_lock import RoadLock
from deeptruck_model.mismatch.posterior.search import Model

Array = NDArray[np.float64]

GROUP = 9.0  # nats within which two names count as not told apart, or ...
GROUP_SHARE = 0.15  # of the gain: no form is quite right, and the larger an effect the more nats that costs
GROUP_SHARE_SLOW = 0.25  # the same for what comes and goes as it likes
GROUP_SHARE_RARE = 0.35  # the same for what was seen in a few windows: one event looks like another there
# Most that a name may be given, by how many others are told beside it: a law that nobody here has read is as
# far from every form as these are from one another (docs/results/mismatch.md).
SURE = (0.8, 0.65, 0.4)
SURE_UNKNOWN = 0.6


@dataclass(frozen=True)
class Cause:
    """One accepted cause: a mechanism (with its shape), a parameter, or what no name explains (`unknown`)."""

    kind: str
    effect: str
    gain: float
    share: float
    probability: float
    force: Array  # specific force it adds to the simulator, (n,), m/s^2
    shape: Shape | None = None
    rivals: tuple[tuple[str, float], ...] = ()  # other names and by how many nats they are worse
    nearest: str | None = None
    needed: dict[str, float] | None = None  # for a slow force: the size each possible name would need
    alternatives: tuple[tuple[str, Model], ...] = ()  # whole explanations with rivals in its place
    whole: Model | None = None  # the explanation these stand beside, where it is not the final one
    road: RoadLock | None = None  # where the force came again on the same stretch of road
    other_form: bool = False  # it acts by its own signals, but otherwise than the library's form
    lawless: bool = False  # an unknown force that comes and goes, and not one that the signals predict

    @property
    def predictable(self) -> bool:
        """Whether it is unknown, but the signals predict it: it has a shape over them, and perhaps a
        formula."""
        return self.effect == "unknown" and not self.lawless and self.needed is None

    @property
    def believed(self) -> float:
        """The probability that is told: what the fit says, but no more than such names proved right."""
        if self.kind != "missing_physics":
            return self.probability
        others = min(len(self.not_told_from), len(SURE) - 1)
        return min(self.probability, SURE_UNKNOWN if self.effect == "unknown" else SURE[others])

    @property
    def not_told_from(self) -> list[str]:
        """Names that do nearly as well."""
        near = max(GROUP, _group_share(self.shape) * self.gain)
        names = [name for name, worse in self.rivals if worse < near and name != self.effect]
        return list(dict.fromkeys([*names, *(["unknown"] if self.other_form else [])]))


def _group_share(shape: Shape | None) -> float:
    """Share of a gain within which other names are not told apart."""
    if shape is None:
        return GROUP_SHARE
    if "when" in shape.settings:
        return GROUP_SHARE_RARE
    return GROUP_SHARE_SLOW if comes_and_goes(shape) else GROUP_SHARE


@dataclass(frozen=True)
class Explanation:
    """Everything found on one body of evidence."""

    causes: tuple[Cause, ...]
    model: Model
    parameters_only: Model
    null: Model
    left_over: FreeModel
    left_over_gain: float
    lawful: (
        Model | None
    )  # the model with laws without a name beside it, where these explain what is left over
    ranking: tuple[
        tuple[str, float], ...
    ]  # every name tried beside the first cause, with its gain over parameters alone
