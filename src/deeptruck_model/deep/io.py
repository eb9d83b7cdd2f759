"""Reads and writes a deep truck as a simulator directory of JSON and safetensors, which contain no executable
code.

Missing or damaged files are refused with one line.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.numpy import load_file as load_arrays
from safetensors.numpy import save as arrays_to_bytes
from safetensors.torch import load_file
from safetensors.torch import save as to_bytes

from deeptruck_core import reading
from deeptruck_core.errors import InputError
from deeptruck_core.signals import CHANNELS, TruckInterface
from deeptruck_model.deep.coverage import Coverage, Driven
from deeptruck_model.deep.data import Scales
from deeptruck_model.deep.network import WEIGHTS, Shape, TruckNetwork
from deeptruck_model.manifest import MANIFEST
from deeptruck_model.manifest import WEIGHTS as WEIGHTS_FILE
from deeptruck_model.recordings import Recording
from deeptruck_model.results import DEEP_TRUCK

COVERAGE_FILE, METRICS_FILE = "coverage.json", "metrics.json"
REFERENCE_FILE, DRIVEN_FILE = "reference.safetensors", "driven.safetensors"
SCHEMA = 2
RENAMED = {"taught": "auxiliary", "teach": "auxiliary", "untaught": "unexcited"}  # keys of schema 1
KEPT = {  # what each file other than the weights is for; a truck that was saved without one promises less
    COVERAGE_FILE: "which says what it was trained on",
    DRIVEN_FILE: "which says what it learned from",
    REFERENCE_FILE: "by which its own error is known",
}
MOST_UNITS = 4096  # of a layer, and models of an ensemble
Array = NDArray[Any]
MOST_S = 3600.0  # of driving: enough to know an error by, small enough to carry along


class Trained(Protocol):
    """The saved parts of a deep truck."""

    network: TruckNetwork
    coverage: Coverage | None
    reference: tuple[Recording, ...]
    driven: Driven | None

    @property
    def interface(self) -> TruckInterface: ...
    @property
    def dt(self) -> float: ...
    @property
    def details(self) -> Mapping[str, Any]: ...


def save(truck: Trained, path: Path, *, overwrite: bool = False) -> None:
    """Write `path` completely or not at all; an older deep truck is replaced only with `overwrite`."""
    with DEEP_TRUCK.replacing(path, overwrite=overwrite) as folder:
        write(truck, folder)


def write(truck: Trained, folder: Path, others: Sequence[str] = ()) -> None:
    """Write the files of a deep truck into an existing folder; the manifest comes last. It lists them and the
    files already there (`others`), so that a missing one is detected."""
    network = truck.network
    weights = {name: getattr(network, name).detach().contiguous() for name in WEIGHTS}
    # not by save_file: that leaves files which nobody else may read
    (folder / WEIGHTS_FILE).write_bytes(to_bytes(weights))
    files = [*others]
    if truck.reference:
        save_reference(truck.reference, folder)
        files.append(REFERENCE_FILE)
    if truck.driven is not None:
        save_driven(truck.driven, folder)
        files.append(DRIVEN_FILE)
    if truck.coverage is not None:
        (folder / COVERAGE_FILE).write_text(json.dumps(truck.coverage.to_dict()))
        files.append(COVERAGE_FILE)
    read = (WEIGHTS_FILE, *(name for name in KEPT if name in files))
    manifest = {
        "kind": "deep",
        "schema": SCHEMA,
        "files": sorted(set(files)),
        "sha256": {name: reading.sha256(folder / name) for name in read},
        "interface": truck.interface.to_dict(),
        "units": {
            name: truck.interface.unit(name)
            for name in (*truck.interface.u, *truck.interface.w, *truck.interface.y)
        },
        "dt": truck.dt,
        "shape": asdict(network.shape),
        "scales": {
            "mean": network.mean.tolist(),
            "scale": network.scale.tolist(),
            "top_speed": network.top_speed,
        },
        **truck.details,
    }
    (folder / MANIFEST).write_text(json.dumps(manifest, indent=1) + "\n")


def current(manifest: dict[str, Any]) -> dict[str, Any]:
    """The manifest converted from schema 1, which has other keys for the training data besides the
    response."""
    if manifest.get("schema") != 1:
        return manifest
    by_part = {key: _renamed(part) if isinstance(part, dict) else part for key, part in manifest.items()}
    return {**_renamed(by_part), "schema": SCHEMA}


def _renamed(part: Mapping[str, Any]) -> dict[str, Any]:
    return {RENAMED.get(key, key): value for key, value in part.items()}


def promised(manifest: dict[str, Any]) -> list[str]:
    """Files that a manifest lists. Older manifests have no list, but trained trucks had COVERAGE_FILE."""
    listed = manifest.get("files")
    if not isinstance(listed, list):
        listed = [COVERAGE_FILE] if "training" in manifest else []
    return [str(name) for name in listed]


class Stored(NamedTuple):
    """The content of a simulator directory, in the order of `DeepTruck`'s arguments."""

    network: TruckNetwork
    interface: TruckInterface
    coverage: Coverage | None
    details: dict[str, Any]
    reference: tuple[Recording, ...]
    driven: Driven | None


def read(path: Path, manifest: dict[str, Any]) -> Stored:
    """Read the deep truck under `path`. Raises InputError with one line if a file is missing, damaged or
    inconsistent."""
    manifest = current(manifest)
    if manifest.get("schema") != SCHEMA:
        raise InputError(
            f"{path / MANIFEST} has schema {manifest.get('schema')!r}; this version reads 1 and {SCHEMA}"
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
        or len(mean) != shape.signals + shape.auxiliary
    ):
        raise InputError(
            f"{path / MANIFEST} does not fit its network: the interface has {signals} u, w, y signals, "
            f"the network {(shape.controls, shape.conditions, shape.responses)}; files were edited or mixed"
        )
    network = TruckNetwork(shape, scales, dt, seeds=tuple(range(shape.members)))
    _fill(network, path / WEIGHTS_FILE)
    for name in promised(manifest):
        if name in KEPT and not (path / name).exists():
            raise InputError(f"{path} has lost {name}, {KEPT[name]}; restore that file, or train again")
    known = ("kind", "schema", "files", "sha256", "interface", "units", "dt", "shape", "scales")
    details = {key: value for key, value in manifest.items() if key not in known}
    columns = 1 + len(interface.u) + len(interface.w)
    found = Stored(
        network,
        interface,
        _coverage(path / COVERAGE_FILE),
        details,
        load_reference(path),
        load_driven(path, columns),
    )
    reading.check_saved(path, MANIFEST, manifest.get("sha256"), reading.SAVE_AGAIN)
    return found


def _shape(stored: dict[str, Any]) -> Shape:
    """The stored sizes. Raises ValueError for impossible ones, before weights are allocated."""
    shape = Shape(**stored)
    for name, value in vars(shape).items():
        kind, most = (bool, 1) if name == "gains" else (int, MOST_UNITS)
        if type(value) is not kind or not 0 <= value <= most:
            raise ValueError(f"{name} is {value!r}")
    if not (0 < shape.hidden * shape.decoder * shape.members <= MOST_UNITS**2):
        raise ValueError("a network of no size, or too large")
    return shape


def _check_numbers(scales: Scales, dt: float) -> None:
    """Raises ValueError for scales and steps that training cannot produce."""
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


def save_reference(recordings: Sequence[Recording], folder: Path) -> None:
    """Write at most MOST_S of the recordings, float32, into `folder`.

    The truck was not trained on them; they give its error for comparisons with new recordings.
    """
    tensors: dict[str, Array] = {}
    heads: list[dict[str, object]] = []
    seconds = 0.0
    for i, r in enumerate(recordings):
        if seconds >= MOST_S:
            break
        r = r.piece(0, min(len(r), round((MOST_S - seconds) / r.dt)))
        seconds += len(r) * r.dt
        heads.append({"name": r.name, "dt": r.dt, "start_s": r.start_s, "interface": r.interface.to_dict()})
        kept = {n: x for n, x in r.channels.items() if n in CHANNELS}  # no extra ones
        tensors |= {f"{i}/{name}": x.astype(np.float32) for name, x in kept.items()}
    # not by save_file: that leaves files which nobody else may read
    (folder / REFERENCE_FILE).write_bytes(
        arrays_to_bytes(tensors, metadata={"recordings": json.dumps(heads)})
    )


def load_reference(folder: Path) -> tuple[Recording, ...]:
    """The recordings kept in `folder`; empty if it has no such file. Raises InputError for a damaged one."""
    path = folder / REFERENCE_FILE
    if not path.exists():
        return ()
    found: tuple[Recording, ...] = tensors(path, _read_reference)
    return found


def _read_reference(path: Path) -> tuple[Recording, ...]:
    """The reference recordings in a safetensors file. Raises KeyError, IndexError, TypeError or ValueError
    for other content."""
    with safe_open(path, framework="numpy") as file:
        heads = json.loads((file.metadata() or {})["recordings"])
        channels: list[dict[str, Array]] = [{} for _ in heads]
        for key in file.keys():  # noqa: SIM118 - the file is no mapping
            index, name = key.split("/", 1)
            with np.errstate(invalid="ignore"):  # of NaNs, which are missing samples
                channels[int(index)][name] = file.get_tensor(key).astype(np.float64)
    return tuple(_recording(head, one) for head, one in zip(heads, channels, strict=True))


def _recording(head: dict[str, Any], channels: dict[str, Array]) -> Recording:
    interface = TruckInterface.from_dict(head["interface"])
    dt, start_s = float(head["dt"]), float(head["start_s"])
    if not 0.0 < dt <= 60.0 or not math.isfinite(start_s):
        raise ValueError(f"dt is {dt:g} s, start_s {start_s:g} s")
    needed = {"acceleration", "speed", *interface.u, *interface.w, *interface.y}
    if not needed <= set(channels) <= set(CHANNELS):
        raise ValueError(f"channels are {', '.join(channels)}")
    if len({x.shape for x in channels.values()}) != 1 or channels["speed"].ndim != 1:
        raise ValueError("channels differ in length")
    return Recording(str(head["name"]), dt, channels, interface, start_s)


def save_driven(driven: Driven, folder: Path) -> None:
    """Write DRIVEN_FILE into `folder`."""
    (folder / DRIVEN_FILE).write_bytes(arrays_to_bytes({"samples": driven.samples, "near": driven.near}))


def _read_driven(path: Path) -> Driven:
    stored = load_arrays(path)
    return Driven(stored["samples"], stored["near"])


def load_driven(folder: Path, columns: int) -> Driven | None:
    """The `Driven` in `folder`, of `columns` signals; None if it has no such file. Raises InputError for a
    damaged one."""
    path = folder / DRIVEN_FILE
    if not path.exists():
        return None
    driven = tensors(path, _read_driven)
    if not (np.isfinite(driven.samples).all() and np.isfinite(driven.near).all() and (driven.near > 0).all()):
        raise InputError(f"{path} holds values that are not possible; train the simulator again")
    if driven.samples.ndim != 2 or driven.samples.shape[1] != columns or driven.near.shape != (columns,):
        raise InputError(
            f"{path} is of other signals than the truck in its folder; files were edited or mixed"
        )
    return driven


def tensors(path: Path, load: Callable[[Path], Any]) -> Any:
    """Load a file of safetensors by `load`. Raises InputError if it is missing or damaged.

    A changed weight is not detected here; `reading.check_saved` compares the file's hash.
    """
    try:
        reading.check_file(path, reading.SAVE_AGAIN)
        return load(path)
    except InputError as error:
        raise InputError(f"{path} is missing or damaged ({error})") from None
    except (OSError, SafetensorError, ValueError, KeyError, TypeError, IndexError, RecursionError) as error:
        said = reading.plain(str(error)) or type(error).__name__
        raise InputError(f"{path} is missing or damaged ({said}); {reading.SAVE_AGAIN}") from None
