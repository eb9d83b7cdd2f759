"""Records of a training run: checkpoint, learning curve, TensorBoard, model card."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import torch
from safetensors.torch import load_file
from safetensors.torch import save as to_bytes
from torch import Tensor

from deeptruck_cacc.controllers.policy import CORRECT_IT, GO_ON
from deeptruck_cacc.training.identity import CHECKPOINT, differences, facts_of, refuse_another
from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_core.terminal.progress import board


def save_checkpoint(out: Path, tensors: dict[str, Tensor], facts: dict[str, Any]) -> None:
    """Write tensors and facts to one file, so that a kill leaves either the old checkpoint or the new one."""
    whole = {name: t.detach().contiguous() for name, t in tensors.items()}
    content = to_bytes(whole, {"facts": json.dumps(facts)})
    files.write(out / CHECKPOINT, content, GO_ON)


def load_checkpoint(out: Path, identity: dict[str, Any]) -> tuple[dict[str, Tensor], dict[str, Any]] | None:
    """The last checkpoint under `out`, or None. Raises InputError for a damaged one or one of another run."""
    path = out / CHECKPOINT
    if not path.exists():
        return None
    facts = facts_of(out)
    refuse_another(out, differences(facts, identity))
    return load_file(path), facts


def adam_tensors(optimizer: torch.optim.Optimizer) -> dict[str, Tensor]:
    """An optimizer's state as flat named tensors."""
    return {
        f"adam.{index}.{key}": value if isinstance(value, Tensor) else torch.tensor(float(value))
        for index, entry in optimizer.state_dict()["state"].items()
        for key, value in entry.items()
    }


def restore_adam(optimizer: torch.optim.Optimizer, tensors: dict[str, Tensor]) -> None:
    """Inverse of adam_tensors."""
    state: dict[int, dict[str, Tensor]] = {}
    for name, tensor in tensors.items():
        if name.startswith("adam."):
            _, index, key = name.split(".")
            state.setdefault(int(index), {})[key] = tensor
    optimizer.load_state_dict({**optimizer.state_dict(), "state": state})


class Log:
    """Writes TensorBoard scalars to `out`/tensorboard and the same numbers to learning_curve.jsonl."""

    def __init__(self, out: Path, start: int) -> None:
        out.mkdir(parents=True, exist_ok=True)
        self._board = board(out / "tensorboard", start)
        self._path = out / "learning_curve.jsonl"
        kept = self._path.read_text().splitlines()[:start] if start and self._path.exists() else []
        self._path.write_text("".join(line + os.linesep for line in kept))

    def write(self, iteration: int, values: dict[str, Any]) -> None:
        """Write one line and one point of each value; for lists (one value per seed) the mean is charted."""
        try:
            with self._path.open("a") as file:
                file.write(json.dumps({"iteration": iteration, **values}) + "\n")
        except OSError as error:
            cure = files.advice(error, GO_ON, CORRECT_IT)
            raise InputError(f"cannot write {self._path}: {error.strerror}; {cure}") from None
        for name, value in values.items():
            point = sum(value) / len(value) if isinstance(value, list) else value
            self._board.add_scalar(name, point, iteration)

    def close(self) -> None:
        """Flush TensorBoard."""
        self._board.close()
