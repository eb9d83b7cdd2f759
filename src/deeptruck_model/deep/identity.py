"""Whether a run is another one's continuation: what both must have in common, and what differs if not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from deeptruck_model.deep.arguments import (
    ADAPTING_UPDATES,
    OPTIONS,
    PAPER_PASSES,
    Arguments,
    default_updates,
)
from deeptruck_model.deep.data.preparation import Prepared
from deeptruck_model.simulators import MANIFEST, read_manifest

KEYS = ("arguments", "data_hash", "steps", "updates")


def identity_of(data: Prepared, arguments: Arguments) -> dict[str, Any]:
    """What a resumed run must have in common with the killed one."""
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
    """The identity of the finished run in a simulator directory; None where there is none."""
    if not (folder / MANIFEST).exists():
        return None
    manifest = read_manifest(folder)
    run = manifest.get("training", {})
    found = (manifest.get("config"), manifest.get("data_hash"), run.get("steps"), run.get("updates"))
    return dict(zip(KEYS, found, strict=True))


def differences(stored: Mapping[str, Any], given: Mapping[str, Any]) -> str:
    """In words, what `given` has other than the `stored` identity: 'seed was 0, given 5'."""
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
