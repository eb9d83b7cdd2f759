"""The three kinds of run behind the start scripts: simulation, vehicle, replay."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_cacc import load_policy
from deeptruck_model import simulators
from deeptruck_model.errors import InputError
from deeptruck_model.recordings import repair
from deeptruck_model.recordings.bag_source import BagSource
from deeptruck_model.signals import TruckInterface
from deeptruck_nodes import bag_place, environment, leaders, parameters, roads, vehicle
from deeptruck_nodes.plant import ticks_a_step
from deeptruck_nodes.supervisor import Program, Supervisor, node
from truck_bridge.bus import open_bus
from truck_bridge.emulator.cli import road as road_of_emulator

Sections = dict[str, dict[str, Any]]

RADARS: dict[str, dict[str, float]] = {
    "clean": {"range_noise": 0.0, "speed_noise": 0.0},
    "noisy": {"range_noise": 0.1, "speed_noise": 0.05, "dropout_rate": 0.05},
    "field": {"range_noise": 0.1, "speed_noise": 0.05, "dropout_rate": 0.05, "lane_change_at_s": 63.0},
}


SPEAKERS = ("can_bridge", "mismatch_monitor")  # what they print is for whoever sits before the run


@dataclass(frozen=True)
class Common:
    """What every run takes: where to record (None: nowhere), own parameters, where the run folders go,
    and the simulator to compare the truck with (empty: none)."""

    record: Path | None = None
    overwrite: bool = False
    parameters: Path | None = None
    runs: Path = Path("runs")
    monitor: str = ""


def describe(simulator: str) -> tuple[TruckInterface, float]:
    """Interface and step (s) of a simulator; a trained one is not loaded for it. Raises InputError."""
    if simulator.startswith("truck:"):
        truck = simulators.load(simulator)
        return truck.interface, truck.dt
    manifest = simulators.read_manifest(Path(simulator))
    return TruckInterface.from_dict(manifest["interface"]), float(manifest["dt"])


def simulate(common: Common, given: Sections, *, policy: str, simulator: str, lockstep: bool) -> int:
    """A simulated truck behind a leader; returns the exit code. `given` holds further parameters by node."""
    interface, dt = describe(simulator)
    load_policy(policy, interface)
    sections = _merged(
        {
            "recorder": _recorder(common, interface),
            **_monitor(common, interface),
            "leader": {},
            "controller": _controller(policy, interface),
            "truck_sim": {"simulator": _absolute(simulator, "truck:")},
        },
        given,
        common,
    )
    leaders.parse(checked(sections, "leader")["profile"])
    truck = checked(sections, "truck_sim")
    roads.parse(truck["road"])
    if not lockstep:
        ticks_a_step(truck["rate_hz"], dt)
    return _run("simulation", common, sections, lockstep=lockstep, ends="truck_sim")


def drive_vehicle(
    common: Common,
    given: Sections,
    *,
    policy: str,
    emulate: bool,
    speed: float,
    grade: str,
    duration: float,
) -> int:
    """A vehicle on a CAN bus, or its emulated controllers; returns the exit code.

    `given` holds the bridge's parameters, and the leader's where one is simulated; otherwise the radar topics
    come from the truck's own radar.
    """
    bridge = parameters.checked("can_bridge", given["can_bridge"])
    interface = vehicle.interface(vehicle.load(bridge["vehicle"]))
    load_policy(policy, interface)
    sections: Sections = {"recorder": _recorder(common, interface), **_monitor(common, interface)}
    if "leader" in given:
        sections["leader"] = {}
    sections |= {"controller": _controller(policy, interface), "can_bridge": {}}
    sections = _merged(sections, given, common)
    if "leader" in sections:
        leaders.parse(checked(sections, "leader")["profile"])
    bus = checked(sections, "can_bridge")
    with vehicle.bridge_errors():
        road_of_emulator(grade)
        open_bus(bus["interface"], bus["channel"]).shutdown()
    if emulate:
        _compile(str(vehicle.load(bus["vehicle"]).truck))
    others = (_emulator(bus, speed, grade),) if emulate else ()
    return _run("vehicle", common, sections, others=others, duration=duration)


def _compile(truck: str) -> None:
    """Drive a truck one step: on a new machine it is compiled for that, and a run would wait on a silent
    bus."""
    simulator = simulators.load(truck)
    i = simulator.interface
    state = simulator.reset(np.zeros((1, len(i.y))))
    simulator.step(state, np.zeros((1, len(i.u))), np.zeros((1, len(i.w))))


def _emulator(bridge: Mapping[str, Any], speed: float, grade: str) -> Program:
    options = {"vehicle": bridge["vehicle"], "interface": bridge["interface"], "channel": bridge["channel"]}
    options |= {"speed": str(speed), "grade": grade}
    argv = [sys.executable, "-m", "truck_bridge.emulator"]
    return Program(
        "emulator", [*argv, *(f"--{name}={value}" for name, value in options.items())], says_ready=False
    )


def replay(common: Common, given: Sections) -> int:
    """A bag back onto its topics; one whose recorder was killed is repaired first. Returns the exit code."""
    sections = _merged(
        {"recorder": _recorder(common, None), **_monitor(common, None), "replay": {}}, given, common
    )
    bag = Path(checked(sections, "replay")["bag"])
    if bag.is_dir() and (mended := repair(bag)):
        print(mended, flush=True)
    with BagSource(bag):
        pass  # raises where it cannot be read
    return _run("replay", common, sections, ends="replay")


def checked(sections: Mapping[str, Mapping[str, Any]], name: str) -> dict[str, Any]:
    """A node's parameters with the defaults filled in. Raises InputError."""
    return parameters.checked(name, sections[name])


def _recorder(common: Common, interface: TruckInterface | None) -> dict[str, Any]:
    if common.record is None:
        return {}
    text = json.dumps(interface.to_dict()) if interface else ""
    return {"bag": str(common.record.absolute()), "interface": text}


def _monitor(common: Common, truck: TruckInterface | None) -> Sections:
    """The monitor's parameters where one was asked for. Raises InputError where it needs other commands."""
    if not common.monitor:
        return {}
    if truck is not None:
        _same_commands(common.monitor, describe(common.monitor)[0], truck)
    return {"mismatch_monitor": {"simulator": _absolute(common.monitor, "truck:")}}


def _same_commands(monitor: str, own: TruckInterface, truck: TruckInterface) -> None:
    for name in own.u:
        here = truck.unit(name) if name in truck.u else "not there"
        if here != own.unit(name):
            raise InputError(
                f"{monitor} takes {name} in {own.unit(name)}, on this truck it is {here}; "
                "choose another simulator for --monitor"
            )
    if own.grade and not truck.grade:
        raise InputError(f"{monitor} needs grade, which this truck does not tell; choose another simulator")


def _controller(policy: str, interface: TruckInterface) -> dict[str, Any]:
    return {
        "policy": _absolute(policy, "baseline:"),
        "interface": json.dumps(interface.to_dict()),
        "uses_grade": interface.grade,
    }


def _absolute(path: str, exempt: str) -> str:
    return path if path.startswith(exempt) else str(Path(path).absolute())


def _merged(sections: Sections, given: Sections, common: Common) -> Sections:
    """Own parameter file over the start script's options over what follows from the run."""
    own = parameters.read_file(common.parameters) if common.parameters else {}
    for name in own:
        if name not in sections:
            raise InputError(
                f"{common.parameters}: this run has no node '{name}'; it has {', '.join(sections)}"
            )
    merged = {
        name: {**values, **given.get(name, {}), **own.get(name, {})} for name, values in sections.items()
    }
    if common.record is None:
        del merged["recorder"]
    return merged


def _run(
    what: str,
    common: Common,
    sections: Sections,
    *,
    lockstep: bool = False,
    ends: str = "",
    others: tuple[Program, ...] = (),
    duration: float = 0.0,
) -> int:
    """Check everything, then start; nothing is written before all of it holds."""
    for name, values in sections.items():
        values.update(lockstep=lockstep, peers=[peer for peer in sections if peer != name])
        parameters.checked(name, values)
    domain = environment.domain_id()
    bag_place.check(common.record, common.overwrite)
    lock = environment.DomainLock(domain)
    try:
        with bag_place.freed(common.record, common.overwrite):
            folder = environment.run_folder(common.runs, what, domain)
            lock.logs_in(folder)
            file = folder / "parameters.yaml"
            parameters.write_file(file, sections)
            nodes = [node(name, file, ends_run=name == ends, speaks=name in SPEAKERS) for name in sections]
            programs = [*nodes[:1], *others, *nodes[1:]]
            print(f"logs in {os.path.relpath(folder)}, ROS domain {domain}", flush=True)
            supervisor = Supervisor(
                folder, programs, environment.ros_environment(folder, domain), lock.descriptor
            )
            code = supervisor.run(duration)
        print(last_line(supervisor.why, common.record), flush=True)
        return code
    finally:
        lock.release()


def last_line(why: str, record: Path | None) -> str:
    """What a run says at its end: why it ended, and where its bag is."""
    if record is None:
        return f"ended: {why}; nothing was to be recorded, --record BAG does"
    return f"ended: {why}; " + (f"the bag is {record}" if record.exists() else f"there is no bag {record}")
