"""Decides whether a training continues another one, by the properties that both must share."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open

from deeptruck_cacc.controllers.loading import read_manifest
from deeptruck_cacc.controllers.policy import MANIFEST
from deeptruck_core.errors import InputError
from deeptruck_core.files import unfinished
from deeptruck_model.outside.reference import is_outside, refer

CHECKPOINT = Path("checkpoint") / "state.safetensors"


def identity_of(trainer: str, config: Any, source: str) -> dict[str, Any]:
    """The properties that a resumed run must share with the interrupted one; part of its checkpoints and
    cards."""
    return {
        "trainer": trainer,
        "config": asdict(config),
        "simulator": source,
        "simulator_sha256": simulator_hash(source),
    }


def differences(stored: Mapping[str, Any], given: Mapping[str, Any]) -> str:
    """The differences between the `stored` identity and the one `given`, in words: 'seeds was 3, given 5'; ''
    if there are none.

    Checkpoints of earlier versions do not store trainer and simulator, which then count as equal.
    """
    if stored.get("trainer", given["trainer"]) != given["trainer"]:
        return f"trainer was {stored['trainer']}, given {given['trainer']}"
    old, new = stored.get("config", {}), json.loads(json.dumps(given["config"]))
    found = [
        f"{name} was {_value(old.get(name))}, given {_value(new.get(name))}"
        for name in {**new, **old}
        if old.get(name) != new.get(name)
    ]
    if stored.get("simulator_sha256", given["simulator_sha256"]) != given["simulator_sha256"]:
        was, now = stored.get("simulator"), given["simulator"]
        found.append(f"simulator was {was}, given {now}" if was != now else f"simulator {now} has changed")
    return "; ".join(found)


def refuse_another(out: Path, differs: str) -> None:
    """Raises InputError if there are differences."""
    if differs:
        raise InputError(
            f"{out} is another run ({differs}); repeat that one, choose another --out, or begin anew with"
            " --overwrite in place of --resume"
        )


def finished(out: Path, given: Mapping[str, Any]) -> bool:
    """Whether `out` holds the result of `given`. Raises InputError if it holds only that of another run."""
    if not (out / MANIFEST).exists():
        return False
    differs = differences(read_manifest(out).get("card", {}), given)
    if not (
        unfinished(out) / CHECKPOINT
    ).exists():  # otherwise a run that was to replace this policy may have been killed
        refuse_another(out, differs)
    return not differs


def facts_of(draft: Path) -> dict[str, Any]:
    """The facts in a checkpoint, without its tensors. Raises InputError if it is damaged."""
    path = draft / CHECKPOINT
    try:
        with safe_open(path, "np") as file:
            facts = json.loads(file.metadata()["facts"])
    except (SafetensorError, OSError, KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{path} is damaged ({error}); begin anew with --overwrite in place of --resume"
        ) from None
    return dict(facts)


def _value(value: Any) -> str:
    return "not set" if value in ("", None) else str(value)


def simulator_hash(path: str) -> str:
    """SHA-256 over the files of a simulator directory or an outside simulator, or over the name of a physics
    truck."""
    digest = hashlib.sha256()
    if is_outside(path):
        return hashlib.sha256(json.dumps(refer(path).to_dict()).encode()).hexdigest()
    folder = Path(path)
    if not path or not folder.is_dir():
        return hashlib.sha256(path.encode()).hexdigest()
    for file in sorted(p for p in folder.iterdir() if p.is_file()):
        digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()
