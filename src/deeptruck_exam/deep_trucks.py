"""Trained deep trucks as simulators: learned from drives in which nothing is missing, kept for all cases
of a truck."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from pathlib import Path

import numpy as np

from deeptruck_exam.construction import DT
from deeptruck_exam.effects.planting import SCENARIOS
from deeptruck_exam.plans import Plan
from deeptruck_exam.worlds import WORLDS, trucks
from deeptruck_exam.worlds.drive import leader_way, simulate
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import MANIFEST

HOURS = 4.0
UPDATES = 0  # as many as training chooses for so much driving
CACHE = "DEEPTRUCK_PROOF_DEEP"  # environment variable: folder of trained trucks


def cache_folder() -> Path:
    """Where trained trucks are kept between cases."""
    return Path(os.environ.get(CACHE, Path(tempfile.gettempdir()) / "deeptruck-proof"))


def nominal_recordings(plan: Plan, hours: float = HOURS) -> list[Recording]:
    """Drives of the plan's truck with everything as it should be, in all scenarios, as its sensors record
    them."""
    minutes = 8.0
    count = max(4, round(hours * 60.0 / minutes))
    rng = np.random.default_rng([truck_seed(plan), 1])
    scenarios = [SCENARIOS[k % len(SCENARIOS)] for k in range(count)]
    truck, world = trucks.make(plan.truck, plan.values), WORLDS["plain"]
    n = round(minutes * 60.0 / DT)
    target = np.stack([world.speed_profile(rng, s, n, DT) for s in scenarios])
    styles = np.array(["human", "cruise", "acc"])[rng.integers(0, 3, count)]
    leader_m = leader_way(target, [s == "acc" for s in styles], 1.8, DT)
    known = trucks.namespace(truck)
    roads = world.draw_roads(rng, scenarios, flat=not plan.grade)
    driver = world.driver(known, styles, target, 1.8, DT, rng)
    drives = simulate(truck, roads, driver, leader_m, DT)
    sensors = world.logger.draw(rng)
    interface = trucks.make(plan.truck, plan.values, grade=plan.grade).interface
    out = []
    for k in range(count):
        true = {name: values[k] for name, values in drives.channels.items()}
        channels = world.logger.record(true, sensors, known, DT, rng)
        if not plan.grade:
            channels.pop("grade")
        out.append(Recording(f"nominal_{k}", DT, channels, interface))
    return out


def truck_seed(plan: Plan) -> int:
    """A number that belongs to the plan's truck, whatever the case."""
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
