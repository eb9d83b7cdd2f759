"""The three kinds of run behind the start scripts: simulation, vehicle, replay."""

from __future__ import annotations

import json
import socket
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model import checks
from deeptruck_nodes import bag_place, environment, page_server, parameters, run_checks, run_summary
from deeptruck_nodes.run_checks import Misfits, Sections
from deeptruck_nodes.supervisor import Program, Supervisor, node

RADARS: dict[str, dict[str, float]] = {
    "clean": {"range_noise": 0.0, "speed_noise": 0.0},
    "noisy": {"range_noise": 0.1, "speed_noise": 0.05, "dropout_rate": 0.05},
    "field": {"range_noise": 0.1, "speed_noise": 0.05, "dropout_rate": 0.05, "lane_change_at_s": 63.0},
}


PAGE = "live_page"
IN_TIME = ("can_bridge", "controller", "leader", "emulator")  # late, any makes the bridge hand back
SPEAKERS = ("can_bridge", "controller", "replay")  # what they print is for whoever sits before the run


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
    """Run a simulated truck behind a leader; returns the exit code. `given` holds further parameters
    by node."""
    misfits = Misfits()
    truck = misfits.of(lambda: checks.simulator(simulator))
    interface = truck.interface if truck else None
    sections = {
        "recorder": _recorder(common, interface),
        **_page(common, f"{simulator}, {policy}", interface),
        "leader": {},
        "controller": {
            **_controller(policy, interface),
            **_limits(interface, _named(simulator), _descent(given)),
        },
        "truck_sim": {"simulator": _named(simulator)},
    }
    sections = _merged(sections, given, common, misfits)
    _look_at_driving(misfits, common, sections, policy, interface)
    misfits.of_node(sections, "truck_sim", lambda p: run_checks.road_is_known(p["road"]))
    if truck is not None and not lockstep:
        misfits.of_node(sections, "truck_sim", lambda p: run_checks.rate_fits(p["rate_hz"], truck.dt))
    domain = _checked(misfits, common, sections, lockstep)
    _say_limits(sections["controller"], interface)
    return _run("simulation", common, sections, domain, ends="truck_sim")


def drive_vehicle(
    common: Common,
    given: Sections,
    *,
    policy: str,
    emulate: bool,
    speed: float,
    grade: str,
    driver: str,
    actuators: str,
    duration: float,
) -> int:
    """Run a vehicle on a CAN bus, or its emulated controllers; returns the exit code.

    `given` holds the parameters of the bridge, and of the leader if one is simulated; otherwise the radar
    topics come from the truck's radar.
    """
    from truck_bridge import vehicles
    from truck_bridge.emulator.cli import actuator_faults, driver_actions
    from truck_bridge.emulator.road import road

    misfits = Misfits()
    vehicle = misfits.of(lambda: vehicles.load(given["can_bridge"]["vehicle"]))
    interface = TruckInterface.from_dict(vehicle.interface) if vehicle else None
    sections: Sections = {"recorder": _recorder(common, interface)}
    sections |= _page(common, f"{given['can_bridge']['vehicle']}, {policy}", interface)
    sections |= {"leader": {}} if "leader" in given else {}
    # the simulator in a vehicle's file is what the emulator drives, not the truck on a real bus
    slope = misfits.of(lambda: road(grade)) or (lambda distance: 0.0)
    limits = _limits(interface, str(vehicle.truck), _steepest(slope)) if vehicle and emulate else {}
    names = ("set_speed", "brake_limit", "brake_rate") if vehicle else ()
    own = {name: getattr(vehicle, name) for name in names}
    sections |= {"controller": {**_controller(policy, interface), **limits, **own}, "can_bridge": {}}
    sections = _merged(sections, given, common, misfits)
    _look_at_driving(misfits, common, sections, policy, interface)
    misfits.of(lambda: driver_actions(driver))
    if vehicle is not None:
        misfits.of(lambda: actuator_faults(actuators, vehicle))
    misfits.of_node(sections, "can_bridge", lambda p: run_checks.bus_opens(p["interface"], p["channel"]))
    domain = _checked(misfits, common, sections)
    _say_limits(sections["controller"], interface, real=not emulate)
    others: tuple[Program, ...] = ()
    if emulate and vehicle is not None:
        _compile(str(vehicle.truck))
        bridge = parameters.checked("can_bridge", sections["can_bridge"])
        others = (_emulator(bridge, speed=speed, grade=grade, driver=driver, actuators=actuators),)
    return _run("vehicle", common, sections, domain, others=others, duration=duration)


def replay(common: Common, given: Sections) -> int:
    """Play a bag on its topics; a bag whose recorder was killed is repaired first. Returns the exit code."""
    misfits = Misfits()
    sections: Sections = {"recorder": _recorder(common, None), **_page(common, "", None), "replay": {}}
    sections = _merged(sections, given, common, misfits)
    misfits.of_node(sections, "replay", lambda p: run_checks.bag_is_playable(Path(p["bag"]), p["topics"]))
    if common.record is not None:
        misfits.of_node(sections, "replay", lambda p: run_checks.elsewhere(Path(p["bag"]), common.record))
    domain = _checked(misfits, common, sections)
    bag = Path(sections["replay"]["bag"])
    _mend(bag)
    if common.record is not None:
        sections["recorder"]["copy_of"] = str(bag.absolute())
    if common.page:
        sections[PAGE] |= _page(common, bag.name, checks.bag(bag).interface)[PAGE]
    return _run("replay", common, sections, domain, ends="replay")


def _mend(bag: Path) -> None:
    """Repair a bag whose recorder was killed. Raises InputError where it cannot be read."""
    from deeptruck_model.recordings import repair
    from deeptruck_model.recordings.bag_source import BagSource

    if bag.is_dir() and (repaired := repair(bag)):
        print(repaired, flush=True)
    with BagSource(bag):
        pass


def _look_at_driving(
    misfits: Misfits, common: Common, sections: Sections, policy: str, truck: TruckInterface | None
) -> None:
    """Check what every run with a controller needs: its policy and its leader."""
    misfits.of(lambda: run_checks.policy_fits(policy, truck))
    misfits.of_node(sections, "leader", lambda p: run_checks.leader_is_known(p["profile"]))
    misfits.of_node(sections, "leader", lambda p: run_checks.leader_stays(p["profile"], common.record))


def _compile(truck: str) -> None:
    """Simulate one step, so that compilation on a new machine does not delay the run."""
    import numpy as np

    from deeptruck_model import simulators

    simulator = simulators.load(truck)
    i = simulator.interface
    state = simulator.reset(np.zeros((1, len(i.y))))
    simulator.step(state, np.zeros((1, len(i.u))), np.zeros((1, len(i.w))))


def _emulator(bridge: Mapping[str, Any], **options: str | float) -> Program:
    """The program of the ECU emulator on the bridge's bus; empty options are left out."""
    options |= {name: bridge[name] for name in ("vehicle", "interface", "channel")}
    argv = [sys.executable, "-m", "truck_bridge.emulator"]
    argv += [f"--{name}={value}" for name, value in options.items() if value != ""]
    return Program("emulator", argv, says_ready=False)


def _recorder(common: Common, interface: TruckInterface | None) -> dict[str, Any]:
    if common.record is None:
        return {}
    text = json.dumps(interface.to_dict()) if interface else ""
    return {"bag": str(common.record.absolute()), "interface": text}


def _page(common: Common, title: str, interface: TruckInterface | None) -> Sections:
    """The page's parameters, if there is a page."""
    if not common.page:
        return {}
    return {PAGE: {"title": title, "interface": json.dumps(interface.to_dict()) if interface else ""}}


def _controller(policy: str, interface: TruckInterface | None) -> dict[str, Any]:
    custom = {} if interface is None else {"interface": json.dumps(interface.to_dict())}
    return {
        **custom,
        "policy": _driver(policy),
        "uses_grade": bool(interface and interface.grade),
    }


def _limits(interface: TruckInterface | None, simulator: str, descent: float) -> dict[str, Any]:
    """The simulator on which the controller measures the limits of a truck that was not measured before: it
    has other parameters, or drives steeper descents.

    Not one that somebody else wrote: it may take minutes for the 588 stops.
    """
    from deeptruck_cacc.safety.truck_limits import STEEPEST, known
    from deeptruck_model import simulators
    from deeptruck_model.trucks import specification

    if interface is None or interface.brake_unit is None or simulator.startswith(("python:", "fmu:")):
        return {}
    physics = simulator.startswith("truck:")  # its file has them all: nothing needs to be compiled
    parameters = (
        specification.named(simulator.removeprefix("truck:")).values
        if physics
        else simulators.load(simulator).parameters()
    )
    if known(interface, parameters, descent) is not None:
        return {}
    return {"limits_of": simulator, "limits_grade": min(descent, STEEPEST)}


def _descent(given: Sections) -> float:
    """Steepest descent of the simulated truck's road; 0 where its text is none, which is refused later."""
    from deeptruck_nodes import roads

    try:
        road = roads.parse(given["truck_sim"]["road"])
    except InputError:
        return 0.0
    return _steepest(lambda distance: road.at(distance)[0])


def _steepest(slope: Callable[[float], float]) -> float:
    """Steepest descent of 20 km of a road, rise over run, in thousandths."""
    return round(min(slope(25.0 * step) for step in range(800)), 3)


def _say_limits(
    controller: Mapping[str, Any], interface: TruckInterface | None, *, real: bool = False
) -> None:
    """The set speed, and a line if the shield's limits are not those stored for the truck."""
    from deeptruck_cacc.safety.truck_limits import known

    set_speed = parameters.checked("controller", controller)["set_speed"]
    print(f"set speed: {set_speed:g} m/s ({3.6 * set_speed:.0f} km/h)", flush=True)
    if interface is None or not controller.get("shield", True) or interface.brake_unit is None:
        return
    if simulator := controller.get("limits_of"):
        grade = parameters.checked("controller", controller)["limits_grade"]
        where = f"measured on {simulator} at the start, on descents to {-100 * grade:g} %"
        print(f"limits of {interface.name}: {where}", flush=True)
    elif known(interface) is None:
        print(
            f"note: the limits of {interface.name} were never measured: the shield assumes weak brakes and "
            "keeps long gaps; 'controller: {limits_of: SIM}' in --parameters measures them on a simulator",
            flush=True,
        )
    elif real:
        print(
            f"note: the limits of {interface.name} are those of the truck of that name on descents to 3 %; "
            "one of another load needs its own: 'controller: {limits_of: SIM}' in --parameters",
            flush=True,
        )


def _driver(policy: str) -> str:
    """The text of a policy with absolute paths, for the nodes."""
    from deeptruck_cacc.controllers.loading import PLANNER

    if policy.startswith(PLANNER):
        return PLANNER + _named(policy.removeprefix(PLANNER))
    return policy if policy.startswith("baseline:") else str(Path(policy).absolute())


def _named(simulator: str) -> str:
    """The simulator's name for the nodes, which start in the working directory of this program."""
    return simulator if checks.by_scheme(simulator) else str(Path(simulator).absolute())


def _merged(sections: Sections, given: Sections, common: Common, misfits: Misfits) -> Sections:
    """Parameters by priority: the user's file, the start script's options, values that follow from
    the run."""
    own = misfits.of(lambda: _own(common, sections)) or {}
    merged = {
        name: {**values, **given.get(name, {}), **own.get(name, {})} for name, values in sections.items()
    }
    if common.record is None:
        del merged["recorder"]
    return merged


def _own(common: Common, sections: Sections) -> Sections:
    """The parameters of the user's file, by node. Raises InputError for a node that this run does not have,
    and for another bag than that of --record."""
    own = parameters.read_file(common.parameters) if common.parameters else {}
    for name in own:
        if name not in sections:
            raise InputError(
                f"{common.parameters}: this run has no node '{name}'; it has {', '.join(sections)}"
            )
    bag = sections["recorder"].get("bag")
    if "recorder" in own and own["recorder"].get("bag", bag) != bag:
        raise InputError(f"{common.parameters}: --record says where to record; leave out the recorder's bag")
    if "recorder" in own and bag is None:
        raise InputError(f"{common.parameters}: nothing is recorded without --record BAG; add it")
    return own


def _checked(misfits: Misfits, common: Common, sections: Sections, lockstep: bool = False) -> int:
    """The ROS domain of a run without misfits. Raises InputError with all misfits."""
    for name, values in sections.items():
        of_run = {"lockstep": lockstep, "peers": [peer for peer in sections if peer != name]}
        misfits.found += [
            f"{common.parameters}: {name}'s {key} is what this run makes it, {value}; leave it out"
            for key, value in of_run.items()
            if values.get(key, value) != value
        ]
        values.update(of_run)
        misfits.found += parameters.misfits(name, values)
    domain = misfits.of(environment.domain_id)
    misfits.of(run_checks.ros_is_installed)
    misfits.of(lambda: bag_place.check(common.record, common.overwrite))
    misfits.of(lambda: bag_place.check_logs(common.record, common.runs))
    checks.refuse(misfits.found)
    assert domain is not None
    return domain


def _run(
    what: str,
    common: Common,
    sections: Sections,
    domain: int,
    *,
    ends: str = "",
    others: tuple[Program, ...] = (),
    duration: float = 0.0,
) -> int:
    """Lock the domain, prepare the bag, then start. All checks have been made before."""
    lock = environment.DomainLock(domain)
    try:
        page = page_server.opened(parameters.checked(PAGE, sections[PAGE])["port"]) if common.page else None
        with bag_place.made(common.record, common.overwrite) as bag:
            if bag is not None:
                sections["recorder"]["bag"] = str(bag.absolute())
            folder = environment.run_folder(common.runs, what, domain)
            lock.logs_in(folder)
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
            outcome = recorded(common.record, bag)
        if common.record is not None and bag_place.is_whole(common.record):
            for sentence in run_summary.of(common.record, real_time=what == "vehicle"):
                print(sentence, flush=True)
        print(f"ended: {supervisor.why}; {outcome}", flush=True)
        return code
    finally:
        lock.release()


def _hurried(program: Program, sections: Sections) -> Program:
    """The program with the bridge's priority if control depends on it. The simulated radar and the emulator
    stand for devices that no other work makes late."""
    if "can_bridge" not in sections or program.name not in IN_TIME:
        return program
    return replace(program, priority=parameters.checked("can_bridge", sections["can_bridge"])["priority"])


def _page_program(listener: socket.socket, token: str, file: Path) -> Program:
    """The page's program, first to start and last to end. Its address is printed here, because logs may be
    readable by others."""
    print(f"page: {page_server.address(listener, token)}", flush=True)
    secret = {page_server.SOCKET: str(listener.fileno()), page_server.TOKEN: token}
    return replace(node(PAGE, file), spectator=True, environment=secret, descriptors=(listener.fileno(),))


def recorded(record: Path | None, bag: Path | None) -> str:
    """The final line of a run about its recording at `bag`, whose intended path was `record`."""
    if record is None or bag is None:
        return "nothing was to be recorded, --record BAG does"
    if bag_place.is_whole(bag):
        return f"recorded in {record}"
    if bag.exists() and not any(bag.glob("*.mcap")):
        return f"nothing was recorded, {bag} is not the recorder's"
    if bag.exists():
        return f"the bag {bag} is not finished, 'deeptruck-model repair {bag}' repairs it"
    return (
        f"there is no bag {record}" if bag == record else f"nothing was recorded, {record} is the older bag"
    )
