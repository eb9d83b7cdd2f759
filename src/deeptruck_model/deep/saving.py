"""A deep truck as a simulator directory: JSON and safetensors, nothing that executes when it is read."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from safetensors.torch import save as to_bytes

from deeptruck_model import checks, reading
from deeptruck_model.deep.data import reference
from deeptruck_model.deep.data.coverage import Coverage
from deeptruck_model.deep.data.driven import Driven
from deeptruck_model.deep.network import WEIGHTS, TruckNetwork
from deeptruck_model.recordings import Recording
from deeptruck_model.results import DEEP_TRUCK
from deeptruck_model.signals import TruckInterface
from deeptruck_model.simulators import MANIFEST

WEIGHTS_FILE, COVERAGE_FILE, METRICS_FILE = checks.WEIGHTS, "coverage.json", "metrics.json"
SCHEMA = 1
KEPT = {  # what each file beside the weights is for; a truck that was saved without one promises less
    COVERAGE_FILE: "which says what it was trained on",
    reference.DRIVEN_FILE: "which says what it learned from",
    reference.FILE: "by which its own error is known",
}


class Trained(Protocol):
    """What is written of a deep truck."""

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
    """Write `path` as a whole or not at all; only with `overwrite` is an older deep truck replaced."""
    with DEEP_TRUCK.replacing(path, overwrite=overwrite) as folder:
        write(truck, folder)


def write(truck: Trained, folder: Path, beside: Sequence[str] = ()) -> None:
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
        reference.save_driven(truck.driven, folder)
        files.append(reference.DRIVEN_FILE)
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
        "shape": network.shape.to_dict(),
        "scales": {
            "mean": network.mean.tolist(),
            "scale": network.scale.tolist(),
            "top_speed": network.top_speed,
        },
        **truck.details,
    }
    (folder / MANIFEST).write_text(json.dumps(manifest, indent=1) + "\n")


def promised(manifest: dict[str, Any]) -> list[str]:
    """Files that a manifest says lie beside it. Older ones do not say, but what was trained
    had COVERAGE_FILE."""
    told = manifest.get("files")
    if not isinstance(told, list):
        told = [COVERAGE_FILE] if "training" in manifest else []
    return [str(name) for name in told]
