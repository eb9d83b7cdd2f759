"""The scenes of `fault_bus.py` on processes in real time; this process is the witness, and forges demands."""

from __future__ import annotations

import math
import time

import numpy as np
from fault_bus import FORGED, LIES, NO_SIZE, Verdict, must_end, scenes, senders
from fault_scene import Scene, limits_kept, scene

from truck_bridge import vehicles

LISTEN_S = 4.0  # after the fault
START_S = 120.0  # for processes to start on a loaded machine


def play_processes(seed: int) -> Verdict:
    """One run. Only what must end control is drawn; what the road shows is judged in lock-step."""
    rng = np.random.default_rng(seed)
    name = vehicles.NAMES[seed % len(vehicles.NAMES)]
    vehicle = vehicles.load(name)
    drawn = [one for one in scenes(vehicle) if must_end(one, vehicle) or one == "nothing"]
    what = str(rng.choice(drawn))
    kind, signals, sizes = LIES.get(what, ("", (), NO_SIZE))
    known = [size for size in sizes if kind != "second" or size not in senders(vehicle, signals)]
    size = float(rng.choice(known))
    with scene(name) as stage:
        if not stage.engaged(START_S):
            return Verdict(what, name, math.nan, math.nan, math.nan, math.nan, ("did not engage",))
        stage.listen(1.0)
        since = time.monotonic()
        if kind:
            stage.tell(f"lie {kind} {','.join(signals)} {size}")
        _listen(stage, what, since)
        ended = _ended(stage, since)
        broken = limits_kept(stage)
    if what == "nothing" and not math.isnan(ended):
        broken.append("control ended for nothing")
    if must_end(what, vehicle) and math.isnan(ended):
        broken.append("control was kept")
    return Verdict(what, vehicle.name, ended, math.nan, math.nan, math.nan, tuple(broken))


def _listen(stage: Scene, what: str, since: float) -> None:
    """Hear for a while; send what is forged meanwhile."""
    forged = FORGED.get(what)
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
