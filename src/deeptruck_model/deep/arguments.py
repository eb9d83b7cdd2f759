"""Arguments of a training run."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from deeptruck_core.errors import InputError

ADAPTING_UPDATES = 2000  # gradient steps from a truck that is learned already, whatever the amount of data
FUEL = 0.5  # cost of a fuel error of one standard deviation, where that of an acceleration is 1
# Cost of a fuel error of 1 cm^3/s. The paper says that its error stays below 1e-3: read as l/s that is
# 1 cm^3/s; in the cm^3/s that it prints no diesel would be known as accurately.
PAPER_FUEL = 1e-6
PAPER_PASSES = 600  # over the training data; "Model learning curves"
OPTIONS = {"updates": "budget", "start": "from"}  # what the command line calls these fields
LEAST = {
    "members": 1, "updates": 0, "steps": 2, "sequences": 1, "hidden": 1, "decoder": 1, "learning_rate": 0,
    "weight_decay": 0, "clip": 0, "speed_s": 0, "fuel": 0, "auxiliary": 0, "horizon_s": 0, "rounds": 1,
}  # fmt: skip
FASTEST = 1e30  # beyond, the optimiser's own numbers overflow


@dataclass(frozen=True)
class Arguments:
    """Settings of a training run, apart from the data. H is the LSTM and D the decoder of `network`; K and M
    are the paper's symbols for the sequence lengths in whose comments they stand."""

    seed: int = 0
    """member m starts from seed + m"""
    mode: Literal["default", "paper"] = "default"
    """default: deployment form, AdamW with a cosine; paper: training form, Adagrad, plain squared error"""
    form: Literal["", "training", "deployment"] = ""
    """which y is fed back while training; empty: the mode's own"""
    members: int = 1
    """models trained side by side; the truck is their mean, and their spread widens its intervals"""
    updates: int = 0
    """gradient steps; 0: chosen from the amount of data"""
    steps: int = 100
    """K, samples of one sequence; shortened where the recordings are shorter"""
    sequences: int = 16
    """M, sequences of one gradient"""
    hidden: int = 64
    """LSTM units of H"""
    decoder: int = 32
    """units of D"""
    learning_rate: float = 0.0
    """0: the mode's own"""
    weight_decay: float = 1e-4
    clip: float = 0.0
    """largest norm of one member's gradient; 0: the mode's own, 1 or in paper mode none"""
    speed_s: float = 5.0
    """a speed error costs as much as the acceleration that brings it about in this time; paper mode takes
    the plain squared errors"""
    fuel: float = 0.0
    """cost of a fuel error of one standard deviation, in paper mode of 1 cm^3/s; 0: the mode's own"""
    auxiliary: float = 0.3
    """the same for the auxiliary targets: gear, engine speed and torque where recorded, which D gives besides
    the response and which are never fed back"""
    kind: Literal["black", "grey"] = "black"
    """black: D gives the response; grey: and gains by which u, w and command/speed add to it"""
    code: int = 12
    """features that repeat the speed on a logarithmic scale, where gears are evenly spaced"""
    start: str = ""
    """simulator directory of a deep truck to adapt, instead of random weights; its kind and sizes count"""
    horizon_s: float = 40.0
    """length of the free runs that select the checkpoint"""
    rounds: int = 40
    """validations, TensorBoard points and resume points of a run"""

    def __post_init__(self) -> None:
        """Raises InputError for an invalid value."""
        for name, least in LEAST.items():
            value = getattr(self, name)
            if not least <= value < math.inf:
                called = f"{OPTIONS[name]} ({name} in Python)" if name in OPTIONS else name
                raise InputError(f"{called} is {value:g}; it must be at least {least:g}")
        if self.learning_rate > FASTEST:
            raise InputError(f"learning_rate is {self.learning_rate:g}; it must be at most {FASTEST:g}")

    @property
    def feedback(self) -> str:
        """'training' or 'deployment'."""
        return self.form or ("training" if self.mode == "paper" else "deployment")


def default_updates(samples: int) -> int:
    """Number of gradient steps for an amount of data: the 85 % of 4 h at 10 Hz used for training get 10,200,
    about a minute of one core.

    One step for every 12 samples, at least 1,500 and at most 12,000: with more steps the training drives are
    fitted ever more closely, but other drives no better.
    """
    return min(max(samples // 12, 1500), 12000)
