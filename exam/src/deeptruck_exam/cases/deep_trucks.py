"""Trained deep trucks as simulators, learned from drives without effects and stored for all cases of
a truck.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from pathlib import Path

import numpy as np

from deeptruck_exam import worlds
from deeptruck_exam.cases.build import DT
from deeptruck_exam.cases.plan import Plan
from deeptruck_exam.laws.catalogue import DRIVES
from deeptruck_exam.worlds import roads as road_maker
from deeptruck_exam.worlds import speeds, trucks
from deeptruck_exam.worlds.drive import leader_way, simulate
from deeptruck_exam.worlds.drivers import Driver
from deeptruck_exam.worlds.sensors import Sensors
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import MANIFEST

HOURS = 4.0
UPDATES = 0  # as many as training chooses for so much driving
CACHE = "DEEPTRUCK_PROOF_DEEP"  # environment variable: folder of trained trucks


def cache_folder() -> Path:
    """The folder of trained trucks."""
    return Path(os.environ.get(CACHE, Path(tempfile.gettempdir()) / "deeptruck-proof"))


def nominal_recordings(plan: Plan, hours: float = HOURS) -> list[Recording]:
    """Drives of the plan's truck without effects, as its sensors record them."""
    minutes = 8.0
    count = max(4, round(hours * 60.0 / minutes))
    rng = np.random.default_rng([truck_seed(plan), 1])
    drives_of = [DRIVES[k % len(DRIVES)] for k in range(count)]
    truck, world = trucks.make(plan.truck, plan.values), worlds.values()
    n = round(minutes * 60.0 / DT)
    target = np.stack([speeds.profile(rng, kind, world["speeds"], n, DT) for kind in drives_of])
    styles = np.array(["human", "cruise", "acc"])[rng.integers(0, 3, count)]
    leader_m = leader_way(target, [s == "acc" for s in styles], 1.8, DT)
    known = trucks.namespace(truck)
    roads = road_maker.draw(rng, drives_of, world["roads"], flat=not plan.grade)
    driver = Driver(known, styles, target, 1.8, DT, rng, world["drivers"])
    drives = simulate(truck, roads, driver, leader_m, DT)
    sensors = Sensors.draw(world["sensors"], rng)
    interface = trucks.make(plan.truck, plan.values, grade=plan.grade).interface
    out = []
    for k in range(count):
        true = {name: values[k] for name, values in drives.channels.items()}
        channels = sensors.record(true, known, DT, rng)
        if not plan.grade:
            channels.pop("grade")
        out.append(Recording(f"nominal_{k}", DT, channels, interface))
    return out


def truck_seed(plan: Plan) -> int:
    """A seed that depends only on the plan's truck."""
    text = json.dumps([plan.truck, plan.values, plan.grade], sort_keys=True)
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4], "big")


def trained(plan: Plan, hours: float = HOURS, updates: int = UPDATES) -> Path:
    """The simulator directory of the plan's truck; trained on the first call (a minute)."""
    from deeptruck_model import deep

    path = cache_folder() / f"{plan.truck}-{truck_seed(plan):08x}-{updates}"
    if not (path / MANIFEST).exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        draft = path.with_name(f"{path.name}.{os.getpid()}")
        deep.train(nominal_recordings(plan, hours), draft, deep.Arguments(updates=updates))
        if not path.exists():
            draft.rename(path)
    return path
