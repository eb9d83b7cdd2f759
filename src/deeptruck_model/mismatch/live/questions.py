"""Questions that a node asks about the newest messages of a truck, and their answers (`live.answer`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from deeptruck_model.mismatch.mechanisms.families import ROOT
from deeptruck_model.mismatch.posterior.names import Node
from deeptruck_model.mismatch.residual.components import Shares
from deeptruck_model.recordings.resample import Received

LOAD, WIND, CONSTANT = "load", "wind", "constant"
UNITS = {LOAD: "1", WIND: "m/s", CONSTANT: "m/s^2"}


class State(StrEnum):
    """Whether a quantity is known."""

    UNESTIMATED = "unestimated"
    """the drive does not show it"""
    ESTIMATED = "estimated"
    INVALID = "invalid"
    """the estimate leaves what a vehicle can have, and is not used"""


@dataclass(frozen=True)
class Quantity:
    """A quantity: its posterior mean with a 95 % interval, and the probability that it differs from the
    simulator's.

    `load` is the relative change of mass, `wind` a headwind in m/s, `constant` an acceleration in m/s^2.
    """

    state: State = State.UNESTIMATED
    value: float = 0.0
    ci95: tuple[float, float] = (0.0, 0.0)
    probability: float = 0.0


@dataclass(frozen=True)
class DriveState:
    """Load, wind and constant force of a drive, from its first `seconds` that could be compared. `shares`
    split the forces of a simulator that does not report them."""

    load: Quantity
    wind: Quantity
    constant: Quantity
    seconds: float = 0.0
    shares: Shares | None = field(default=None, compare=False)

    @property
    def each(self) -> Mapping[str, Quantity]:
        """The quantities by name."""
        return {LOAD: self.load, WIND: self.wind, CONSTANT: self.constant}

    @property
    def known(self) -> bool:
        """Whether anything is estimated."""
        return any(q.state is State.ESTIMATED for q in self.each.values())

    def used(self, name: str) -> float:
        """The value set in the adapted simulator: if anything is estimated the posterior mean of each,
        because two may share one force; else zero."""
        q = self.each[name]
        return q.value if self.known and q.state is not State.INVALID else 0.0

    def __str__(self) -> str:
        """The estimates as text, or that there are none."""
        says = [_says(name, q) for name, q in self.each.items() if q.state is not State.UNESTIMATED]
        return "; ".join(says) or "nothing of its own shows: the simulator is as given"


def _says(name: str, q: Quantity) -> str:
    if q.state is State.INVALID:
        return f"{name} invalid: the estimate leaves what a vehicle can have"
    scale, unit = (100.0, "% of mass") if name == LOAD else (1.0, UNITS[name])
    value, low, high = (f"{scale * x:+.3g}" for x in (q.value, *q.ci95))
    return f"{name} {value} {unit} ({low} to {high}, 95 %)"


@dataclass(frozen=True)
class Question:
    """A question about the last minutes of a truck, or (`adapts`) about the first minutes of its drive.

    `state` is the simulator's present adaptation. With `no_load` no command drives the truck.
    """

    simulator: str
    heard: Mapping[str, Received]
    state: DriveState | None = None
    adapts: float = 0.0  # s from the start by which the simulator is adapted to the drive; 0: find names
    no_load: bool = False


@dataclass(frozen=True)
class NamesReply:
    """Answer about the last minutes: the `nodes` of the tree with their probabilities, the sentence `says`,
    the `stated` node (ROOT: none), and the budget: its shares by part, and the speed error (m/s) over the
    horizon (s)."""

    says: str
    stated: str = ROOT
    nodes: tuple[Node, ...] = ()
    shares: Mapping[str, float] | None = None
    speed_rmse: float = float("nan")
    horizon_s: float = float("nan")


@dataclass(frozen=True)
class Reply:
    """The result, or why the question is `refused`, and the processor time used, s."""

    found: NamesReply | DriveState | None
    refused: str = ""
    cpu_s: float = 0.0
