"""The invariants of a lock-step run, judged on what left the bridge."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from fault_kinds import MUST_END, OVERRIDES
from fault_world import STEP, Run

from truck_bridge.safety import Axis

ENGAGED_AT = 0.8
CYCLE = 0.020
CONTROLLER_S = 0.2
AGE_S = 0.5  # a speed older than this is stale, and no demand follows it


def demands(run: Run) -> dict[str, list[tuple[float, float]]]:
    """What left the bridge by axis: time and demand, NaN for a release."""
    found: dict[str, list[tuple[float, float]]] = {}
    for axis, message in run.vehicle.transmitted.items():
        entries = []
        for time, can_id, data in run.bridge_side.sent:
            if can_id == message.axis.can_id:
                word = int.from_bytes(data, "little")
                released = word & ((1 << 56) - 1) == message.axis.release
                value = message.axis.demand.read(word)
                entries.append((time, math.nan if released or value is None else value))
        found[axis] = entries
    return found


def judge(run: Run, fault: str, at: float) -> list[str]:
    """The invariants, on the bus."""
    table, broken = run.vehicle.table, []
    listed = {axis.can_id for axis in table.axes} | set(table.always)
    if any(can_id not in listed for _, can_id, _ in run.bridge_side.sent):
        broken.append("an unlisted frame left")
    engine = demands(run)["engine"]
    if any(time < ENGAGED_AT and can_id not in table.always for time, can_id, _ in run.bridge_side.sent):
        broken.append("a demand left before engagement")
    for axis in table.axes:
        broken += _limits(run, axis)
    lost = [time for time, state in run.states if state in ("fading", "releasing", "standby", "silent")]
    lost = [time for time in lost if time > ENGAGED_AT + STEP]
    if any(state == "engaged" for time, state in run.states if lost and time > lost[0]):
        broken.append("engaged again without a person")
    if fault in MUST_END and not lost:
        broken.append("control was not given up")
    if fault == "nothing" and lost:
        broken.append("control was given up for nothing")
    if fault in OVERRIDES and lost:
        told = lost[0]
        first = next((time for time, demand in engine if time >= told - 1e-9), math.inf)
        if first - told > CYCLE + 1e-6 or any(not math.isnan(d) for t, d in engine if t > told + 1e-6):
            broken.append("no release within one cycle of the driver")
    if fault == "controller gone" and lost and lost[0] - at > CONTROLLER_S:
        broken.append("controller lost for over 200 ms")
    if fault == "clock jump" and lost:
        released = [time for time, demand in engine if time >= lost[0] - 1e-9 and math.isnan(demand)]
        if len(released) < 4 or released[0] - lost[0] > CYCLE + 1e-6:
            broken.append("no release in order after the clock jumped")
    if lost and engine and engine[-1][0] > lost[0] + 6.0:
        broken.append("no silence after the release")
    return broken


def _limits(run: Run, axis: Axis) -> list[str]:
    """Value at the speed of the moment, rate and step, with one bit of rounding on either side."""
    entries = demands(run)[axis.name]
    numbers = [(at, demand) for at, demand in entries if not math.isnan(demand)]
    broken = [f"{axis.name} out of limits" for at, demand in numbers if _outside(run, axis, at, demand)]
    fastest, quantum = max(axis.limits.rate, axis.limits.fade), axis.demand.scale
    for (t0, d0), (t1, d1) in pairwise(entries):
        if math.isnan(d0) or math.isnan(d1):
            continue
        allowed = fastest * min(t1 - t0 + STEP, 2 * axis.period_s) + 2 * quantum
        if abs(d1 - d0) > allowed:
            broken.append(f"{axis.name} stepped by {d1 - d0:g}")
    return broken[:1]


def _outside(run: Run, axis: Axis, at: float, demand: float) -> bool:
    """Outside the envelope at every speed that the truck had, or was received to have, just before."""
    limits, quantum = axis.limits, axis.demand.scale
    since = np.searchsorted([time for time, _, _ in run.speeds], at - AGE_S)
    recent = [speed for time, *both in run.speeds[since:] if time <= at for speed in both]
    between = np.array(
        [min(recent), *(s for s in limits.speed if min(recent) < s < max(recent)), max(recent)]
    )
    low = min(np.interp(between, limits.speed, limits.low))
    high = max(np.interp(between, limits.speed, limits.high))
    return not low - quantum <= demand <= high + quantum


def reactions(run: Run, fault: str, at: float) -> tuple[float, float]:
    """Seconds from the fault to the first state that is not engaged, and to the first release frame."""
    lost = [time - at for time, state in run.states if time > at - STEP and state != "engaged"]
    engine = [time - at for time, demand in demands(run)["engine"] if time > at - STEP and math.isnan(demand)]
    return (lost[0] if lost else math.nan), (engine[0] if engine else math.nan)
