"""Where a killed training run goes on: weights, optimiser and best weights, in safetensors, replaced
atomically."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save as to_bytes
from torch import Tensor

from deeptruck_model import files
from deeptruck_model.deep.identity import differences
from deeptruck_model.deep.network import WEIGHTS, TruckNetwork
from deeptruck_model.errors import InputError

if TYPE_CHECKING:
    from deeptruck_model.deep.selection import Best

FILE = "resume.safetensors"


def save(
    folder: Path,
    identity: dict[str, Any],
    network: TruckNetwork,
    optimizers: Sequence[torch.optim.Optimizer],
    best: Best,
    done: int,
) -> None:
    """Write the whole state after `done` updates; the file before it stays until this one is complete."""
    tensors: dict[str, Tensor] = {f"weight.{n}": getattr(network, n).detach() for n in WEIGHTS}
    tensors |= {f"best.{n}": best.weights[n] for n in WEIGHTS}
    for which, optimizer in enumerate(optimizers):
        for index, values in optimizer.state_dict()["state"].items():
            tensors |= {f"optimizer.{which}.{index}.{key}": value for key, value in values.items()}
    metadata = {
        "identity": json.dumps(identity, sort_keys=True),
        "done": str(done),
        "scores": json.dumps(best.scores.tolist()),
    }
    content = to_bytes({k: v.contiguous() for k, v in tensors.items()}, metadata)
    files.write(folder / FILE, content, "make room and go on with --resume")


def load(
    folder: Path,
    identity: dict[str, Any],
    network: TruckNetwork,
    optimizers: Sequence[torch.optim.Optimizer],
    best: Best,
) -> int:
    """Restore what `save` wrote and return the updates done; 0 where there is nothing to go on from.

    Raises InputError where the folder holds another run (other data or arguments) or a damaged file.
    """
    if not (folder / FILE).exists():
        return 0
    try:
        with safe_open(folder / FILE, framework="pt") as file:
            metadata, tensors = file.metadata(), {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118
    except (OSError, SafetensorError) as error:
        raise InputError(f"{folder / FILE} is damaged ({error}); add --overwrite to begin anew") from None
    stored = json.loads(metadata["identity"])
    if stored != json.loads(json.dumps(identity)):
        raise InputError(
            f"{folder} is another run ({differences(stored, identity)}); repeat that one, or add "
            "--overwrite instead of --resume to begin anew"
        )
    for name in WEIGHTS:
        getattr(network, name).data.copy_(tensors[f"weight.{name}"])
        best.weights[name].copy_(tensors[f"best.{name}"])
    best.scores = np.array(json.loads(metadata["scores"]))
    states = [optimizer.state_dict() for optimizer in optimizers]
    for key, value in tensors.items():
        if key.startswith("optimizer."):
            _, which, index, entry = key.split(".", 3)
            states[int(which)]["state"].setdefault(int(index), {})[entry] = value
    for optimizer, state in zip(optimizers, states, strict=True):
        optimizer.load_state_dict(state)
    return int(metadata["done"])
