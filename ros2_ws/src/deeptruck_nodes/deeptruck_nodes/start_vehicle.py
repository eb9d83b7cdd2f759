"""Start command: drives a truck over CAN with can_bridge, controller and recorder, on a real bus or against
an ECU emulator.
"""

from __future__ import annotations

import deeptruck_core.terminal.script_start  # noqa: F401 - Ctrl-C during the imports that follow

# isort: split
from typing import Annotated, Any

import typer

from deeptruck_core.errors import InputError
from deeptruck_nodes import options, runs

EXAMPLES = """
Examples:\n
  deeptruck-vehicle --vehicle trucksim --policy baseline:acc --emulator --engage\n
  deeptruck-vehicle --vehicle trucksim --policy baseline:acc --emulator --engage --radar-lost-at 30
  --driver engaged+60:brake_pedal=40\n
  deeptruck-vehicle --vehicle trucksim --policy baseline:acc --emulator --engage
  --leader steps:speeds=20/5,every=30,acceleration=2 --actuators engaged+10:brake.gain=0.5\n
  deeptruck-vehicle --vehicle volvo --policy POLICY --interface socketcan --channel can0\n
Without --engage the bridge listens until a person calls the service /can_bridge/engage (std_srvs/Trigger).\n
Every parameter of every node: docs/parameters.md.
"""


# The truck and its bus
Vehicle = Annotated[str, typer.Option(help="trucksim, freightliner, volvo or a YAML file.")]
Interface = Annotated[str, typer.Option(help="python-can interface: socketcan, udp_multicast, loopback, ...")]
Channel = Annotated[str, typer.Option(help="Channel of the interface.")]
Engage = Annotated[
    bool, typer.Option("--engage", help="A person asks for control as soon as the conditions hold.")
]
NoLoad = Annotated[
    bool, typer.Option("--no-load", help="Send nothing; /diagnostics shows what would be sent.")
]
# The emulated truck and its road
Emulator = Annotated[
    bool, typer.Option("--emulator", help="Put the ECU emulator and a simulated leader behind the bus.")
]
InitialSpeed = Annotated[float, typer.Option(help="Of the emulated truck, m/s.", min=0.0, max=50.0)]
Grade = Annotated[float, typer.Option(help="Of the emulated road, rise/run.", min=-0.2, max=0.2)]
Driver = Annotated[
    str,
    typer.Option(help="What the emulated truck's driver does: SECONDS:KEY=VALUE,... or engaged+SECONDS:..."),
]
Actuators = Annotated[
    str,
    typer.Option(
        help="Faults of the emulated truck's actuators: SECONDS:AXIS.KEY=VALUE,... or engaged+SECONDS:... "
        "AXIS is engine, retarder or brake; KEY is gain (share of the demand), late_s, stuck (1), drags "
        "(share of full) or lost (1: its frames)."
    ),
]
# Who drives, and behind whom
Leader = Annotated[
    str | None,
    typer.Option(help="Simulated vehicle ahead, as in deeptruck-simulation; else the truck's radar."),
]
Radar = Annotated[options.Errors, typer.Option(help="Errors of the simulated radar.")]
Seed = Annotated[int, typer.Option(help="Of the radar's errors.")]
# The run
Duration = Annotated[float, typer.Option(help="s; 0: until Ctrl-C.", min=0.0)]


def main(
    vehicle: Vehicle,
    policy: options.Policy,
    interface: Interface = "loopback",
    channel: Channel = "deeptruck",
    record: options.Record = None,
    overwrite: options.Overwrite = False,
    emulator: Emulator = False,
    leader: Leader = None,
    radar: Radar = "noisy",
    radar_lost_at: options.RadarLostAt = 0.0,
    radar_lost_for: options.RadarLostFor = 2.0,
    driver: Driver = "",
    actuators: Actuators = "",
    initial_speed: InitialSpeed = 20.0,
    initial_gap: options.InitialGap = 0.0,
    grade: Grade = 0.0,
    time_gap: options.TimeGap = 2.0,
    engage: Engage = False,
    no_load: NoLoad = False,
    duration: Duration = 0.0,
    seed: Seed = 0,
    page: options.Page = False,
    parameters: options.Parameters = None,
    run_folders: options.RunFolders = options.RUNS,
) -> None:
    """Drive a truck over CAN with the simulation's nodes. Ctrl-C hands control back and ends in order."""
    bridge = {
        "vehicle": vehicle,
        "interface": interface,
        "channel": channel,
        "engage": engage,
        "no_load": no_load,
    }
    given: dict[str, dict[str, Any]] = {"can_bridge": bridge, "controller": {"target_time_gap": time_gap}}
    if leader is not None or emulator:
        profile = {"profile": leader or "constant:speed=20", "initial_gap": initial_gap, "seed": seed}
        lost = {"lost_at_s": radar_lost_at, "lost_for_s": radar_lost_for}
        given["leader"] = {**profile, **runs.RADARS[radar], **lost}
    elif radar_lost_at:
        raise InputError("--radar-lost-at is of a simulated radar: add --leader or --emulator")
    for option, text in (("--driver", driver), ("--actuators", actuators)):
        if text and not emulator:
            raise InputError(f"{option} is of the emulated truck: add --emulator")
    emulated = {"speed": initial_speed, "grade": grade, "driver": driver, "actuators": actuators}
    common = runs.Common(record, overwrite, parameters, run_folders, page)
    raise typer.Exit(
        runs.drive_vehicle(
            common, given, policy=policy, emulator=emulated if emulator else None, duration=duration
        )
    )


def start(program: str = "deeptruck-vehicle") -> None:
    """The console script; the script of the ROS 2 workspace passes its own name as `program`."""
    options.start(main, EXAMPLES, program)
