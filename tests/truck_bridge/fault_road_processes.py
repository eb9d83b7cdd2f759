"""The scenes of `fault_road.py` on processes in real time; this process hears them, and forges demands."""

from __future__ import annotations

import math
import time

import numpy as np
from fault_road import Verdict
from fault_scene import Scene, limits_kept, scene
from fault_table import SCENES, forger, must_end, possible, senders

from truck_bridge import vehicles

LISTEN_S = 4.0  # after the fault
START_S = 120.0  # for processes to start on a loaded machine


def play_processes(seed: int) -> Verdict:
    """One run. Only what must end control is drawn; what the road shows is judged in lock-step."""
    rng = np.random.default_rng(seed)
    name = vehicles.NAMES[seed % len(vehicles.NAMES)]
    vehicle = vehicles.load(name)
    drawn = [one for one in possible(vehicle) if SCENES[one].machine not in ("radar", "driver")]
    ends = [
        (one, size)
        for one in drawn
        for size in set(SCENES[one].sizes) - (senders(vehicle, SCENES[one].signals))
        if must_end(one, size, math.inf, vehicle) or one == "nothing"
    ]
    what, size = ends[int(rng.integers(len(ends)))]
    machine, kind, signals, _ = SCENES[what]
    with scene(name) as stage:
        if not stage.engaged(START_S):
            return _verdict(what, size, name, math.nan, ["did not engage"])
        stage.listen(1.0)
        since = time.monotonic()
        if machine == "bus":
            stage.tell(f"lie {kind} {','.join(signals)} {size}")
        _listen(stage, what, since)
        ended = _ended(stage, since)
        broken = limits_kept(stage)
    if what == "nothing" and not math.isnan(ended):
        broken.append("control ended for nothing")
    if what != "nothing" and math.isnan(ended):
        broken.append("control was kept")
    return _verdict(what, size, name, ended, broken)


def _verdict(what: str, size: float, name: str, ended: float, broken: list[str]) -> Verdict:
    """Without what only the road shows."""
    return Verdict(what, size, math.inf, name, "", ended, math.nan, math.nan, math.nan, tuple(broken))


def _listen(stage: Scene, what: str, since: float) -> None:
    """Hear for a while; send what is forged meanwhile."""
    forged = forger(SCENES[what]) if SCENES[what].machine == "forger" else None
    while time.monotonic() < since + LISTEN_S and math.isnan(_ended(stage, since)):
        if forged is None:
            stage.listen(0.2)
            continue
        for can_id, data in forged(stage.vehicle, round(time.monotonic() - since, 2)):
            stage.send(can_id, data)
        stage.listen(0.01)


def _ended(stage: Scene, since: float) -> float:
    """s to the first frame that hands back, or the first demand that falls by a fade's step."""
    axis = stage.vehicle.transmitted["engine"].axis
    before = [demand for at, demand in stage.demands("engine") if at < since][-1]
    for at, demand in stage.demands("engine"):
        if at >= since and (math.isnan(demand) or demand < before - 2 * axis.limits.fade * axis.period_s):
            return at - since
    return math.nan
