"""Policies as ONNX: files written by `export`, and other networks with the same inputs and outputs."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_cacc.controllers.policy import TYPICAL, Observation
from deeptruck_cacc.controllers.scaling import OBSERVED, ActionScale, observed
from deeptruck_core import reading
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface

SUFFIX, FACTS = ".onnx", "deeptruck"  # of the file; of the metadata that say what its numbers mean
COMMANDS, MEMORY = ("engine_command", "brake_command"), "memory"
AGAIN = "export the policy again"


@dataclass
class OnnxPolicy:
    """A Policy whose `session` (an onnxruntime.InferenceSession) takes the signals of OBSERVED, (batch, 1)
    each, and returns both commands. `start` (k,) is its initial memory, empty without memory. Commands are
    limited to `scale`."""

    session: Any
    interface: TruckInterface
    dt: float
    scale: ActionScale
    start: Array = field(default_factory=lambda: np.zeros(0))
    coverage: dict[str, tuple[float, float]] = field(default_factory=dict)
    _memory: NDArray[np.float32] | None = field(default=None, repr=False)

    def reset(self) -> None:
        """Forget the past."""
        self._memory = None

    def act(self, observation: Observation) -> tuple[Array, Array]:
        """(engine_command, brake_command) in the interface's units, each (batch,). NaN if a signal is NaN,
        whatever the network returns; the memory is then reset."""
        signals = observed(observation).astype(np.float32)
        fed = {name: signals[:, k : k + 1] for k, name in enumerate(OBSERVED)}
        unseen: NDArray[np.bool_] = np.asarray(np.isnan(signals).any(axis=1))
        if self._memory is None or len(self._memory) != len(signals):
            self._memory = np.tile(self.start.astype(np.float32), (len(signals), 1))
        if len(self.start):
            engine, brake, after = self.session.run(
                (*COMMANDS, f"{MEMORY}_next"), fed | {MEMORY: self._memory}
            )
            self._memory = np.where(unseen[:, None], self.start.astype(np.float32), after)
        else:
            engine, brake = self.session.run(COMMANDS, fed)
        commands = np.concatenate([engine, brake], axis=1).astype(float)
        commands[unseen | ~np.isfinite(commands).all(axis=1)] = np.nan
        s = self.scale
        return np.clip(commands[:, 0], s.engine_low, s.engine_high), np.clip(
            commands[:, 1], 0.0, s.brake_high
        )


def load_onnx(path: Path) -> OnnxPolicy:
    """The policy in an ONNX file, whose metadata define its inputs and outputs.

    Raises InputError if the file is missing, damaged or of another kind.
    """
    reading.check_file(path, AGAIN)
    import onnxruntime

    try:
        options = onnxruntime.SessionOptions()
        # one thread: a pool that waits busily takes the cores of the other nodes
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        # errors alone: of a fixed batch it warns at every call, and the shapes are checked below
        options.log_severity_level = 3
        session = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # its own kinds of error are of no common base
        said = reading.plain(str(error), reading.MOST_SAID)
        raise InputError(f"{path} is no ONNX that can be run ({said}); {AGAIN}") from None
    takes, gives = ({port.name for port in ports} for ports in (session.get_inputs(), session.get_outputs()))
    lacks = [*sorted({*OBSERVED} - takes), *sorted({*COMMANDS} - gives)]
    if lacks:
        raise InputError(f"{path} has no {', '.join(lacks)} among its inputs and outputs; {AGAIN}")
    found = _described(session, path, MEMORY in takes)
    return _tried(found, path)


def _described(session: Any, path: Path, remembers: bool) -> OnnxPolicy:
    """The policy, from the session and its metadata."""
    try:
        facts: Mapping[str, Any] = json.loads(session.get_modelmeta().custom_metadata_map.get(FACTS, "{}"))
        if wrong := _wrong(facts, remembers):
            raise ValueError(wrong)
        start = [math.nan if x is None else float(x) for x in facts[MEMORY]] if remembers else []
        interface, action = TruckInterface.from_dict(facts["interface"]), facts.get("action")
        scale = ActionScale(**action) if action else ActionScale.of(interface)
        seen = {name: (float(low), float(high)) for name, (low, high) in facts.get("coverage", {}).items()}
        if not scale.possible or not all(low <= high for low, high in seen.values()):
            raise ValueError("action or coverage is impossible")
        return OnnxPolicy(session, interface, float(facts["dt"]), scale, np.array(start), seen)
    except (KeyError, AttributeError, TypeError, ValueError) as error:
        said = reading.plain(str(error))
        raise InputError(
            f"{path}: its metadata '{FACTS}' do not say what its numbers mean ({said}); write them as "
            "docs/nodes.md has them"
        ) from None


def _wrong(facts: Any, remembers: bool) -> str:
    """Missing or misplaced metadata; empty if there are none."""
    if not isinstance(facts, dict):
        return "they are no object of JSON"
    lacks = [name for name in ("dt", "interface", *([MEMORY] if remembers else [])) if name not in facts]
    if lacks:
        return f"no {', '.join(lacks)}"
    unknown = sorted({*facts.get("coverage", {})} - {*OBSERVED})
    if unknown:
        return f"coverage of {', '.join(unknown)}; it may have {', '.join(OBSERVED)}"
    dt = facts["dt"]
    return "" if isinstance(dt, int | float) and 0.0 < dt < math.inf else f"dt of {dt!r} s"


def _tried(policy: OnnxPolicy, path: Path) -> OnnxPolicy:
    """The policy, if it returns commands."""
    try:
        works = bool(np.isfinite(policy.act(TYPICAL)).all())
    except Exception:  # whatever the runtime says of shapes
        works = False
    if not works:
        raise InputError(f"{path} makes no commands from {', '.join(OBSERVED)}; {AGAIN}")
    policy.reset()
    return policy
