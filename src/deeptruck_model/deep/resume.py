"""Saves and restores the state of a training run, and checks that a run continues the saved one.

Weights, optimiser and best weights are kept in safetensors, replaced atomically.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save as to_bytes
from torch import Tensor

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_model.deep.arguments import ADAPTING_UPDATES, OPTIONS, PAPER_PASSES, Arguments, default_updates
from deeptruck_model.deep.io import current
from deeptruck_model.deep.network import WEIGHTS, TruckNetwork
from deeptruck_model.deep.optimizer import Best
from deeptruck_model.deep.preparation import Prepared
from deeptruck_model.simulators import MANIFEST, read_manifest

FILE = "resume.safetensors"
KEYS = ("arguments", "data_hash", "steps", "updates")


def save(
    folder: Path,
    identity: dict[str, Any],
    network: TruckNetwork,
    optimizers: Sequence[torch.optim.Optimizer],
    best: Best,
    done: int,
) -> None:
    """Write the whole state after `done` updates; the previous file is kept until the new one is complete."""
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
    """Restore what `save` wrote and return the number of updates done; 0 if nothing was saved.

    Raises InputError if the folder holds another run (other data or arguments) or a damaged file.
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


def identity_of(data: Prepared, arguments: Arguments) -> dict[str, Any]:
    """The properties that a resumed run must share with the interrupted one."""
    steps = data.steps(arguments.steps)
    batches = max(1, data.samples // (steps * arguments.sequences))
    chosen = PAPER_PASSES * batches if arguments.mode == "paper" else default_updates(data.samples)
    chosen = ADAPTING_UPDATES if data.start is not None else chosen
    return {
        "arguments": asdict(arguments),
        "data_hash": data.data_hash,
        "steps": steps,
        "updates": arguments.updates or chosen,
    }


def identity_in(folder: Path) -> dict[str, Any] | None:
    """The identity of the finished run in a simulator directory; None if there is none."""
    if not (folder / MANIFEST).exists():
        return None
    manifest = current(read_manifest(folder))
    run = manifest.get("training", {})
    found = (manifest.get("config"), manifest.get("data_hash"), run.get("steps"), run.get("updates"))
    return dict(zip(KEYS, found, strict=True))


def differences(stored: Mapping[str, Any], given: Mapping[str, Any]) -> str:
    """The differences between the `stored` identity and the one `given`, in words: 'seed was 0, given 5'."""
    old, new = stored.get("arguments") or {}, given["arguments"]
    found = [
        f"{OPTIONS.get(name, name)} was {_value(old.get(name))}, given {_value(new[name])}"
        for name in new
        if old.get(name) != new[name]
    ]
    # paper and default mode mend the recordings differently: their hashes say nothing of one another
    if old.get("mode") == new["mode"] and stored.get("data_hash") != given["data_hash"]:
        found.append("the recordings were others")
    return "; ".join(found) or "another version of this program began it"


def _value(value: Any) -> str:
    return "not set" if value in ("", None) else str(value)
