"""A policy: what it is, the trained network behind it, and how it is kept and loaded. No torch, no pickle."""

from __future__ import annotations

import json
import math
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import MISSING, asdict, dataclass, field, fields
from functools import partial
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load_file
from safetensors.numpy import save as to_bytes

from deeptruck_cacc.scaling import OBSERVED, ActionScale, FeatureMap, paper_signals
from deeptruck_model import files, reading
from deeptruck_model.errors import InputError
from deeptruck_model.signals import TruckInterface

Array = NDArray[np.float64]
Observation = Mapping[str, Any]

MANIFEST, WEIGHTS = "policy.json", "policy.safetensors"
GO_ON = "make room and go on with --resume"
MENDED = "mend that and go on with --resume"


@runtime_checkable
class Policy(Protocol):
    """A car-following controller. Call `act` every `dt` seconds; `reset` before a new run.

    The observation has leader_speed, speed (m/s), gap (m), target_time_gap (s) and grade (ratio; optional),
    each a scalar or (batch,). Commands come back as (batch,) arrays in the units of `interface`. A NaN in
    the observation gives a NaN command: `guard.Guard` is what bridges missing signals.
    """

    @property
    def interface(self) -> TruckInterface: ...
    @property
    def dt(self) -> float: ...

    def reset(self) -> None:
        """Forget the past."""
        ...

    def act(self, observation: Observation) -> tuple[Array, Array]:
        """(engine_command, brake_command), each (batch,)."""
        ...


@dataclass
class MlpPolicy:
    """The mean of the paper's MLP Gaussian between a feature map and an action scale.

    `layers` holds (weight (out, in), bias (out,)) pairs; tanh between them, none behind the last.
    `coverage` gives the (low, high) that training saw of each signal; `card` is the model card (config,
    seed, simulator hash...).
    """

    layers: list[tuple[Array, Array]]
    features: FeatureMap
    scale: ActionScale
    interface: TruckInterface
    coverage: dict[str, tuple[float, float]] = field(default_factory=dict)
    card: dict[str, Any] = field(default_factory=dict)
    _memory: Array | None = field(default=None, repr=False)

    @property
    def dt(self) -> float:
        """Seconds between calls of `act`."""
        return self.features.dt

    def reset(self) -> None:
        """Forget the past."""
        self._memory = None

    def act(self, observation: Observation) -> tuple[Array, Array]:
        """(engine_command, brake_command) in the interface's units, each (batch,)."""
        signals = paper_signals(observation)
        if self._memory is None or len(self._memory) != len(signals):
            self._memory = self.features.start(len(signals))
        seen, memory = self.features(signals, self._memory)
        action = self.mean(seen)
        self._memory = self.features.remember(memory, action)
        commands = self.scale.commands(action)
        return commands[:, 0], commands[:, 1]

    def mean(self, features: Array) -> Array:
        """Mean action (batch, 2) before clipping, from features (batch, n)."""
        hidden = features
        for weight, bias in self.layers[:-1]:
            hidden = np.tanh(hidden @ weight.T + bias)
        weight, bias = self.layers[-1]
        return hidden @ weight.T + bias

    def save(self, path: str | Path) -> None:
        """Write a policy directory (policy.json, policy.safetensors), whole or not at all.

        Raises InputError where it cannot be written.
        """
        path = Path(path)
        try:
            self._write(path)
        except OSError as error:
            cure = files.advice(error, GO_ON, MENDED)
            raise InputError(f"cannot write {path}: {error.strerror}; {cure}") from None

    def _write(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as scratch:
            folder = Path(scratch) / "policy"
            folder.mkdir()
            (folder / MANIFEST).write_text(json.dumps(self._manifest(), indent=2) + "\n")
            tensors = {f"{k}.weight": np.ascontiguousarray(w) for k, (w, _) in enumerate(self.layers)}
            tensors |= {f"{k}.bias": np.ascontiguousarray(b) for k, (_, b) in enumerate(self.layers)}
            # not by save_file: that leaves files which nobody else may read
            (folder / WEIGHTS).write_bytes(to_bytes(tensors))
            path.mkdir(exist_ok=True)
            for name in (WEIGHTS, MANIFEST):
                shutil.move(folder / name, path / name)

    def _manifest(self) -> dict[str, Any]:
        units = {name: self.interface.unit(name) for name in self.interface.u}
        return {
            "kind": "mlp",
            "schema": 1,
            "dt": self.dt,
            "observation": {
                name: {"unit": unit}
                for name, unit in zip(OBSERVED, ("m/s", "m/s", "m", "s", "ratio"), strict=True)
            },
            "features": {"names": list(self.features.names), **self.features.to_dict()},
            "action": {"units": units, **asdict(self.scale)},
            "interface": self.interface.to_dict(),
            "hidden": [len(bias) for _, bias in self.layers[:-1]],
            "coverage": {name: list(limits) for name, limits in self.coverage.items()},
            "card": self.card,
        }


def load_policy(path: str | Path, interface: TruckInterface | None = None) -> Policy:
    """A policy directory written by `deeptruck-cacc train`, or `baseline:NAME` for a classical controller.

    `interface` is the truck a baseline is to drive (default: engine torque in N m, brake in percent), and is
    checked against a trained policy's own. Raises InputError where the path, a file or the interface is
    wrong.
    """
    text = str(path)
    if text.startswith("baseline:"):
        from deeptruck_cacc.baselines import baseline

        return baseline(text.removeprefix("baseline:"), interface or TruckInterface("trucksim"))
    policy = _load_directory(Path(text))
    if interface is not None and (interface.u, interface.engine_unit, interface.brake_unit) != (
        policy.interface.u,
        policy.interface.engine_unit,
        policy.interface.brake_unit,
    ):
        raise InputError(
            f"policy {path} commands {_units(policy.interface)}, the truck takes {_units(interface)}; "
            "train one on a simulator of this truck"
        )
    return policy


def _units(interface: TruckInterface) -> str:
    return ", ".join(f"{name} in {interface.unit(name)}" for name in interface.u)


AGAIN = "train the policy again"
TYPICAL = {"leader_speed": 20.0, "speed": 20.0, "gap": 40.0, "target_time_gap": 2.0, "grade": 0.0}


def _load_directory(path: Path) -> MlpPolicy:
    manifest = read_manifest(path)
    try:
        hidden = list(manifest["hidden"])
        policy = partial(
            MlpPolicy,
            features=FeatureMap.from_dict(_fields(manifest, "features", FeatureMap, "names")),
            scale=ActionScale(**_fields(manifest, "action", ActionScale, "units")),
            interface=TruckInterface.from_dict(manifest["interface"]),
            coverage={name: (float(low), float(high)) for name, (low, high) in manifest["coverage"].items()},
            card=dict(manifest["card"]),
        )
    except KeyError as error:
        raise InputError(
            f"{path / MANIFEST} lacks {error}: it is damaged or of another version; {AGAIN}"
        ) from None
    except (AttributeError, TypeError, ValueError, OverflowError) as error:
        said = reading.plain(str(error))
        raise InputError(f"{path / MANIFEST} is damaged or of another version ({said}); {AGAIN}") from None
    return _tried(policy(_read_layers(path / WEIGHTS, len(hidden) + 1)), path)


def _fields(manifest: Mapping[str, Any], key: str, kind: type, beside: str) -> dict[str, Any]:
    """What makes a `kind`, of which nothing without default may be missing. Raises KeyError for what is."""
    found = {name: value for name, value in manifest[key].items() if name != beside}
    for field_ in fields(kind):
        if field_.default is MISSING and field_.name not in found:
            raise KeyError(f"{key}.{field_.name}")
    return found


def _tried(policy: MlpPolicy, path: Path) -> MlpPolicy:
    """The policy, if its numbers are possible and its parts fit one another and make commands."""
    try:
        wrong = _impossible(policy)
        fits = policy.layers[0][0].shape[1] == len(policy.features.names) and len(policy.layers[-1][1]) == 2
        works = bool(wrong) or (fits and np.isfinite(policy.act(TYPICAL)).all())
    except (IndexError, TypeError, ValueError):
        works, wrong = False, []
    if wrong:
        raise InputError(f"{path / MANIFEST} has an impossible {wrong[0]}: it is damaged; {AGAIN}")
    if not works:
        raise InputError(f"{path / WEIGHTS} and {MANIFEST} do not fit one another; {AGAIN}")
    policy.reset()
    return policy


def _impossible(policy: MlpPolicy) -> list[str]:
    """Entries of the manifest whose numbers no policy can have."""
    scale, radar = policy.scale, policy.features.radar
    possible = {
        "features.dt": 0 < policy.dt < math.inf,
        "features.slow_s": 0 < policy.features.slow_s < math.inf,
        "features.matrix": bool(np.isfinite(policy.features.matrix).all()),
        "features.radar": radar is None or bool(np.isfinite(radar.gain).all()),
        "features.offset": bool(np.isfinite(policy.features.offset).all()),
        "action": scale.engine_low < scale.engine_high and scale.brake_high >= 0,
        "coverage": all(low <= high for low, high in policy.coverage.values()),
    }
    return [name for name, fine in possible.items() if not fine]


def read_manifest(path: Path) -> dict[str, Any]:
    """policy.json as a dict. Raises InputError where it is missing, damaged or of unknown kind."""
    if not (path / MANIFEST).exists():
        raise InputError(
            f"{path} is not a policy directory: it has no {MANIFEST}; make one with 'deeptruck-cacc train', "
            "or use 'baseline:acc'"
        )
    manifest = reading.json_object(path / MANIFEST, AGAIN)
    if manifest.get("kind") != "mlp" or manifest.get("schema") != 1:
        raise InputError(f"{path / MANIFEST} is of no known kind; expected kind 'mlp', schema 1; {AGAIN}")
    return manifest


def _read_layers(path: Path, count: int) -> list[tuple[Array, Array]]:
    try:
        if path.exists():
            reading.check_file(path, AGAIN)
        tensors = load_file(path)
        layers = [(tensors[f"{k}.weight"], tensors[f"{k}.bias"]) for k in range(count)]
    except FileNotFoundError:
        raise InputError(f"{path} is missing; {AGAIN}") from None
    except KeyError as error:
        raise InputError(f"{path} lacks {error}, which {MANIFEST} asks for; {AGAIN}") from None
    except (SafetensorError, OSError) as error:
        raise InputError(f"{path} is damaged ({reading.plain(str(error))}); {AGAIN}") from None
    if not all(math.isfinite(float(np.sum(w)) + float(np.sum(b))) for w, b in layers):
        raise InputError(f"{path} holds NaN or infinite weights; {AGAIN}")
    return [(w.astype(float), b.astype(float)) for w, b in layers]
