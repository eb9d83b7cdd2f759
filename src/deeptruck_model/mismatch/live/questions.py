"""Questions that a node asks about the newest messages of a truck, and their answers (`live.answer`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from deeptruck_model.mismatch.live.own import Own
from deeptruck_model.mismatch.mechanisms.families import ROOT
from deeptruck_model.mismatch.posterior.names import Node
from deeptruck_model.recordings.resample import Received


@dataclass(frozen=True)
class Question:
    """A question about the last minutes of a truck, or (`adapts`) about the first minutes of its drive.

    `own` is the simulator's present adaptation. With `no_load` no command drives the truck.
    """

    simulator: str
    heard: Mapping[str, Received]
    own: Own | None = None
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

    found: NamesReply | Own | None
    refused: str = ""
    cpu_s: float = 0.0
