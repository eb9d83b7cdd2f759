"""Recordings a deep truck keeps beside its weights: driving it was not fitted to, as a measure of its own
error.

Whoever compares the truck with new recordings must know which differences are only what was learned
imperfectly.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save as to_bytes

from deeptruck_model.errors import InputError
from deeptruck_model.recordings import Recording
from deeptruck_model.signals import TruckInterface

Array = NDArray[Any]

FILE = "reference.safetensors"
MOST_S = 3600.0  # of driving: enough to know an error by, small enough to carry along


def save(recordings: Sequence[Recording], folder: Path) -> None:
    """Write at most MOST_S of the recordings, float32, into `folder`."""
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
    (folder / FILE).write_bytes(to_bytes(tensors, metadata={"recordings": json.dumps(heads)}))


def load(folder: Path) -> tuple[Recording, ...]:
    """The recordings kept in `folder`; none where it has no such file. Raises InputError for a damaged
    one."""
    path = folder / FILE
    if not path.exists():
        return ()
    try:
        with safe_open(path, framework="numpy") as file:
            heads = json.loads(file.metadata()["recordings"])
            channels: list[dict[str, Array]] = [{} for _ in heads]
            for key in file.keys():  # noqa: SIM118 - the file is no mapping
                index, name = key.split("/", 1)
                channels[int(index)][name] = file.get_tensor(key).astype(np.float64)
    except (SafetensorError, OSError, KeyError, ValueError, IndexError) as error:
        raise InputError(f"{path} is damaged ({error}); train the simulator again") from None
    return tuple(
        Recording(h["name"], h["dt"], c, TruckInterface.from_dict(h["interface"]), h["start_s"])
        for h, c in zip(heads, channels, strict=True)
    )
