"""Prepares recordings for a training run, step by step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np

from deeptruck_core.errors import InputError
from deeptruck_core.signals import CHANNELS, TruckInterface
from deeptruck_model.deep import remarks
from deeptruck_model.deep.arguments import Arguments
from deeptruck_model.deep.coverage import Driven
from deeptruck_model.deep.data import (
    HELD_OUT,
    SHORTEST_S,
    Scales,
    Sequences,
    auxiliary_targets,
    common_interface,
    consistent,
    cut,
    measure_scales,
    time_split,
    unexcited,
    unexplained,
)
from deeptruck_model.deep.network import TruckNetwork
from deeptruck_model.deep.truck import DeepTruck, load_directory
from deeptruck_model.recordings import Recording, data_hash, splits
from deeptruck_model.recordings.consistency import sensors
from deeptruck_model.simulators import read_manifest


@dataclass(frozen=True)
class Prepared:
    """Training and validation pieces, and both as sequences in the network's units."""

    interface: TruckInterface
    training: list[Recording]
    validation: list[Recording]
    auxiliary: tuple[str, ...]
    """targets besides the response"""
    scales: Scales
    sequences: Sequences
    held_out: Sequences
    data_hash: str
    start: TruckNetwork | None
    """the network to adapt, where there is one"""
    driven: Driven | None
    """what that learned from"""
    trained_on: tuple[str, ...]
    """hashes of the speed of the recordings, and of those that trained `start`"""
    unexplained: float
    """share of the rows left out because the truck braked by something that is not recorded"""
    unexcited: tuple[str, ...]
    """inputs that never vary in the training pieces, and what is not learned for that, a line each"""

    @property
    def dt(self) -> float:
        """Step in s."""
        return self.training[0].dt

    @property
    def samples(self) -> int:
        """Number of training rows."""
        return sum(len(p) for p in self.training)

    def steps(self, wanted: int) -> int:
        """Sequence length K: `wanted`, or the length of the longest piece if that is less."""
        return min(wanted, max(len(p) for p in self.training) - 1)


def prepare(recordings: Sequence[Recording], arguments: Arguments) -> Prepared:
    """Cut, correct and split the recordings. Raises InputError if there is nothing to train on."""
    splits.refuse_shared(recordings)
    for _, pieces_of in groupby(recordings, lambda r: r.name.partition("#")[0]):
        sensors.refuse(list(pieces_of))
    interface = common_interface(recordings)
    pieces = [piece for recording in recordings for piece in cut(recording, interface)]
    if not pieces:
        raise InputError(
            "no segment of 3 s with valid inputs and speed in the recordings; see 'deeptruck-model coverage'"
        )
    if arguments.mode == "default":
        pieces = [consistent(piece) for piece in pieces]
    training, validation = time_split(pieces)
    _judgeable(validation, pieces, interface)
    auxiliary = auxiliary_targets(training) if arguments.auxiliary and arguments.mode == "default" else ()
    scales, start, driven = measure_scales(training, auxiliary), None, None
    seen = tuple(remarks.speed_hash(r) for r in recordings)
    if arguments.start:
        known = _start(Path(arguments.start), interface, pieces[0].dt)
        start, auxiliary = known.network, tuple(known.details.get("auxiliary", ()))
        driven = known.driven
        seen += tuple(known.details.get(remarks.KEY, ()))
        scales = Scales(start.mean.numpy(), start.scale.numpy(), start.top_speed)
    return Prepared(
        interface,
        training,
        validation,
        auxiliary,
        scales,
        Sequences.of(training, scales, auxiliary),
        Sequences.of(validation, scales, auxiliary),
        data_hash(pieces),
        start,
        driven,
        tuple(dict.fromkeys(seen)),
        float(np.mean(np.concatenate([unexplained(r, interface) for r in recordings]))),
        unexcited(training, interface),
    )


def _judgeable(
    validation: Sequence[Recording], pieces: Sequence[Recording], interface: TruckInterface
) -> None:
    """Raises InputError, before training, if no held-out recording is long enough for a free run."""
    if any(cut(piece, interface) for piece in validation):
        return
    dt, longest = pieces[0].dt, max(len(p) * p.dt for p in pieces)
    least = math.ceil((SHORTEST_S + dt) / HELD_OUT)
    raise InputError(
        f"the longest segment with valid inputs and speed is {longest:.0f} s, too short: its last "
        f"{HELD_OUT:.0%} judge the truck and must last {SHORTEST_S:g} s; give {least} s or more without a gap"
    )


def _start(path: Path, interface: TruckInterface, dt: float) -> DeepTruck:
    """The truck under `path` that is to be adapted. Raises InputError if it is no deep truck, or has other
    signals."""
    manifest = read_manifest(path)
    if manifest.get("kind") != "deep":
        raise InputError(f"{path} is no deep truck; only one of those can be adapted")
    truck = load_directory(path, manifest)
    differ = _differences(truck.interface, interface)
    if abs(truck.dt - dt) > 1e-6:
        differ.append(f"steps of {truck.dt:g} s, given {dt:g} s")
    if differ:
        raise InputError(
            f"{path} has other signals, units or rate than the recordings: {'; '.join(differ)}; train from "
            "scratch, without --from"
        )
    return truck


def _differences(theirs: TruckInterface, ours: TruckInterface) -> list[str]:
    """Signals that only one of two interfaces has, or that differ in units, in words."""
    found = []
    for name in CHANNELS:
        had, has_it = (name in (*x.u, *x.w, *x.y) for x in (theirs, ours))
        if had != has_it:
            found.append(f"{name} is only in the {'truck' if had else 'recordings'}")
        elif had and theirs.unit(name) != ours.unit(name):
            found.append(f"{name} in {theirs.unit(name)}, given in {ours.unit(name)}")
    return found
