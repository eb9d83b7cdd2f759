"""A deep truck as a simulator directory: JSON and safetensors, nothing that executes when it is read."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors.torch import load_file
from safetensors.torch import save as to_bytes

from deeptruck_model import checks, reading
from deeptruck_model.deep.data import driven, reference
from deeptruck_model.deep.data.coverage import Coverage
from deeptruck_model.deep.data.weights_file import tensors
from deeptruck_model.deep.network import WEIGHTS, Scales, Shape, TruckNetwork
from deeptruck_model.deep.truck import DeepTruck
from deeptruck_model.errors import InputError
from deeptruck_model.results import DEEP_TRUCK
from deeptruck_model.signals import TruckInterface
from deeptruck_model.simulators import MANIFEST

WEIGHTS_FILE, COVERAGE_FILE, METRICS_FILE = checks.WEIGHTS, "coverage.json", "metrics.json"
SCHEMA = 1
MOST_UNITS = 4096  # of a layer, and models of an ensemble
KEPT = {  # what each file beside the weights is for; a truck that was saved without one promises less
    COVERAGE_FILE: "which says what it was trained on",
    driven.FILE: "which says what it learned from",
    reference.FILE: "by which its own error is known",
}


def save(truck: DeepTruck, path: Path, *, overwrite: bool = False) -> None:
    """Write `path` as a whole or not at all; an older deep truck there is replaced, and nothing else."""
    with DEEP_TRUCK.replacing(path, overwrite=overwrite) as folder:
        write(truck, folder)


def write(truck: DeepTruck, folder: Path, beside: Sequence[str] = ()) -> None:
    """Write the files of a deep truck into an existing folder; the manifest comes last. It names them, and
    those that were put there before (`beside`), so that one which gets lost is missed."""
    network = truck.network
    weights = {name: getattr(network, name).detach().contiguous() for name in WEIGHTS}
    # not by save_file: that leaves files which nobody else may read
    (folder / WEIGHTS_FILE).write_bytes(to_bytes(weights))
    files = [*beside]
    if truck.reference:
        reference.save(truck.reference, folder)
        files.append(reference.FILE)
    if truck.driven is not None:
        driven.save(truck.driven, folder)
        files.append(driven.FILE)
    if truck.coverage is not None:
        (folder / COVERAGE_FILE).write_text(json.dumps(truck.coverage.to_dict()))
        files.append(COVERAGE_FILE)
    manifest = {
        "kind": "deep",
        "schema": SCHEMA,
        "files": sorted(set(files)),
        "interface": truck.interface.to_dict(),
        "units": {
            name: truck.interface.unit(name)
            for name in (*truck.interface.u, *truck.interface.w, *truck.interface.y)
        },
        "dt": truck.dt,
        "shape": network.shape.to_dict(),
        "scales": {
            "mean": network.mean.tolist(),
            "scale": network.scale.tolist(),
            "top_speed": network.top_speed,
        },
        **truck.details,
    }
    (folder / MANIFEST).write_text(json.dumps(manifest, indent=1) + "\n")


def load_directory(path: Path, manifest: dict[str, Any]) -> DeepTruck:
    """The deep truck under `path`. Raises InputError with one line where a file is missing, damaged or does
    not fit."""
    if manifest.get("schema") != SCHEMA:
        raise InputError(
            f"{path / MANIFEST} has schema {manifest.get('schema')!r}; this version reads {SCHEMA}"
        )
    try:
        interface = TruckInterface.from_dict(manifest["interface"])
        shape = _shape(manifest["shape"])
        stored = manifest["scales"]
        mean, scale = (np.asarray(stored[key], dtype=np.float32) for key in ("mean", "scale"))
        scales = Scales(mean, scale, float(stored["top_speed"]))
        dt = float(manifest["dt"])
        _check_numbers(scales, dt)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        said = reading.plain(str(error)) if isinstance(error, InputError) else reading.plain(repr(error))
        raise InputError(f"{path / MANIFEST} is damaged ({said}); {reading.SAVE_AGAIN}") from None
    signals = (len(interface.u), len(interface.w), len(interface.y))
    if (
        signals != (shape.controls, shape.conditions, shape.responses)
        or len(mean) != shape.signals + shape.taught
    ):
        raise InputError(
            f"{path / MANIFEST} does not fit its network: the interface has {signals} u, w, y signals, "
            f"the network {(shape.controls, shape.conditions, shape.responses)}; files were edited or mixed"
        )
    network = TruckNetwork(shape, scales, dt, seeds=tuple(range(shape.members)))
    _fill(network, path / WEIGHTS_FILE)
    _miss(path, manifest)
    known = ("kind", "schema", "files", "interface", "units", "dt", "shape", "scales")
    details = {key: value for key, value in manifest.items() if key not in known}
    columns = 1 + len(interface.u) + len(interface.w)
    return DeepTruck(
        network,
        interface,
        _coverage(path / COVERAGE_FILE),
        details,
        reference.load(path),
        driven.load(path, columns),
    )


def _shape(stored: dict[str, Any]) -> Shape:
    """Raises ValueError for sizes that no network has: the weights are allocated by them."""
    shape = Shape(**stored)
    for name, value in shape.to_dict().items():
        kind, most = (bool, 1) if name == "gains" else (int, MOST_UNITS)
        if type(value) is not kind or not 0 <= value <= most:
            raise ValueError(f"{name} is {value!r}")
    if not (0 < shape.hidden * shape.decoder * shape.members <= MOST_UNITS**2):
        raise ValueError("a network of no size, or too large")
    return shape


def _check_numbers(scales: Scales, dt: float) -> None:
    """Raises ValueError for scales and steps that no training gives."""
    if scales.mean.ndim != 1 or scales.mean.shape != scales.scale.shape:
        raise ValueError("mean and scale are no lists of one length")
    if not (np.isfinite(scales.mean).all() and np.isfinite(scales.scale).all() and (scales.scale > 0).all()):
        raise ValueError("mean or scale are no possible numbers")
    if not (0.0 < scales.top_speed < 1e3 and 0.0 < dt <= 60.0):
        raise ValueError(f"top_speed is {scales.top_speed:g} m/s, dt {dt:g} s")


def _fill(network: TruckNetwork, path: Path) -> None:
    weights = tensors(path, load_file)
    for name in WEIGHTS:
        parameter = getattr(network, name)
        if name not in weights or weights[name].shape != parameter.shape:
            raise InputError(
                f"{path} has no '{name}' of shape {tuple(parameter.shape)}: it is of another network"
            )
        if not torch.isfinite(weights[name]).all():
            raise InputError(f"{path} holds weights that are not finite; train the simulator again")
        parameter.data.copy_(weights[name])


def promised(manifest: dict[str, Any]) -> list[str]:
    """Files that a manifest says lie beside it. Older ones do not say, but what was trained
    had COVERAGE_FILE."""
    told = manifest.get("files")
    if not isinstance(told, list):
        told = [COVERAGE_FILE] if "training" in manifest else []
    return [str(name) for name in told]


def _miss(path: Path, manifest: dict[str, Any]) -> None:
    """Raises InputError where a file is lost without which the truck would promise what it cannot keep."""
    for name in promised(manifest):
        if name in KEPT and not (path / name).exists():
            raise InputError(f"{path} has lost {name}, {KEPT[name]}; restore that file, or train again")


def _coverage(path: Path) -> Coverage | None:
    if not path.exists():
        return None
    try:
        return Coverage.from_dict(reading.json_object(path, reading.SAVE_AGAIN))
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        if isinstance(error, InputError):
            raise
        said = reading.plain(repr(error))
        raise InputError(f"{path} is damaged ({said}); {reading.SAVE_AGAIN}") from None
