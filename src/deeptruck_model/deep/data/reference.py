"""Recordings a deep truck keeps beside its weights: driving it was not fitted to, as a measure of its own
error.

Whoever compares the truck with new recordings must know which differences are only what was learned
imperfectly.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import safe_open
from safetensors.numpy import load_file as load_arrays
from safetensors.numpy import save as arrays_to_bytes

from deeptruck_model.deep.data.driven import Driven
from deeptruck_model.deep.data.weights_file import tensors
from deeptruck_model.errors import InputError
from deeptruck_model.recordings import Recording
from deeptruck_model.signals import CHANNELS, TruckInterface

Array = NDArray[Any]

FILE = "reference.safetensors"
DRIVEN_FILE = "driven.safetensors"
MOST_S = 3600.0  # of driving: enough to know an error by, small enough to carry along


def save(recordings: Sequence[Recording], folder: Path) -> None:
    """Write at most MOST_S of the recordings, float32, into `folder`.

    They were not trained on: whoever compares the truck with new recordings must know its own error.
    """
    tensors: dict[str, Array] = {}
    heads: list[dict[str, object]] = []
    seconds = 0.0
    for i, r in enumerate(recordings):
        if seconds >= MOST_S:
            break
        r = r.piece(0, min(len(r), round((MOST_S - seconds) / r.dt)))
        seconds += len(r) * r.dt
        heads.append({"name": r.name, "dt": r.dt, "start_s": r.start_s, "interface": r.interface.to_dict()})
        tensors |= {f"{i}/{name}": x.astype(np.float32) for name, x in r.channels.items()}
    # not by save_file: that leaves files which nobody else may read
    (folder / FILE).write_bytes(arrays_to_bytes(tensors, metadata={"recordings": json.dumps(heads)}))


def load(folder: Path) -> tuple[Recording, ...]:
    """The recordings kept in `folder`; none where it has no such file. Raises InputError for a damaged
    one."""
    path = folder / FILE
    if not path.exists():
        return ()
    found: tuple[Recording, ...] = tensors(path, _load)
    return found


def _load(path: Path) -> tuple[Recording, ...]:
    """Raises what Python does where the file holds something else, and ValueError for what cannot be."""
    with safe_open(path, framework="numpy") as file:
        heads = json.loads((file.metadata() or {})["recordings"])
        channels: list[dict[str, Array]] = [{} for _ in heads]
        for key in file.keys():  # noqa: SIM118 - the file is no mapping
            index, name = key.split("/", 1)
            with np.errstate(invalid="ignore"):  # of NaNs, which are missing samples
                channels[int(index)][name] = file.get_tensor(key).astype(np.float64)
    return tuple(_recording(head, one) for head, one in zip(heads, channels, strict=True))


def _recording(head: dict[str, Any], channels: dict[str, Array]) -> Recording:
    interface = TruckInterface.from_dict(head["interface"])
    dt, start_s = float(head["dt"]), float(head["start_s"])
    if not 0.0 < dt <= 60.0 or not math.isfinite(start_s):
        raise ValueError(f"dt is {dt:g} s, start_s {start_s:g} s")
    needed = {"acceleration", "speed", *interface.u, *interface.w, *interface.y}
    if not needed <= set(channels) <= set(CHANNELS):
        raise ValueError(f"channels are {', '.join(channels)}")
    if len({x.shape for x in channels.values()}) != 1 or channels["speed"].ndim != 1:
        raise ValueError("channels differ in length")
    return Recording(str(head["name"]), dt, channels, interface, start_s)


def save_driven(driven: Driven, folder: Path) -> None:
    """Write DRIVEN_FILE into `folder`."""
    (folder / DRIVEN_FILE).write_bytes(arrays_to_bytes({"samples": driven.samples, "near": driven.near}))


def _read_driven(path: Path) -> Driven:
    stored = load_arrays(path)
    return Driven(stored["samples"], stored["near"])


def load_driven(folder: Path, columns: int) -> Driven | None:
    """What is kept in `folder`, of `columns` signals; None where it has no such file. Raises InputError for a
    damaged one."""
    path = folder / DRIVEN_FILE
    if not path.exists():
        return None
    driven = tensors(path, _read_driven)
    if not (np.isfinite(driven.samples).all() and np.isfinite(driven.near).all() and (driven.near > 0).all()):
        raise InputError(f"{path} holds values that are not possible; train the simulator again")
    if driven.samples.ndim != 2 or driven.samples.shape[1] != columns or driven.near.shape != (columns,):
        raise InputError(f"{path} is of other signals than the truck beside it; files were edited or mixed")
    return driven
