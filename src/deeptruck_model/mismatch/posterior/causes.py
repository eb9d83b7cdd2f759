"""Whether a slow force belongs to the road: it comes again where the same stretch is driven again.

Stretches are found by the force itself, without GPS: a window of the force along the distance is laid over
all other driving, as it is for a pass the same way, and turned round with the other sign for a pass the other
way, as only a slope does that. How well windows agree by chance is seen from the two comparisons that no road
can cause: the same way with the other sign, and turned round with the same sign.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.mechanisms import CandidateTerm
from deeptruck_model.mismatch.posterior.free_law import FreeModel
from deeptruck_model.mismatch.posterior.search import Model
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Rules

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

STEP_M, LENGTH_M = 100.0, 6000.0  # a shorter window of a smooth force is like many others
MOST_LOG = 30.0  # of the odds of a name against the one that was told
EVERY = 8  # steps between the windows that are sought again


@dataclass(frozen=True)
class RoadLock:
    """Distance (km) over which the force came again on a pass the same way and the other way, how well
    it agreed there, and how well 99 % of windows agree at most by chance."""

    same_way_km: float
    other_way_km: float
    agreement: float
    by_chance: float


@dataclass(frozen=True)
class Windows:
    """Windows of the force (m, k) without their means, the recording of each, and where it begins (m)."""

    force: Array
    record: Indices
    at: Array

    @staticmethod
    def of(e: Evidence, force: Array) -> Windows:
        """Every window of LENGTH_M along each recording, STEP_M apart."""
        width = int(LENGTH_M / STEP_M)
        parts, record, at = [], [], []
        for i, s in enumerate(e.stretches):
            along, known = e["distance"][s.rows], e.valid[s.rows]
            grid = np.arange(along[0], along[-1], STEP_M)
            if len(grid) < width or not known.any():
                continue
            profile = np.interp(grid, along[known], force[s.rows][known])
            made = np.lib.stride_tricks.sliding_window_view(profile, width)
            parts.append(made - made.mean(axis=1, keepdims=True))
            record.append(np.full(len(made), i))
            at.append(grid[: len(made)])
        if not parts:
            return Windows(np.zeros((0, width)), np.zeros(0, dtype=np.intp), np.zeros(0))
        return Windows(np.concatenate(parts), np.concatenate(record), np.concatenate(at))


def road_lock(e: Evidence, force: Array) -> RoadLock | None:
    """Where a slow specific force (n,) came again; None where no road was seen twice."""
    windows = Windows.of(e, force)
    picked = np.arange(0, len(windows.at), EVERY)
    if len(picked) < e.rules.road_windows / e.rules.road_share:
        return None
    a = windows.force[picked]
    same, other = _best(windows, picked, a), _best(windows, picked, -a[:, ::-1])
    chance = np.concatenate([_best(windows, picked, -a), _best(windows, picked, a[:, ::-1])])
    limit = float(np.quantile(chance, e.rules.road_by_chance))
    same_km, other_km = _beyond_chance(same > limit, e.rules), _beyond_chance(other > limit, e.rules)
    if not same_km and not other_km:
        return None
    again = np.maximum(same if same_km else -1.0, other if other_km else -1.0)
    return RoadLock(same_km, other_km, float(np.median(again[again > limit])), limit)


def _beyond_chance(found: NDArray[np.bool_], rules: Rules) -> float:
    """Kilometres of the windows that were found again, 0 where they are so few that chance alone finds
    them."""
    km = round(EVERY * STEP_M / 1000.0 * int(found.sum()), 1)
    enough = found.mean() >= rules.road_share and km >= rules.road_windows * LENGTH_M / 1000.0
    return km if enough else 0.0


def _best(windows: Windows, picked: Indices, force: Array) -> Array:
    """How well each of the windows `force` (m, k) agrees with the most alike elsewhere: 1 for the same, 0 for
    no likeness."""
    size = np.sum(windows.force**2, axis=1)
    alike = 2.0 * (force @ windows.force.T) / (np.sum(force**2, axis=1)[:, None] + size[None] + 1e-12)
    for row, i in enumerate(picked):
        here = (windows.record == windows.record[i]) & (np.abs(windows.at - windows.at[i]) < LENGTH_M)
        alike[row, here] = -1.0
    best: Array = alike.max(axis=1)
    return best


@dataclass(frozen=True)
class Cause:
    """One accepted cause: a mechanism (with its term), a parameter, or what no name explains (`unknown`)."""

    kind: str
    effect: str
    gain: float
    share: float
    force: Array  # specific force it adds to the simulator, (n,), m/s^2
    term: CandidateTerm | None = None
    rivals: tuple[tuple[str, float], ...] = ()  # other names and by how many nats they are worse
    nearest: str | None = None
    needed: dict[str, float] | None = None  # for a slow force: the size each possible name would need
    alternatives: tuple[tuple[str, Model], ...] = ()  # whole explanations with rivals in its place
    whole: Model | None = None  # the explanation these stand beside, where it is not the final one
    road: RoadLock | None = None  # where the force came again on the same stretch of road
    other_form: bool = False  # it acts by its own signals, but otherwise than the library's form
    time_varying: bool = False  # an unknown force that is time-varying, and not one that the signals predict
    rules: Rules = field(default_factory=Rules)  # by which it is distinguishable from others

    @property
    def predictable(self) -> bool:
        """Whether it is unknown, but the signals predict it: it has a candidate term over them, and perhaps a
        formula."""
        return self.effect == "unknown" and not self.time_varying and self.needed is None

    @property
    def names(self) -> dict[str, float]:
        """The probability of each name in its place, given that it is one of these; most probable first.

        No law is exactly of the library's form, and how far it strays grows with its size: evidence is
        divided by a share of all that was gained (a coarsened posterior: Miller and Dunson, Journal of the
        American Statistical Association 114, 2019), so that more data alone decides nothing.
        """
        scale = max(self.rules.temper, self.rules.coarse * self.gain)
        worse = dict(reversed(self.rivals))
        worse |= {"unknown": 0.0} if self.other_form else {}
        worse[self.effect] = 0.0
        weight = {name: float(np.exp(min(-x / scale, MOST_LOG))) for name, x in worse.items()}
        nothing = float(np.exp(-self.gain / scale)) if self.gain > 0.0 else 0.0
        total = nothing + sum(weight.values())
        order = sorted(weight, key=lambda name: (-weight[name], name != self.effect))
        return {name: weight[name] / total for name in order}

    @property
    def believed(self) -> float:
        """The probability that is told. A law that nobody here has read may be none of the names."""
        fitted = self.names[self.effect]
        if self.kind != "missing_physics":
            return fitted
        rules = self.rules
        return fitted * (rules.recognised_unknown if self.effect == "unknown" else rules.recognised)

    @property
    def not_told_from(self) -> list[str]:
        """The other names of the smallest set that holds the right one with probability `credible`."""
        names = self.names
        before = np.cumsum([0.0, *names.values()])[:-1]
        kept = [
            name for name, sum_before in zip(names, before, strict=True) if sum_before < self.rules.credible
        ]
        return [name for name in kept if name != self.effect]


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
