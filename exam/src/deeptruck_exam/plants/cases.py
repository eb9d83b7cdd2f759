"""The concealed properties of a plant, and drives with them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_exam.plants import fastsim_truck as plant
from deeptruck_model.recordings import Recording, write_bag

LENGTH_S = 400.0
PARTS = (("hwfet", 0.0), ("udds", 0.0), ("udds", 900.0), ("hwfet", 350.0))  # the last is held out
NAMES = tuple(f"drive_{k}" for k in range(len(PARTS)))


@dataclass(frozen=True)
class Concealed:
    """One difference from the data sheet: in words, and by the tool's name for it. `each_drive` are changes
    of mass, kg, by drive."""

    what: str
    name: str = ""
    kind: str = "parameter_error"
    truth: plant.Truth = field(default_factory=plant.Truth)
    each_drive: tuple[float, ...] = ()
    withholds: tuple[str, ...] = ()

    def scored(self) -> dict[str, Any]:
        """The truth in the form that `score` reads."""
        effect = {"key": self.what, "name": self.name}
        return {"verdict": self.kind, "effects": [effect] if self.name else []}


MISSING = "missing_physics"
CONCEALED: Mapping[str, Concealed] = {
    "nothing": Concealed("nothing"),
    "auxiliary": Concealed(
        "auxiliary load +20 kW", "accessory_load", MISSING, plant.Truth(auxiliary_w=20_000.0)
    ),
    "mass": Concealed("mass +5 t", "mass", truth=plant.Truth(mass_kg=5000.0)),
    "drag": Concealed("drag +20 %", "drag_area", truth=plant.Truth(drag=1.2)),
    "rolling": Concealed("rolling resistance +30 %", "rolling_resistance", truth=plant.Truth(rolling=1.3)),
    "efficiency": Concealed(
        "transmission efficiency -5 %", "torque_gain", truth=plant.Truth(efficiency=0.95)
    ),
    "payload": Concealed(
        "payload changes between drives",
        "payload_change",
        MISSING,
        each_drive=(0.0, 5000.0, -6000.0, 3000.0),
    ),
    "slope": Concealed("slope not logged", "road_grade", MISSING, withholds=("grade",)),
    "headwind": Concealed("head wind of 6 m/s", "headwind", MISSING, plant.Truth(wind=6.0)),
}


def drives(concealed: Concealed, seed: int, *, geared: bool = False) -> list[Recording]:
    """The recordings of a case; roads, sensor noise and the speed scale of the cycles depend on the seed.

    Raises ModuleNotFoundError if FASTSim is not installed.
    """
    out = []
    for k, (name, (cycle, start)) in enumerate(zip(NAMES, PARTS, strict=True)):
        rng = np.random.default_rng([seed, k])
        target = plant.trace(cycle, start, LENGTH_S, rng.uniform(0.85, 0.97))
        truth = concealed.truth
        if concealed.each_drive:
            truth = replace(truth, mass_kg=concealed.each_drive[k])
        whole = plant.record(name, target, plant.road(target, rng), truth, rng, geared=geared)
        shown = {c: v for c, v in whole.channels.items() if c not in concealed.withholds}
        grade = "grade" in shown
        out.append(replace(whole, channels=shown, interface=replace(whole.interface, grade=grade)))
    return out


def written(recordings: list[Recording], folder: Path) -> list[Path]:
    """A bag for each recording in the folder; existing bags are kept."""
    paths = [folder / r.name for r in recordings]
    for path, recording in zip(paths, recordings, strict=True):
        if not path.exists():
            write_bag(path, [recording], interface=recording.interface)
    return paths
