"""Loads a controller by name or directory; damaged files give one line. Needs no torch and no pickle."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, fields
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load_file

from deeptruck_cacc.controllers.baselines import baseline
from deeptruck_cacc.controllers.policy import MANIFEST, TYPICAL, WEIGHTS, MlpPolicy, Policy
from deeptruck_cacc.controllers.scaling import OBSERVED, ActionScale, FeatureMap
from deeptruck_core import reading
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface

PLANNER = "planner:"


def load_policy(path: str | Path, interface: TruckInterface | None = None) -> Policy:
    """A policy directory written by `deeptruck-cacc train`, `baseline:NAME`, or `planner:SIM`, a planner on
    the simulator SIM.

    `interface` is that of the truck a baseline is to drive (default: engine torque in N m, brake in percent);
    that of a trained policy or of a planner's simulator is compared with it. Raises InputError if the path, a
    file or the interface is invalid.
    """
    text = str(path)
    if interface is not None and not isinstance(interface, TruckInterface):
        raise InputError(
            f"{type(interface).__name__} is no TruckInterface; give the `interface` of the truck"
        )
    if text.startswith("baseline:"):
        return baseline(text.removeprefix("baseline:"), interface or TruckInterface("trucksim"))
    policy = _planner(text.removeprefix(PLANNER)) if text.startswith(PLANNER) else load_trained(Path(text))
    if interface is not None and (interface.u, interface.engine_unit, interface.brake_unit) != (
        policy.interface.u,
        policy.interface.engine_unit,
        policy.interface.brake_unit,
    ):
        raise InputError(
            f"policy {path} commands {_units(policy.interface)}, the truck takes {_units(interface)}; "
            "give one made with a simulator of this truck"
        )
    return policy


def _planner(simulator: str) -> Policy:
    """The planner after one call, because its step may be compiled on first use, which takes longer than a
    node waits."""
    from deeptruck_cacc.controllers.planner import Planner  # scipy, and torch with a deep truck
    from deeptruck_model import simulators

    if simulator.endswith("?economy"):
        raise InputError(f"planner:{simulator} is gone; use planner:{simulator.removesuffix('?economy')}")
    planner = Planner(simulators.load(simulator))
    planner.act({name: np.array([value]) for name, value in TYPICAL.items()})
    planner.reset()
    return planner


def _units(interface: TruckInterface) -> str:
    return ", ".join(f"{name} in {interface.unit(name)}" for name in interface.u)


AGAIN = "train the policy again"


def load_trained(path: Path) -> MlpPolicy:
    """A trained policy from its directory. Raises InputError if a file is missing or damaged."""
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
    found = _tried(policy(_read_layers(path / WEIGHTS, len(hidden) + 1)), path)
    if manifest.get("dt", found.dt) != found.dt:
        raise InputError(f"{path / MANIFEST} has a dt that is not its features.dt: it is damaged; {AGAIN}")
    reading.check_saved(path, MANIFEST, manifest.get("sha256"), AGAIN)
    return found


def _fields(manifest: Mapping[str, Any], key: str, kind: type, except_for: str) -> dict[str, Any]:
    """Arguments of a `kind` from a manifest entry; missing ones without default are not permitted. Raises
    KeyError for these."""
    found = {name: value for name, value in manifest[key].items() if name != except_for}
    for field_ in fields(kind):
        if field_.default is MISSING and field_.name not in found:
            raise KeyError(f"{key}.{field_.name}")
    return found


def _tried(policy: MlpPolicy, path: Path) -> MlpPolicy:
    """The policy, if its numbers are possible, its parts fit, and it returns commands."""
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
    """Manifest entries with impossible numbers."""
    radar = policy.features.radar
    possible = {
        "features.dt": 0 < policy.dt < math.inf,
        "features.slow_s": 0 < policy.features.slow_s < math.inf,
        "features.closing_s": 0 < policy.features.closing_s < math.inf,
        "features.approach": 0 <= policy.features.approach < math.inf,
        "features.integral_rate": 0 <= policy.features.integral_rate < math.inf,
        "features.matrix": bool(np.isfinite(policy.features.matrix).all()),
        "features.radar": radar is None or bool(np.isfinite(radar.gain).all()),
        "features.offset": bool(np.isfinite(policy.features.offset).all()),
        "action": policy.scale.possible,
        "coverage": all(low <= high for low, high in policy.coverage.values())
        and policy.coverage.keys() <= {*OBSERVED},
    }
    return [name for name, fine in possible.items() if not fine]


def read_manifest(path: Path) -> dict[str, Any]:
    """policy.json as a dict. Raises InputError if it is missing, damaged or of unknown kind."""
    if path.suffix == ".onnx":
        raise InputError(f"{path}: ONNX does not drive here; use the policy directory it was made from")
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
