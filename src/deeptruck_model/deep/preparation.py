"""What a training run needs of its recordings, in the order it is made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from deeptruck_model.deep.network import Scales
from deeptruck_model.deep.windows import (
    Sequences,
    common_interface,
    consistent,
    cut,
    measure_scales,
    teachable,
    time_split,
    unexplained,
)
from deeptruck_model.errors import InputError
from deeptruck_model.recordings import Recording, data_hash
from deeptruck_model.signals import TruckInterface

if TYPE_CHECKING:
    from deeptruck_model.deep.training import Arguments


@dataclass(frozen=True)
class Prepared:
    """Pieces that train and pieces that judge, and both as sequences in the network's units."""

    interface: TruckInterface
    training: list[Recording]
    validation: list[Recording]
    taught: tuple[str, ...]
    scales: Scales
    sequences: Sequences
    held_out: Sequences
    data_hash: str
    unexplained: float
    """share of the rows left out because the truck braked by something that is not recorded"""

    @property
    def dt(self) -> float:
        """Step in s."""
        return self.training[0].dt

    @property
    def samples(self) -> int:
        """Rows that train."""
        return sum(len(p) for p in self.training)

    def steps(self, wanted: int) -> int:
        """K: `wanted`, or what the longest piece allows."""
        return min(wanted, max(len(p) for p in self.training) - 1)


def prepare(recordings: Sequence[Recording], arguments: Arguments) -> Prepared:
    """Cut, mend and split the recordings. Raises InputError where nothing can be trained on."""
    interface = common_interface(recordings)
    pieces = [piece for recording in recordings for piece in cut(recording, interface)]
    if not pieces:
        raise InputError(
            "no stretch of 3 s with valid inputs and speed in the recordings; see 'deeptruck-model coverage'"
        )
    if arguments.mode == "default":
        pieces = [consistent(piece) for piece in pieces]
    training, validation = time_split(pieces)
    taught = teachable(training) if arguments.teach and arguments.mode == "default" else ()
    scales = measure_scales(training, taught)
    return Prepared(
        interface,
        training,
        validation,
        taught,
        scales,
        Sequences.of(training, scales, taught),
        Sequences.of(validation, scales, taught),
        data_hash(pieces),
        float(np.mean(np.concatenate([unexplained(r, interface) for r in recordings]))),
    )
