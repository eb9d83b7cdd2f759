"""A deep truck read from its simulator directory; what was lost or damaged is refused with one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from safetensors.torch import load_file

from deeptruck_model import reading
from deeptruck_model.deep.data import reference
from deeptruck_model.deep.data.coverage import Coverage
from deeptruck_model.deep.data.driven import Driven
from deeptruck_model.deep.data.scales import Scales
from deeptruck_model.deep.data.weights_file import tensors
from deeptruck_model.deep.network import WEIGHTS, Shape, TruckNetwork
from deeptruck_model.deep.saving import COVERAGE_FILE, KEPT, SCHEMA, WEIGHTS_FILE, promised
from deeptruck_model.errors import InputError
from deeptruck_model.recordings import Recording
from deeptruck_model.signals import TruckInterface
from deeptruck_model.simulators import MANIFEST

MOST_UNITS = 4096  # of a layer, and models of an ensemble


class Stored(NamedTuple):
    """What a simulator directory holds, in the order in which `DeepTruck` takes it."""

    network: TruckNetwork
    interface: TruckInterface
    coverage: Coverage | None
    details: dict[str, Any]
    reference: tuple[Recording, ...]
    driven: Driven | None


def read(path: Path, manifest: dict[str, Any]) -> Stored:
    """The files of the deep truck under `path`. Raises InputError with one line where one is missing,
    damaged or does not fit."""
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
    known = ("kind", "schema", "files", "sha256", "interface", "units", "dt", "shape", "scales")
    details = {key: value for key, value in manifest.items() if key not in known}
    columns = 1 + len(interface.u) + len(interface.w)
    found = Stored(
        network,
        interface,
        _coverage(path / COVERAGE_FILE),
        details,
        reference.load(path),
        reference.load_driven(path, columns),
    )
    reading.check_saved(path, MANIFEST, manifest.get("sha256"), reading.SAVE_AGAIN)
    return found


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
