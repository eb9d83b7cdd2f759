"""What must hold on the bus, judged on the frames that left the bridge of a lock-step chain."""

from __future__ import annotations

import math
from collections.abc import Set
from itertools import pairwise

import numpy as np
from fault_chain import STEP, Chain
from numpy.typing import NDArray

from truck_bridge.safety import Axis

CYCLE = 0.020
CONTROLLER_S = 0.2
AGE_S = 0.5  # a speed older than this is stale, and no demand follows it
OVERRIDES = {"brake pedal", "accelerator", "cancel"}


def demands(chain: Chain) -> dict[str, list[tuple[float, float]]]:
    """What left the bridge by axis: time and demand, NaN for a release."""
    found: dict[str, list[tuple[float, float]]] = {}
    for axis, message in chain.vehicle.transmitted.items():
        entries = []
        for time, can_id, data in chain.ours.sent:
            if can_id == message.axis.can_id:
                word = int.from_bytes(data, "little")
                released = word & ((1 << 56) - 1) == message.axis.release
                value = message.axis.demand.read(word)
                entries.append((time, math.nan if released or value is None else value))
        found[axis] = entries
    return found


def frames(chain: Chain, faults: Set[str], at: float) -> list[str]:
    """What is broken of it, with these faults, the first of which began at `at` s."""
    table, broken, engine = chain.vehicle.table, [], demands(chain)["engine"]
    listed = {axis.can_id for axis in table.axes} | set(table.always)
    if any(can_id not in listed for _, can_id, _ in chain.ours.sent):
        broken.append("an unlisted frame left")
    begun = min((time for time, state in chain.states if state == "engaged"), default=math.inf)
    if any(time < begun - STEP and can_id not in table.always for time, can_id, _ in chain.ours.sent):
        broken.append("a demand left before engagement")
    for axis in table.axes:
        broken += _limits(chain, axis)
    lost = [(time, state) for time, state in chain.states if time > begun and state != "engaged"]
    if not lost:
        return broken
    first, idle = lost[0][0], [time for time, state in lost if state in ("standby", "silent")]
    if any(state == "engaged" and time > first for time, state in chain.states):
        broken.append("engaged again without a person")
    if faults & OVERRIDES and len(faults) == 1:
        frame = next((time for time, demand in engine if time >= first - 1e-9), math.inf)
        if frame - first > CYCLE + STEP or any(not math.isnan(d) for t, d in engine if t > first + STEP):
            broken.append("no release within one cycle of the driver")
    if faults == {"controller gone"} and first - at > CONTROLLER_S + STEP:
        broken.append("controller lost for over 200 ms")
    if faults == {"clock jump"} and lost[0][1] != "stopping":  # which goes on, whatever the clock says
        released = [time for time, demand in engine if time >= first - 1e-9 and math.isnan(demand)]
        if len(released) < 4 or released[0] - first > CYCLE + STEP:
            broken.append("no release in order after the clock jumped")
    if idle and engine and engine[-1][0] > idle[0] + STEP:
        broken.append("no silence after the release")
    return broken


def _limits(chain: Chain, axis: Axis) -> list[str]:
    """Value at the speed of the moment, rate and step, with one bit of rounding on either side."""
    entries, speeds = demands(chain)[axis.name], np.array(chain.speeds).reshape(-1, 3)
    numbers = [(at, demand) for at, demand in entries if not math.isnan(demand)]
    broken = [f"{axis.name} out of limits" for at, demand in numbers if _outside(axis, at, demand, speeds)]
    fastest, quantum = max(axis.limits.rate, axis.limits.fade), axis.demand.scale
    for (t0, d0), (t1, d1) in pairwise(entries):
        if math.isnan(d0) or math.isnan(d1):
            continue
        allowed = fastest * min(t1 - t0 + STEP, 2 * axis.period_s) + 2 * quantum
        if abs(d1 - d0) > allowed:
            broken.append(f"{axis.name} stepped by {d1 - d0:g}")
    return broken[:1]


def _outside(axis: Axis, at: float, demand: float, speeds: NDArray[np.float64]) -> bool:
    """Outside the envelope at every speed that the truck had, or was received to have, just before."""
    limits, quantum = axis.limits, axis.demand.scale
    if min(limits.low) == max(limits.low) and min(limits.high) == max(limits.high):
        return not min(limits.low) - quantum <= demand <= max(limits.high) + quantum
    since, until = np.searchsorted(speeds[:, 0], (at - AGE_S, at + 1e-9))
    least, most = np.nanmin(speeds[since:until, 1:]), np.nanmax(speeds[since:until, 1:])
    between = np.array([least, *(s for s in limits.speed if least < s < most), most])
    low = min(np.interp(between, limits.speed, limits.low))
    high = max(np.interp(between, limits.speed, limits.high))
    return not low - quantum <= demand <= high + quantum
