"""The three kinds of run behind the start scripts: simulation, vehicle, replay.

A policy is looked at before any node starts; what is wrong with other options is found by the node that needs
it, which ends the run with one line.
"""

from __future__ import annotations

import importlib.util
import json
import socket
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_core.terminal import console
from deeptruck_model import simulator_facts as facts
from deeptruck_model.manifest import by_scheme
from deeptruck_model.recordings import bag_facts
from deeptruck_model.results import apart
from deeptruck_nodes import environment, leaders, page_server, parameters, roads
from deeptruck_nodes.bag_place import BAG, is_whole
from deeptruck_nodes.parameters import Sections
from deeptruck_nodes.supervisor import Program, Supervisor, node

RADARS: dict[str, dict[str, float]] = {
    "clean": {"range_noise": 0.0, "speed_noise": 0.0},
    "noisy": {"range_noise": 0.1, "speed_noise": 0.05, "dropout_rate": 0.05},
    "field": {"range_noise": 0.1, "speed_noise": 0.05, "dropout_rate": 0.05, "lane_change_at_s": 63.0},
}
PAGE = "live_page"
IN_TIME = ("can_bridge", "controller", "leader", "emulator")  # late, any makes the bridge hand back
SPEAKERS = ("can_bridge", "controller", "leader", "replay")  # what they print is for whoever started the run
OF_RUN = {
    "lockstep",
    "peers",
    "bag",
    "copy_of",
    "vehicle",
    "interface",
    "channel",
}  # as the command line says


@dataclass(frozen=True)
class Common:
    """Options of every run: the bag to record (None: none), parameters, the folder for run folders, and
    whether to show the live page."""

    record: Path | None = None
    overwrite: bool = False
    parameters: Path | None = None
    runs: Path = Path("runs")
    page: bool = False


def simulate(common: Common, given: Sections, *, policy: str, simulator: str, lockstep: bool) -> int:
    """Run a simulated truck behind a leader; returns the exit code. `given` holds the parameters of the nodes
    by name."""
    interface = facts.simulator(simulator).interface
    _check_leader(common, given)
    road = roads.parse(given["truck_sim"]["road"])
    steepest = min(road.at(25.0 * step)[0] for step in range(800))  # of 20 km
    given["truck_sim"]["simulator"] = _absolute(simulator)
    given["controller"] |= _controller(policy, interface) | _limits(_absolute(simulator), steepest)
    sections = {name: given[name] for name in ("leader", "controller", "truck_sim")}
    return _run("simulation", common, sections, f"{simulator}, {policy}", interface, "truck_sim", lockstep)


def drive_vehicle(
    common: Common, given: Sections, *, policy: str, emulator: dict[str, Any] | None, duration: float
) -> int:
    """Run a vehicle on a CAN bus, or its emulated controllers; returns the exit code.

    `given` holds the parameters of the bridge, and of the leader if one is simulated; otherwise the radar
    topics come from the truck's radar. `emulator` are the options of the ECU emulator, None for a real bus.
    """
    from truck_bridge import vehicles

    bridge = given["can_bridge"]
    vehicle = vehicles.load(bridge["vehicle"])
    interface = TruckInterface.from_dict(vehicle.interface)
    _check_leader(common, given)
    given["controller"] |= _controller(policy, interface)
    given["controller"] |= {
        name: getattr(vehicle, name) for name in ("set_speed", "brake_limit", "brake_rate")
    }
    others = []
    if emulator is not None:
        _compile(str(vehicle.truck))
        # the simulator in a vehicle's file is what the emulator drives, not the truck on a real bus
        given["controller"] |= _limits(str(vehicle.truck), emulator["grade"])
        options = emulator | {name: bridge[name] for name in ("vehicle", "interface", "channel")}
        words = [f"--{name}={value}" for name, value in options.items() if value != ""]
        others = [
            Program("emulator", (sys.executable, "-m", "truck_bridge.emulator", *words), says_ready=False)
        ]
    order: tuple[str, ...] = ("leader", "controller", "can_bridge")
    sections = {name: given[name] for name in order if name in given}
    title = f"{bridge['vehicle']}, {policy}"
    return _run("vehicle", common, sections, title, interface, others=others, duration=duration)


def replay(common: Common, given: Sections) -> int:
    """Play a bag on its topics; a bag whose recorder was killed is repaired first. Returns the exit code."""
    from deeptruck_model.recordings import repair

    bag = Path(given["replay"]["bag"])
    if common.record is not None:
        apart(common.record, bag, elsewhere=BAG.elsewhere)
    if bag.is_dir() and (repaired := repair(bag)):
        print(repaired, flush=True)
    return _run("replay", common, given, bag.name, bag_facts.bag(bag).interface, "replay")


def _check_leader(common: Common, given: Sections) -> None:
    """Raises InputError if there is no such leader, or the bag to record is the drive that it repeats."""
    leader = leaders.parse(given["leader"]["profile"]) if "leader" in given else None
    if common.record is not None and isinstance(leader, leaders.Recorded):
        apart(common.record, Path(leader.path), elsewhere=BAG.elsewhere)


def _compile(truck: str) -> None:
    """Simulate one step, so that compilation on a new machine does not delay the run."""
    import numpy as np

    from deeptruck_model import simulators

    simulator = simulators.load(truck)
    i = simulator.interface
    state = simulator.reset(np.zeros((1, len(i.y))))
    simulator.step(state, np.zeros((1, len(i.u))), np.zeros((1, len(i.w))))


def _absolute(simulator: str) -> str:
    """The simulator's name for the nodes, which start in the working directory of this program."""
    return simulator if by_scheme(simulator) else str(Path(simulator).absolute())


def _controller(policy: str, interface: TruckInterface) -> dict[str, Any]:
    """The controller's parameters. Raises InputError for a policy that cannot drive this truck, before any
    node starts; of a planner only its simulator is looked for, as loading it may compile."""
    from deeptruck_cacc.controllers.loading import PLANNER, load_policy

    if policy.startswith(PLANNER):
        facts.simulator(policy.removeprefix(PLANNER))
        policy = PLANNER + _absolute(policy.removeprefix(PLANNER))
    else:
        load_policy(policy, interface)
        policy = policy if policy.startswith("baseline:") else str(Path(policy).absolute())
    return {"policy": policy, "interface": json.dumps(interface.to_dict()), "uses_grade": interface.grade}


def _limits(simulator: str, steepest: float) -> dict[str, Any]:
    """What the controller measures the truck's limits on, unless they are known: the simulator, on its road.

    Not one that somebody else wrote: it may take minutes for the 588 stops.
    """
    if simulator.startswith(("python:", "fmu:")):
        return {}
    return {"limits_of": simulator, "limits_grade": min(round(steepest, 3), 0.0)}


def _run(
    what: str,
    common: Common,
    sections: Sections,
    title: str,
    interface: TruckInterface | None,
    ends: str = "",
    lockstep: bool = False,
    others: Sequence[Program] = (),
    duration: float = 0.0,
) -> int:
    """Start the nodes of `sections`, with the recorder and the page if there is to be one, and `others`.
    Nothing is started or written before all parameters fit."""
    if importlib.util.find_spec("rclpy") is None:
        missing = console.MISSING.format(name="rclpy", extra="ros")
        raise InputError(f"{missing}, or source a ROS 2 Jazzy")
    stated = json.dumps(interface.to_dict()) if interface else ""
    if common.record is not None:
        copied = {"copy_of": sections["replay"]["bag"]} if what == "replay" else {"interface": stated}
        sections = {"recorder": {"bag": str(common.record.absolute()), **copied}, **sections}
    if common.page:
        sections = {PAGE: {"title": title, "interface": stated}, **sections}
    _take_file(common.parameters, sections)
    for name in sections:
        peers = [peer for peer in sections if peer != name]
        sections[name] = parameters.checked(name, {**sections[name], "lockstep": lockstep, "peers": peers})
    domain = environment.domain_id()
    lock = environment.DomainLock(domain)
    try:
        page = page_server.opened(sections[PAGE]["port"]) if common.page else None
        with _recording(common):
            folder = environment.run_folder(common.runs, what)
            file = folder / "parameters.yaml"
            parameters.write_file(file, sections)
            names = [name for name in sections if name != PAGE]
            nodes = [node(name, file, ends_run=name == ends, speaks=name in SPEAKERS) for name in names]
            programs = [_hurried(one, sections) for one in [*nodes[:1], *others, *nodes[1:]]]
            if page is not None:
                programs.insert(0, _page_program(*page, file))
            supervisor = Supervisor(
                folder, programs, environment.ros_environment(folder, domain), lock.descriptor
            )
            code = supervisor.run(duration)
            outcome = recorded(common.record)
        print(f"ended: {supervisor.why}; {outcome}", flush=True)
        return code
    finally:
        lock.release()


def _recording(common: Common) -> AbstractContextManager[None]:
    """Makes room for the recorder's bag, and removes an older one once the new one is whole."""
    if common.record is None:
        return nullcontext()
    return BAG.recording(common.record, overwrite=common.overwrite, whole=is_whole)


def _take_file(file: Path | None, sections: Sections) -> None:
    """Let the user's parameter file win over the options.

    Raises InputError for a node that this run does not have, and for what only the command line can say.
    """
    for name, values in (parameters.read_file(file) if file else {}).items():
        if name not in sections:
            raise InputError(f"{file}: this run has no node '{name}'; it has {', '.join(sections)}")
        if taken := sorted(OF_RUN & values.keys()):
            raise InputError(f"{file}: {name}'s {taken[0]} follows from the command line; leave it out")
        sections[name] = {**sections[name], **values}


def _hurried(program: Program, sections: Sections) -> Program:
    """The program with the bridge's priority if control depends on it. The simulated radar and the emulator
    stand for devices that no other work makes late."""
    if "can_bridge" not in sections or program.name not in IN_TIME:
        return program
    return replace(program, priority=sections["can_bridge"]["priority"])


def _page_program(listener: socket.socket, token: str, file: Path) -> Program:
    """The page's program, first to start and last to end. Its address is printed here, because logs may be
    readable by others."""
    print(f"page: {page_server.address(listener, token)}", flush=True)
    secret = {page_server.SOCKET: str(listener.fileno()), page_server.TOKEN: token}
    return replace(node(PAGE, file), spectator=True, environment=secret, descriptors=(listener.fileno(),))


def recorded(record: Path | None) -> str:
    """The final line of a run about its recording."""
    if record is None:
        return "nothing was to be recorded, --record BAG does"
    if is_whole(record):
        return f"recorded in {record}"
    if any(record.glob("*.mcap")):
        return f"the bag {record} is not finished, 'deeptruck-model repair {record}' repairs it"
    return "nothing was recorded"
