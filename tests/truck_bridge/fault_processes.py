"""Faults on real processes in real time: bridge and ECU emulator each a process, this one the witness.
The nodes of the whole graph: `tests/ros2_ws/fault_nodes.py`.

`python tests/truck_bridge/fault_processes.py --runs 50`. What is judged is what the witness received.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from dataclasses import dataclass

import numpy as np
from fault_acts import FAULTS
from fault_scene import limits_kept, scene

from truck_bridge import vehicles

DRIVER_AT = 6.0  # s after the emulator's start


@dataclass(frozen=True)
class Outcome:
    fault: str
    vehicle: str
    broken: tuple[str, ...]
    reaction_s: float  # to the first frame that hands back, or first fading demand; NaN where none comes
    spoilt: bool = False  # handed back before the fault: the machine paused the bridge for over 100 ms


def play(fault: str, name: str) -> Outcome:
    """One run."""
    driver = f"{DRIVER_AT}:brake_pedal=40" if fault == "driver brakes" else ""
    with scene(name, driver) as stage:
        if not stage.engaged():
            return Outcome(fault, name, ("did not engage",), math.nan)
        stage.listen(1.0)
        if math.isnan(stage.demands("engine")[-1][1]):
            return Outcome(fault, name, (), math.nan, spoilt=True)
        broken, reaction = FAULTS[fault](stage)
        return Outcome(fault, name, tuple(broken + limits_kept(stage)), reaction)


def main() -> int:
    """Run many and say what broke."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=50)
    parser.add_argument("--priority", type=int, default=0, help="SCHED_FIFO priority of bridge and witness")
    options = parser.parse_args()
    if options.priority:  # what a vehicle's computer would give the bridge; a loaded machine is late without
        os.environ["BRIDGE_PRIORITY"] = str(options.priority)
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(options.priority))
    outcomes = []
    for number in range(options.runs):
        fault = list(FAULTS)[number % len(FAULTS)]
        outcomes.append(play(fault, vehicles.NAMES[number // len(FAULTS) % len(vehicles.NAMES)]))
    print(f"{'fault':<18}{'runs':>5}{'reaction p50':>14}{'max':>9}  broken")
    for fault in FAULTS:
        mine = [o for o in outcomes if o.fault == fault]
        times = [o.reaction_s for o in mine if not math.isnan(o.reaction_s)]
        shown = f"{'-':>14}{'-':>9}"
        if times:
            shown = f"{1e3 * np.median(times):>11.0f} ms{1e3 * max(times):>6.0f} ms"
        print(f"{fault:<18}{len(mine):>5}{shown}  {[o.broken for o in mine if o.broken] or 'none'}")
    broken = sum(bool(o.broken) for o in outcomes)
    spoilt = sum(o.spoilt for o in outcomes)
    print(f"{len(outcomes)} runs in real time, {broken} with a broken invariant, {spoilt} spoilt by load")
    print(f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
