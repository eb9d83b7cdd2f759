"""Simulators and policies that a user may give: how small valid ones are made, and how they are read."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from bag_files import TRUCK, drive

from deeptruck_cacc.controllers.loading import load_policy
from deeptruck_cacc.controllers.policy import MlpPolicy
from deeptruck_cacc.controllers.scaling import ActionScale, FeatureMap
from deeptruck_model import simulators, trucks


@cache
def _deep() -> Any:
    """An untrained deep truck with all that is kept beside the weights."""
    from deeptruck_model.deep import coverage
    from deeptruck_model.deep.data import Scales
    from deeptruck_model.deep.network import Shape, TruckNetwork
    from deeptruck_model.deep.truck import DeepTruck

    shape = Shape(2, 1, 3, hidden=4, decoder=3)
    scales = Scales(np.zeros(6, np.float32), np.ones(6, np.float32))
    recordings = (drive(),)
    return DeepTruck(
        TruckNetwork(shape, scales, 0.1), TRUCK, coverage.measure_coverage(recordings), {"seeds": [0]},
        recordings,        coverage.measure_driven(recordings),
    )  # fmt: skip


def deep(name: str) -> Callable[[Path], Path]:
    """One of the files of a deep truck."""

    def made(folder: Path) -> Path:
        _deep().save(folder / "sim")
        return folder / "sim" / name

    return made


def physics(folder: Path) -> Path:
    """The manifest of a physics truck."""
    trucks.load("trucksim").save(folder / "sim")
    return folder / "sim" / simulators.MANIFEST


def corrected(folder: Path) -> Path:
    """The manifest of a corrected truck."""
    from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck, Term
    from deeptruck_model.mismatch.mechanisms import variant
    from deeptruck_model.mismatch.residual.components import Shares

    terms = [
        Term("dragging_brake", (variant("constant"),), (0.05,)),
        Term("brake_fade", (variant("above a temperature", cooling_s=120.0, at=0.0),), (0.1,)),
        Term("command_delay", (variant("delay", which="all", tau_s=0.2),), (1.0,)),
    ]
    shares = Shares([0.0, 30.0], [1e-3, 1e-3], [0.02, 0.02], [20.0, 8.0], 2e-4, 0.06, 2e4)
    truck = CorrectedTruck(trucks.load("trucksim"), terms, {"mass": 0.1}, shares, True, [7.0, 28.0])
    truck.save(folder / "sim")
    return folder / "sim" / simulators.MANIFEST


def read_simulator(file: Path) -> Any:
    """A simulator, driven for a moment; what a deep truck knows beside its weights."""
    truck = simulators.load(file.parent)
    u, w, y0 = np.zeros((1, 4, 2)), np.zeros((1, 4, 1)), np.full((1, 3), 10.0)
    u[:, :, 0] = 500.0
    names = truck.interface.u, truck.interface.w, truck.interface.y
    if tuple(map(len, names)) != (2, 1, 3):
        return names
    seen = getattr(truck, "coverage", None)
    kept = [r.channels for r in getattr(truck, "reference", ())]
    return simulators.free_run(truck, u, w, y0).y, seen and seen.to_dict(), kept


def override_yaml(folder: Path) -> Path:
    """What is put after truck:trucksim: ."""
    (folder / "mine.yaml").write_text(
        "mass: 25000\nengine:\n  full_load_gain: 1.1\n"
        "  full_load: {speed: [50, 100, 200, 240], torque: [900, 2000, 1800, 0]}\n"
        "transmission: {ratios: [12.0, 6.0, 3.0, 1.5, 1.0]}\ninterface: {grade: true, fuel: true}\n"
    )
    return folder / "mine.yaml"


def read_override(file: Path) -> Any:
    """The truck, as data."""
    return json.loads(json.dumps(simulators.load(f"truck:trucksim:{file}").specification.to_dict()))


def policy(name: str) -> Callable[[Path], Path]:
    """One of the files of a policy."""

    def made(folder: Path) -> Path:
        rng = np.random.default_rng(0)
        features = FeatureMap.default(power=True)
        sizes = [len(features.names), 5, 2]
        layers = [(rng.normal(0, 0.4, (b, a)), rng.normal(0, 0.1, b)) for a, b in pairwise(sizes)]
        mlp = MlpPolicy(layers, features, ActionScale.of(TRUCK), TRUCK, {"speed": (7.0, 24.0)}, {"seed": 0})
        mlp.save(folder / "policy")
        return folder / "policy" / name

    return made


def read_policy(file: Path) -> Any:
    """What it commands."""
    seen = {"leader_speed": 20.0, "speed": 19.0, "gap": 40.0, "target_time_gap": 2.0, "grade": 0.01}
    found: Any = load_policy(file.parent)
    return [found.act(seen), found.act(seen), found.coverage, found.card]
